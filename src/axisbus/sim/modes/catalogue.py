"""Which modes of operation the stand-in drive can have."""

from __future__ import annotations

from axisbus.sim.modes.base import Mode
from axisbus.sim.modes.cyclic_position import CyclicPosition
from axisbus.sim.modes.homing import Homing
from axisbus.sim.modes.interpolated_position import InterpolatedPosition
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
    """Return a fresh mode for each value of 6060h, 0 (none) among them."""
    return {kind.code: kind() for kind in _MODES}
