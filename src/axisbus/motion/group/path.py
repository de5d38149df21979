"""Straight lines for groups: one trapezoid over the path, shared by all axes as shares of the way."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from axisbus.errors import LimitError
from axisbus.motion.moves.profile import duration
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.trajectory import Trapezoid

_LONGEST = 366 * 86400.0  # seconds of one line: what would take more than a year was not meant
# Of the way from 0 to 1: far beyond one scan period, and numbers of which the squares are numbers too.
_FASTEST = 1e6  # per s
_STEEPEST = 1e12  # per s²


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


def nearest_on_line(
    start: Mapping[str, float], end: Mapping[str, float], here: Mapping[str, float]
) -> dict[str, float]:
    """Return the place of the line from ``start`` to ``end`` that is nearest to ``here``; in units, by axis."""
    way = {axis: end[axis] - start[axis] for axis in end}
    length = sum(part * part for part in way.values())
    done = sum((here[axis] - start[axis]) * way[axis] for axis in end) / length if length else 0.0
    share = min(1.0, max(0.0, done))
    return {axis: start[axis] + share * way[axis] for axis in end}


def plan_line(
    starts: Mapping[str, float],
    ends: Mapping[str, float],
    axes: Mapping[str, AxisParameters],
    velocity: float,
    acceleration: float,
    name: str = "move_linear",
) -> tuple[dict[str, LineAxis], Trapezoid]:
    """Plan a straight line from rest to rest; return each axis's share, and the way from 0 to 1 that they share.

    ``velocity`` and ``acceleration`` are those of the path (the Euclidean length over all axes, in the axes' units per s and s²).
    They are lowered where an axis's own limits ask for it: the slowest axis sets the time, and all stay on the line. ``name`` says
    what was asked for.

    Raises:
        LimitError: it would take more than a year.
    """
    length = math.hypot(*(ends[axis] - starts[axis] for axis in ends))
    if length == 0:
        still = Trapezoid(0.0, 0.0, 1.0, 1.0)
        return {axis: LineAxis(starts[axis], ends[axis], still) for axis in ends}, still
    speed, ramp = min(velocity / length, _FASTEST), min(acceleration / length, _STEEPEST)
    for axis, parameters in axes.items():
        distance = abs(ends[axis] - starts[axis])
        limits = parameters.limits
        if distance and limits.velocity is not None:
            speed = min(speed, limits.velocity / distance)
        if distance and limits.acceleration is not None:
            ramp = min(ramp, limits.acceleration / distance)
    _require_end(name, length, speed, ramp)
    way = Trapezoid(0.0, 1.0, speed, ramp)
    return {axis: LineAxis(starts[axis], ends[axis], way) for axis in ends}, way


def _require_end(name: str, length: float, speed: float, ramp: float) -> None:
    """A number that is a thousand powers of ten too small leads nowhere, and holds the axes for ever."""
    seconds = duration(1.0, speed, ramp) if speed and ramp else math.inf
    if seconds > _LONGEST:
        raise LimitError(
            f"{name}: the straight line would take more than a year",
            observed=f"{length:g} units of path at {speed * length:g} units/s with {ramp * length:g} units/s²: {seconds:g} s",
            remedy="give a velocity and an acceleration that belong to this way, and look where these values were computed",
        )
