"""How each mode of operation behaves under a master, in one table; a new mode is a row here, and a move of its own."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from axisbus.cia402.modes import FACTS, ModeOfOperation

_M = ModeOfOperation


class ControlledQuantity(Enum):
    """What a mode controls."""

    POSITION = "position"
    VELOCITY = "velocity"
    TORQUE = "torque"
    UNUSED = "torque, in a mode that is not used here"


@dataclass(frozen=True, slots=True)
class Conduct:
    """What a master has to know of a mode beside its objects (those are in ``cia402.modes``).

    ``demand``: 6062h is what leads the motor, and can be judged. ``at_once``: targets act from the first frame on, not on ramps of
    the drive. ``rests``: its place among the modes that a drive is enabled in, from the one that stands still most surely; None
    where no drive is enabled in it. ``holds``: a load is held in it until something is asked for.
    """

    leads: ControlledQuantity
    demand: bool = False
    at_once: bool = False
    rests: int | None = None
    holds: bool = False


CONDUCT = {
    _M.PROFILE_POSITION: Conduct(ControlledQuantity.POSITION, demand=True, rests=0, holds=True),
    _M.VELOCITY: Conduct(ControlledQuantity.VELOCITY),
    _M.PROFILE_VELOCITY: Conduct(ControlledQuantity.VELOCITY, rests=2, holds=True),
    _M.PROFILE_TORQUE: Conduct(ControlledQuantity.TORQUE, at_once=True, rests=4),
    _M.HOMING: Conduct(ControlledQuantity.POSITION),  # 6062h shows what nobody can judge
    _M.INTERPOLATED_POSITION: Conduct(ControlledQuantity.POSITION, demand=True),
    _M.CYCLIC_SYNC_POSITION: Conduct(
        ControlledQuantity.POSITION, demand=True, at_once=True, rests=1, holds=True
    ),
    _M.CYCLIC_SYNC_VELOCITY: Conduct(ControlledQuantity.VELOCITY, at_once=True, rests=3),
    _M.CYCLIC_SYNC_TORQUE: Conduct(ControlledQuantity.TORQUE, at_once=True),
    _M.CYCLIC_SYNC_TORQUE_ANGLE: Conduct(ControlledQuantity.UNUSED),
}


def _that(*leads: ControlledQuantity) -> frozenset[ModeOfOperation]:
    return frozenset(mode for mode, conduct in CONDUCT.items() if conduct.leads in leads)


_CYCLIC = frozenset(mode for mode, facts in FACTS.items() if facts.cyclic)

POSITION_MODES = _that(ControlledQuantity.POSITION)
TORQUE_MODES = _that(ControlledQuantity.TORQUE)
# In these 6062h need not be what leads the motor, or is not anything that the master could judge.
WITHOUT_POSITION_DEMAND = frozenset(mode for mode, conduct in CONDUCT.items() if not conduct.demand)
# In these 607Ah does not act, and a drive that falls out of them into a position mode goes to it.
WITHOUT_TARGET_POSITION = WITHOUT_POSITION_DEMAND - {_M.HOMING}
_PLACES = {conduct.rests: mode for mode, conduct in CONDUCT.items() if conduct.rests is not None}
RESTING_MODES = tuple(mode for _, mode in sorted(_PLACES.items()))
# Those that a drive found energised stays in; one that was driven by a torque is brought into one that holds it.
KEPT_MODES = frozenset(RESTING_MODES) - TORQUE_MODES
HOLDING_MODES = tuple(mode for mode in RESTING_MODES if CONDUCT[mode].holds)
FOLLOWS_TARGETS = frozenset(mode for mode, conduct in CONDUCT.items() if conduct.at_once)
ADDS_OFFSETS = FOLLOWS_TARGETS & _CYCLIC
# In these the drive stands until a set-point, velocity or torque is given to it.
WAITS_FOR_COMMAND = frozenset(RESTING_MODES) - _CYCLIC
# In these no offset acts, and a target is reached on a ramp.
ON_RAMPS = WAITS_FOR_COMMAND - TORQUE_MODES
# In these the motor is held against where the drive says that it leads it.
FOLLOWED = frozenset(RESTING_MODES) & POSITION_MODES
