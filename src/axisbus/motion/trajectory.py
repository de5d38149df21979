"""Trajectories as pure functions of time: a trapezoid from rest to rest, and sampled points."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from math import isfinite
from typing import Protocol

from axisbus.errors import ArgumentError, one_line
from axisbus.interrupt_guard import is_own
from axisbus.motion.moves.profile import duration
from axisbus.motion.numbers import number, short_repr


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
            raise ArgumentError(
                "a trapezoid needs finite numbers", observed=", ".join(map(short_repr, values))
            )
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
            distance = 0.5 * self.acceleration * time * time
        else:
            distance = 0.5 * self.acceleration * ramp * ramp + self.velocity * (time - ramp)
        if not first:
            distance = abs(end - start) - distance
        return start + distance if end > start else start - distance


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


# -- A trajectory as the scan calls it: user code whose errors end its command and nothing else ----------------------------

_DURATION = "correct its duration, which must always return the same number"
_POSITION = "correct its position(t), which must return a number for every t from 0 to its duration; the axis was stopped"


class CheckedTrajectory:
    """Holds a trajectory, and its ``duration``, read once; all other properties are read from the trajectory itself."""

    __slots__ = ("_name", "_trajectory", "duration")

    def __init__(self, trajectory: Trajectory, name: str) -> None:
        """``name``: the axis.

        Raises:
            ArgumentError: it has no valid duration.
        """
        self._trajectory = trajectory
        self._name = name
        try:
            found: object = trajectory.duration
        except BaseException as error:
            if not is_own(error):
                raise
            raise self._broken(error, "duration", _DURATION) from error
        self.duration = self._number(found, "duration", _DURATION)

    def position(self, t: float) -> float:
        """Return the position at ``t`` seconds.

        Raises:
            ArgumentError: the trajectory returns no number.
        """
        try:
            value = self._trajectory.position(t)
        except BaseException as error:
            if not is_own(error):
                raise
            raise self._broken(error, f"position at {t:.3f} s", _POSITION) from error
        if type(value) is float and isfinite(value):  # in nearly every cycle
            return value
        return self._number(value, f"position at {t:.3f} s", _POSITION)

    def _broken(self, error: BaseException, what: str, remedy: str) -> ArgumentError:
        """Return the error that ends the command when the trajectory's own code has raised; ``what``: the requested value."""
        return ArgumentError(self._message(what), observed=one_line(error), remedy=remedy)

    def _number(self, value: object, what: str, remedy: str) -> float:
        """Return a value of the trajectory's own code as a number; any other value ends the command, and the error shows it."""
        found = number(value)
        if found is None:
            raise ArgumentError(
                self._message(what), observed=f"it returned {short_repr(value)}", remedy=remedy
            )
        return found

    def _message(self, what: str) -> str:
        return f"{self._name}: the trajectory returned no {what}"
