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
class Conduct:
    """Properties of a mode for a master, in addition to its objects (see ``cia402.modes``).

    ``demand``: 6062h is the value that commands the motor, and can be checked. ``at_once``: targets act from the first frame on,
    without ramps of the drive. ``rests``: rank among the modes in which a drive is enabled, beginning with the mode that keeps
    standstill most reliably; None if no drive is enabled in it. ``holds``: the mode holds a load until a set-point is given.
    ``after_halt``: None if it is not known.
    """

    leads: ControlledQuantity
    demand: bool = False
    at_once: bool = False
    rests: int | None = None
    holds: bool = False
    after_halt: AfterHalt | None = AfterHalt.TARGET


CONDUCT = {
    _M.PROFILE_POSITION: Conduct(
        ControlledQuantity.POSITION, demand=True, rests=0, holds=True, after_halt=AfterHalt.SET_POINT
    ),
    _M.VELOCITY: Conduct(ControlledQuantity.VELOCITY, after_halt=None),
    _M.PROFILE_VELOCITY: Conduct(ControlledQuantity.VELOCITY, rests=2, holds=True),
    _M.PROFILE_TORQUE: Conduct(ControlledQuantity.TORQUE, at_once=True, rests=4),
    # 6062h cannot be checked in homing.
    _M.HOMING: Conduct(ControlledQuantity.POSITION, after_halt=AfterHalt.SEARCH),
    _M.INTERPOLATED_POSITION: Conduct(ControlledQuantity.POSITION, demand=True),
    _M.CYCLIC_SYNC_POSITION: Conduct(
        ControlledQuantity.POSITION, demand=True, at_once=True, rests=1, holds=True
    ),
    _M.CYCLIC_SYNC_VELOCITY: Conduct(ControlledQuantity.VELOCITY, at_once=True, rests=3),
    _M.CYCLIC_SYNC_TORQUE: Conduct(ControlledQuantity.TORQUE, at_once=True),
    _M.CYCLIC_SYNC_TORQUE_ANGLE: Conduct(ControlledQuantity.UNUSED, after_halt=None),
}


def _that(*leads: ControlledQuantity) -> frozenset[ModeOfOperation]:
    return frozenset(mode for mode, conduct in CONDUCT.items() if conduct.leads in leads)


_CYCLIC = frozenset(mode for mode, facts in FACTS.items() if facts.cyclic)

POSITION_MODES = _that(ControlledQuantity.POSITION)
TORQUE_MODES = _that(ControlledQuantity.TORQUE)
# Modes in which 6062h need not command the motor, or cannot be checked by the master.
WITHOUT_POSITION_DEMAND = frozenset(mode for mode, conduct in CONDUCT.items() if not conduct.demand)
# Modes in which 607Ah has no effect. A drive that changes from them into a position mode moves to it.
WITHOUT_TARGET_POSITION = WITHOUT_POSITION_DEMAND - {_M.HOMING}
_PLACES = {conduct.rests: mode for mode, conduct in CONDUCT.items() if conduct.rests is not None}
RESTING_MODES = tuple(mode for _, mode in sorted(_PLACES.items()))
# Modes that an energised drive keeps when it is found; a drive in a torque mode is switched to a mode that holds the axis.
KEPT_MODES = frozenset(RESTING_MODES) - TORQUE_MODES
HOLDING_MODES = tuple(mode for mode in RESTING_MODES if CONDUCT[mode].holds)
FOLLOWS_TARGETS = frozenset(mode for mode, conduct in CONDUCT.items() if conduct.at_once)
ADDS_OFFSETS = FOLLOWS_TARGETS & _CYCLIC
# Modes in which the drive is at standstill until it gets a set-point, velocity or torque.
WAITS_FOR_COMMAND = frozenset(RESTING_MODES) - _CYCLIC
# Modes without offsets, in which the drive reaches a target on a ramp.
ON_RAMPS = WAITS_FOR_COMMAND - TORQUE_MODES
# Modes in which the motor is compared with the position that the drive reports as its demand.
FOLLOWED = frozenset(RESTING_MODES) & POSITION_MODES
