"""Modes of operation that the simulated drive supports."""

from __future__ import annotations

from axisbus.sim.modes.base import Mode
from axisbus.sim.modes.cyclic_position import CyclicPosition, InterpolatedPosition
from axisbus.sim.modes.homing import Homing
from axisbus.sim.modes.profile_position import ProfilePosition
from axisbus.sim.modes.torque import CyclicTorque, ProfileTorque
from axisbus.sim.modes.velocity import CyclicVelocity, ProfileVelocity

_MODES: tuple[type[Mode], ...] = (
    Mode,
    ProfilePosition,
    ProfileVelocity,
    ProfileTorque,
    Homing,
    InterpolatedPosition,
    CyclicPosition,
    CyclicVelocity,
    CyclicTorque,
)
IMPLEMENTED = frozenset(mode.code for mode in _MODES if mode.code)


def make_modes() -> dict[int, Mode]:
    """Return a new mode object for each value of 6060h, including 0 (none)."""
    return {kind.code: kind() for kind in _MODES}
