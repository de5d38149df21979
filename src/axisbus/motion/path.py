"""Straight lines for groups: one trapezoid over the path, shared by all axes as shares of the way."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from axisbus.motion.parameters import AxisParameters
from axisbus.motion.trajectory import Trapezoid


@dataclass(frozen=True, slots=True)
class LineAxis:
    """One axis's share of a straight line: ``start`` and ``end`` in its unit, on the group's common trapezoid from 0 to 1."""

    start: float
    end: float
    way: Trapezoid

    @property
    def duration(self) -> float:
        """Seconds from rest to rest."""
        return self.way.duration

    @property
    def span(self) -> tuple[float, float]:
        """The lowest and the highest position."""
        return min(self.start, self.end), max(self.start, self.end)

    @property
    def top_speed(self) -> float:
        """The highest speed in the axis's unit per s."""
        return abs(self.end - self.start) * self.way.top_speed

    @property
    def top_acceleration(self) -> float:
        """The highest acceleration in the axis's unit per s²."""
        return abs(self.end - self.start) * self.way.top_acceleration

    def position(self, t: float) -> float:
        """Return the position at ``t`` seconds."""
        return self.start + (self.end - self.start) * self.way.position(t)


def plan_line(
    starts: Mapping[str, float],
    ends: Mapping[str, float],
    axes: Mapping[str, AxisParameters],
    velocity: float,
    acceleration: float,
) -> tuple[dict[str, LineAxis], Trapezoid]:
    """Plan a straight line from rest to rest; return each axis's share, and the way from 0 to 1 that they share.

    ``velocity`` and ``acceleration`` are those of the path (the Euclidean length over all axes, in the axes' units per s and s²).
    They are lowered where an axis's own limits ask for it: the slowest axis sets the time, and all stay on the line.
    """
    length = math.sqrt(sum((ends[name] - starts[name]) ** 2 for name in ends))
    if length == 0:
        still = Trapezoid(0.0, 0.0, 1.0, 1.0)
        return {name: LineAxis(starts[name], ends[name], still) for name in ends}, still
    speed, ramp = velocity / length, acceleration / length  # of the way from 0 to 1
    for name, parameters in axes.items():
        distance = abs(ends[name] - starts[name])
        limits = parameters.limits
        if distance and limits.velocity is not None:
            speed = min(speed, limits.velocity / distance)
        if distance and limits.acceleration is not None:
            ramp = min(ramp, limits.acceleration / distance)
    way = Trapezoid(0.0, 1.0, speed, ramp)
    return {name: LineAxis(starts[name], ends[name], way) for name in ends}, way
