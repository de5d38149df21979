"""Properties of each mode of operation for a master, in one table; a new mode needs a row here and an activity of its own."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from axisbus.cia402.modes import FACTS, ModeOfOperation

_M = ModeOfOperation


class ControlledQuantity(Enum):
    """The quantity that a mode controls."""

    POSITION = "position"
    VELOCITY = "velocity"
    TORQUE = "torque"
    UNUSED = "torque, in a mode that axisbus does not use"


class AfterHalt(Enum):
    """The rest of the motion of a halted drive, with which the drive would continue when its halt bit falls."""

    TARGET = "the target of the mode, which the master holds at standstill"
    SET_POINT = "the last set-point that the drive has taken"
    SEARCH = "a search for the home position, which the fall of bit 4 has ended"


@dataclass(frozen=True, slots=True)
class ModeProperties:
    """Properties of a mode for a master, in addition to its objects (see ``cia402.modes``).

    ``demand``: 6062h is the value that commands the motor, and can be checked. ``immediate``: targets act from the first frame on,
    without ramps of the drive. ``standstill_rank``: rank among the modes in which a drive is enabled, beginning with the mode that
    keeps standstill most reliably; None if no drive is enabled in it. ``holds_load``: the mode holds a load until a set-point is
    given. ``after_halt``: None if it is not known.
    """

    controls: ControlledQuantity
    demand: bool = False
    immediate: bool = False
    standstill_rank: int | None = None
    holds_load: bool = False
    after_halt: AfterHalt | None = AfterHalt.TARGET


MODE_PROPERTIES = {
    _M.PROFILE_POSITION: ModeProperties(
        ControlledQuantity.POSITION,
        demand=True,
        standstill_rank=0,
        holds_load=True,
        after_halt=AfterHalt.SET_POINT,
    ),
    _M.VELOCITY: ModeProperties(ControlledQuantity.VELOCITY, after_halt=None),
    _M.PROFILE_VELOCITY: ModeProperties(ControlledQuantity.VELOCITY, standstill_rank=2, holds_load=True),
    _M.PROFILE_TORQUE: ModeProperties(ControlledQuantity.TORQUE, immediate=True, standstill_rank=4),
    # 6062h cannot be checked in homing.
    _M.HOMING: ModeProperties(ControlledQuantity.POSITION, after_halt=AfterHalt.SEARCH),
    _M.INTERPOLATED_POSITION: ModeProperties(ControlledQuantity.POSITION, demand=True),
    _M.CYCLIC_SYNC_POSITION: ModeProperties(
        ControlledQuantity.POSITION, demand=True, immediate=True, standstill_rank=1, holds_load=True
    ),
    _M.CYCLIC_SYNC_VELOCITY: ModeProperties(ControlledQuantity.VELOCITY, immediate=True, standstill_rank=3),
    _M.CYCLIC_SYNC_TORQUE: ModeProperties(ControlledQuantity.TORQUE, immediate=True),
    _M.CYCLIC_SYNC_TORQUE_ANGLE: ModeProperties(ControlledQuantity.UNUSED, after_halt=None),
}


def _modes_that_control(*controls: ControlledQuantity) -> frozenset[ModeOfOperation]:
    return frozenset(mode for mode, properties in MODE_PROPERTIES.items() if properties.controls in controls)


_CYCLIC = frozenset(mode for mode, facts in FACTS.items() if facts.cyclic)

POSITION_MODES = _modes_that_control(ControlledQuantity.POSITION)
TORQUE_MODES = _modes_that_control(ControlledQuantity.TORQUE)
# Modes in which 6062h need not command the motor, or cannot be checked by the master.
WITHOUT_POSITION_DEMAND = frozenset(
    mode for mode, properties in MODE_PROPERTIES.items() if not properties.demand
)
# Modes in which 607Ah has no effect. A drive that changes from them into a position mode moves to it.
WITHOUT_TARGET_POSITION = WITHOUT_POSITION_DEMAND - {_M.HOMING}
_BY_RANK = {
    properties.standstill_rank: mode
    for mode, properties in MODE_PROPERTIES.items()
    if properties.standstill_rank is not None
}
RESTING_MODES = tuple(mode for _, mode in sorted(_BY_RANK.items()))
# Modes that an energised drive keeps when it is found; a drive in a torque mode is switched to a mode that holds the axis.
RETAINED_MODES = frozenset(RESTING_MODES) - TORQUE_MODES
HOLDING_MODES = tuple(mode for mode in RESTING_MODES if MODE_PROPERTIES[mode].holds_load)
FOLLOWS_TARGETS = frozenset(mode for mode, properties in MODE_PROPERTIES.items() if properties.immediate)
ADDS_OFFSETS = FOLLOWS_TARGETS & _CYCLIC
# Modes in which the drive is at standstill until it gets a set-point, velocity or torque.
WAITS_FOR_COMMAND = frozenset(RESTING_MODES) - _CYCLIC
# Modes without offsets, in which the drive reaches a target on a ramp.
ON_RAMPS = WAITS_FOR_COMMAND - TORQUE_MODES
# Modes in which the motor is compared with the position that the drive reports as its demand.
FOLLOWED = frozenset(RESTING_MODES) & POSITION_MODES
