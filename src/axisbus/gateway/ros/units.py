"""Convert an axis's unit to ROS 2 (REP 103): rad and N·m for revolute joints, m and N for prismatic ones; nothing is guessed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import NamedTuple

_TURN = 2.0 * math.pi


class JointUnit(NamedTuple):
    """``factor``: rad or m in one unit of the axis; ``turns``: whether the joint is revolute, otherwise prismatic."""

    factor: float
    turns: bool

    @property
    def name(self) -> str:
        """The unit in ROS 2."""
        return "rad" if self.turns else "m"


_ANGLES = {
    **dict.fromkeys(("rad", "radian", "radians"), 1.0),
    "mrad": 1e-3,
    **dict.fromkeys(("deg", "degree", "degrees", "°"), _TURN / 360.0),
    **dict.fromkeys(("turn", "turns", "rev", "revolution", "revolutions"), _TURN),
}
_LENGTHS = {
    "m": 1.0,
    "dm": 0.1,
    "cm": 0.01,
    "mm": 1e-3,
    **dict.fromkeys(("um", "µm", "μm"), 1e-6),
    **dict.fromkeys(("in", "inch"), 0.0254),
    "ft": 0.3048,
}
JOINT_UNITS: Mapping[str, JointUnit] = {
    **{unit: JointUnit(factor, True) for unit, factor in _ANGLES.items()},
    **{unit: JointUnit(factor, False) for unit, factor in _LENGTHS.items()},
}


def joints_of(units: Mapping[str, str]) -> dict[str, JointUnit]:
    """Return the joints among axes, given their units by name; an axis in any other unit is not a joint."""
    return {name: JOINT_UNITS[unit] for name, unit in units.items() if unit in JOINT_UNITS}
