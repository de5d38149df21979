"""Trajectories as pure functions of time: a trapezoid from rest to rest, and sampled points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Protocol

from axisbus.errors import ArgumentError
from axisbus.motion.moves.profile import duration
from axisbus.motion.numbers import number, told


class Trajectory(Protocol):
    """A position over time, in the axis's unit; ``duration`` in seconds. It must begin and end at rest.

    ``position`` may be called for future times, and repeatedly: it must depend on ``t`` alone. A trajectory that also has ``span``
    and ``top_speed`` (``lookahead.LookaheadTrajectory``) is checked against the limits as a whole before it starts.
    """

    @property
    def duration(self) -> float:
        """Seconds from the first to the last position."""

    def position(self, t: float) -> float:
        """Return the position at ``t`` (0 … ``duration``)."""


def _finite(values: Iterable[object]) -> bool:
    return all(number(value) is not None for value in values)


@dataclass(frozen=True, slots=True)
class TrapezoidalTrajectory:
    """A straight move from ``start`` to ``end``: equal ramps, constant velocity between, rest at both ends.

    ``velocity`` (unit/s) and ``acceleration`` (unit/s²) are positive and not exceeded.
    """

    start: float
    end: float
    velocity: float
    acceleration: float
    _total: float = field(init=False, repr=False, compare=False)  # used in every cycle

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ArgumentError: a value is not finite, or velocity or acceleration is not positive.
        """
        values = (self.start, self.end, self.velocity, self.acceleration)
        if not _finite(values):
            raise ArgumentError("a trapezoid needs finite numbers", observed=", ".join(map(told, values)))
        if self.velocity <= 0 or self.acceleration <= 0:
            raise ArgumentError("a trapezoid needs velocity and acceleration above 0", observed=repr(self))
        total = duration(self.end - self.start, self.velocity, self.acceleration)
        object.__setattr__(self, "_total", total)

    @property
    def duration(self) -> float:
        """Seconds from rest to rest."""
        return self._total

    @property
    def span(self) -> tuple[float, float]:
        """The lowest and the highest position."""
        return min(self.start, self.end), max(self.start, self.end)

    @property
    def top_speed(self) -> float:
        """The highest speed: ``velocity`` if the distance is long enough to reach it."""
        return min(self.velocity, math.sqrt(abs(self.end - self.start) * self.acceleration))

    @property
    def top_acceleration(self) -> float:
        """The highest acceleration in unit/s²."""
        return self.acceleration if self.end != self.start else 0.0

    def position(self, t: float) -> float:
        """Return the position at ``t`` seconds; beyond an end, the position at that end."""
        start, end, total = self.start, self.end, self._total
        if t <= 0 or start == end:
            return start
        if t >= total:
            return end
        first = t <= total / 2
        time, ramp = (
            t if first else total - t,
            self.velocity / self.acceleration,
        )  # ``time`` to or from the nearer end
        if time <= ramp:
            way = 0.5 * self.acceleration * time * time
        else:
            way = 0.5 * self.acceleration * ramp * ramp + self.velocity * (time - ramp)
        if not first:
            way = abs(end - start) - way
        return start + way if end > start else start - way


@dataclass(frozen=True, slots=True)
class SampledTrajectory:
    """Positions at equal intervals of ``step`` seconds, linearly interpolated; the first is the axis's position at the start."""

    positions: Sequence[float]
    step: float

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            ArgumentError: fewer than two points, a value that is not finite, or an interval that is not positive.
        """
        if len(self.positions) < 2 or not _finite((self.step,)) or not self.step > 0:
            raise ArgumentError("a sampled trajectory needs two points and a positive interval")
        if not _finite(self.positions):
            raise ArgumentError("a sampled trajectory needs finite positions")

    @property
    def duration(self) -> float:
        """Seconds from the first to the last point."""
        return (len(self.positions) - 1) * self.step

    @property
    def span(self) -> tuple[float, float]:
        """The lowest and the highest position."""
        return min(self.positions), max(self.positions)

    @property
    def top_speed(self) -> float:
        """The highest speed between two points."""
        return max(abs(b - a) for a, b in pairwise(self.positions)) / self.step

    def position(self, t: float) -> float:
        """Return the position at ``t`` seconds; beyond an end, the position at that end."""
        if t >= self.duration:  # exactly the last point, independent of rounding
            return self.positions[-1]
        where = max(t / self.step, 0.0)
        index = min(int(where), len(self.positions) - 2)
        share = where - index
        return self.positions[index] * (1.0 - share) + self.positions[index + 1] * share
