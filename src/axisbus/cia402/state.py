"""The power-stage state machine of CiA 402 as one table, and the planner of the next command.

Theory of operation
-------------------
Two rules:

1. The drive owns the state. The master only sees it in the statusword (``decode``), and only requests changes with the controlword.
2. A plan is one step: from the present and the wanted state, ``plan`` returns the command to send now, or None if there is nothing
   to send. It keeps no state, so if a drive changes its state unexpectedly, goes to fault or is slow, the next call simply plans
   again.

``TRANSITIONS`` is the figure of CiA 402-2 (7.2, "state machine of the power drive system") with its numbers 0 to 16. ``plan`` takes
the shortest sequence of transitions that a master may request (``_PLANNED``). It never passes through *operation enabled* to reach
another state: a typing error must not energise a motor. It never passes through *quick stop active* either: from *operation
enabled* downwards it uses 5, 6, 7, so that the drive's own disabling ramp and brake times take effect.

These transitions are intentionally not planned, or only in one case:

- 8 and 9 leave *operation enabled* without the drive's disabling ramp (9 lets the motor coast). They must be requested explicitly.
- 15 (fault reset) is a rising edge and a separate decision; it belongs to ``reset``.
- 16 (quick stop active to operation enabled) is only used if *operation enabled* itself is the target.
"""

from __future__ import annotations

from collections import deque
from enum import Enum
from functools import cache
from typing import NamedTuple

from axisbus.cia402.controlword import DISABLE_OPERATION, PowerCommand


class PowerState(Enum):
    """A state of the power stage, by the standard's name.

    Modules that use a member in every cycle bind it to a module-level name: a look-up in an Enum costs more than a call.
    """

    __hash__ = object.__hash__  # members are looked up in sets in every cycle, and Enum's own method is slow

    NOT_READY_TO_SWITCH_ON = "not ready to switch on"
    SWITCH_ON_DISABLED = "switch on disabled"
    READY_TO_SWITCH_ON = "ready to switch on"
    SWITCHED_ON = "switched on"
    OPERATION_ENABLED = "operation enabled"
    QUICK_STOP_ACTIVE = "quick stop active"
    FAULT_REACTION_ACTIVE = "fault reaction active"
    FAULT = "fault"
    UNKNOWN = "unknown"


_S = PowerState
# (mask, value, state): CiA 402-2 table 29. The order does not matter, because the rows exclude each other.
STATUSWORD_PATTERNS = (
    (0x4F, 0x00, _S.NOT_READY_TO_SWITCH_ON),
    (0x4F, 0x40, _S.SWITCH_ON_DISABLED),
    (0x6F, 0x21, _S.READY_TO_SWITCH_ON),
    (0x6F, 0x23, _S.SWITCHED_ON),
    (0x6F, 0x27, _S.OPERATION_ENABLED),
    (0x6F, 0x07, _S.QUICK_STOP_ACTIVE),
    (0x4F, 0x0F, _S.FAULT_REACTION_ACTIVE),
    (0x4F, 0x08, _S.FAULT),
)


class Transition(NamedTuple):
    """One transition of the figure; ``command`` is None if only the drive itself makes it."""

    number: int
    source: PowerState | None  # None: any state
    target: PowerState
    command: PowerCommand | None


TRANSITIONS = (
    Transition(0, None, _S.NOT_READY_TO_SWITCH_ON, None),
    Transition(1, _S.NOT_READY_TO_SWITCH_ON, _S.SWITCH_ON_DISABLED, None),
    Transition(2, _S.SWITCH_ON_DISABLED, _S.READY_TO_SWITCH_ON, PowerCommand.SHUTDOWN),
    Transition(3, _S.READY_TO_SWITCH_ON, _S.SWITCHED_ON, PowerCommand.SWITCH_ON),
    Transition(4, _S.SWITCHED_ON, _S.OPERATION_ENABLED, PowerCommand.ENABLE_OPERATION),
    Transition(5, _S.OPERATION_ENABLED, _S.SWITCHED_ON, DISABLE_OPERATION),
    Transition(6, _S.SWITCHED_ON, _S.READY_TO_SWITCH_ON, PowerCommand.SHUTDOWN),
    Transition(7, _S.READY_TO_SWITCH_ON, _S.SWITCH_ON_DISABLED, PowerCommand.DISABLE_VOLTAGE),
    Transition(8, _S.OPERATION_ENABLED, _S.READY_TO_SWITCH_ON, PowerCommand.SHUTDOWN),
    Transition(9, _S.OPERATION_ENABLED, _S.SWITCH_ON_DISABLED, PowerCommand.DISABLE_VOLTAGE),
    Transition(10, _S.SWITCHED_ON, _S.SWITCH_ON_DISABLED, PowerCommand.DISABLE_VOLTAGE),
    Transition(11, _S.OPERATION_ENABLED, _S.QUICK_STOP_ACTIVE, PowerCommand.QUICK_STOP),
    # Transition 12 may also be automatic.
    Transition(12, _S.QUICK_STOP_ACTIVE, _S.SWITCH_ON_DISABLED, PowerCommand.DISABLE_VOLTAGE),
    Transition(13, None, _S.FAULT_REACTION_ACTIVE, None),
    Transition(14, _S.FAULT_REACTION_ACTIVE, _S.FAULT, None),
    Transition(15, _S.FAULT, _S.SWITCH_ON_DISABLED, PowerCommand.FAULT_RESET),
    Transition(16, _S.QUICK_STOP_ACTIVE, _S.OPERATION_ENABLED, PowerCommand.ENABLE_OPERATION),
)

_PLANNED = frozenset({2, 3, 4, 5, 6, 7, 11, 12, 16})

_NEVER_PASSED = frozenset({_S.OPERATION_ENABLED, _S.QUICK_STOP_ACTIVE})

# States that a master may request; only the drive enters the others.
TARGETS = frozenset(
    {
        _S.SWITCH_ON_DISABLED,
        _S.READY_TO_SWITCH_ON,
        _S.SWITCHED_ON,
        _S.OPERATION_ENABLED,
        _S.QUICK_STOP_ACTIVE,
    }
)

# In these states the power stage drives the motor.
ENERGISED = frozenset({_S.OPERATION_ENABLED, _S.QUICK_STOP_ACTIVE, _S.FAULT_REACTION_ACTIVE})


def decode(statusword: int) -> PowerState:
    """Return the state in a statusword; a pattern outside the table is ``PowerState.UNKNOWN``."""
    return _DECODED[statusword & 0x6F]


def _decode(statusword: int) -> PowerState:
    for mask, value, state in STATUSWORD_PATTERNS:
        if statusword & mask == value:
            return state
    return _S.UNKNOWN


_DECODED = tuple(_decode(word) for word in range(0x70))


@cache
def plan(state: PowerState, target: PowerState) -> PowerCommand | None:
    """Return the next command from ``state`` to ``target``; None to wait (or if the target is reached).

    None is also returned for states in which only the drive can act (not ready to switch on, fault reaction active), for *fault*,
    which needs a reset first, and for an unknown state, in which nothing is commanded.

    Raises:
        ValueError: ``target`` is not a state that a master may request.
    """
    if target not in TARGETS:
        raise ValueError(f"no drive can be asked for the state {target.value!r}")
    route = _route(state, target)
    return route[0].command if route else None


def _route(state: PowerState, target: PowerState) -> list[Transition]:
    """Return the shortest sequence of transitions by breadth-first search; empty if the target is reached or not reachable."""
    paths: deque[tuple[PowerState, list[Transition]]] = deque([(state, [])])
    seen = {state}
    while paths:
        here, path = paths.popleft()
        if here is target:
            return path
        for arrow in _arrows(here, target):
            if arrow.target not in seen:
                seen.add(arrow.target)
                paths.append((arrow.target, [*path, arrow]))
    return []


def _arrows(here: PowerState, target: PowerState) -> list[Transition]:
    return [
        arrow
        for arrow in TRANSITIONS
        if arrow.number in _PLANNED
        and arrow.source is here
        and (arrow.target is target or arrow.target not in _NEVER_PASSED)
    ]
