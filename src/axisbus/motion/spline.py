"""A cubic spline through points in time: velocity and acceleration are continuous, and it begins and ends at rest."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple, cast

from axisbus.errors import ArgumentError
from axisbus.motion.numbers import number, short_repr
from axisbus.motion.trajectory import Trajectory

_SWEEPS = 60  # then the remaining error is below the resolution of a float


class SplineSegment(NamedTuple):
    """The curve from one point to the next: position + s (speed + s (bend + s twist)), for s from 0 to ``length`` seconds."""

    position: float
    speed: float
    bend: float
    twist: float
    length: float

    def at(self, s: float) -> float:
        return self.position + s * (self.speed + s * (self.bend + s * self.twist))

    def speed_at(self, s: float) -> float:
        return self.speed + s * (2.0 * self.bend + s * 3.0 * self.twist)

    def bend_at(self, s: float) -> float:
        """Return the acceleration at ``s``."""
        return 2.0 * self.bend + 6.0 * self.twist * s


@dataclass(frozen=True, slots=True)
class SplineTrajectory:
    """A cubic spline through ``positions`` at ``times`` (s, from 0 on, rising), at rest at both ends.

    Between its points it may overshoot them a little: ``span``, ``top_speed`` and ``top_acceleration`` give its extreme values, and
    ``Axis.follow`` checks them against the limits before anything moves.
    """

    times: Sequence[float]
    positions: Sequence[float]
    _parts: tuple[SplineSegment, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Compute the curve.

        Raises:
            ArgumentError: fewer than two points, a value that is not a finite number, or times that do not begin at 0 and rise.
        """
        values = [number(value) for value in (*self.times, *self.positions)]
        known = [value for value in values if value is not None]
        if len(known) != len(values) or len(self.times) != len(self.positions):
            raise ArgumentError("the points of a trajectory need finite times and positions, as many of both")
        times, positions = known[: len(self.times)], known[len(self.times) :]
        if len(times) < 2 or times[0] != 0.0 or any(a >= b for a, b in pairwise(times)):
            raise ArgumentError(
                "the points of a trajectory need times that begin at 0 and rise, and two points at least",
                observed=", ".join(f"{time:g}" for time in times[:8]),
            )
        for name, value in (("times", times), ("positions", positions)):
            object.__setattr__(self, name, tuple(value))
        object.__setattr__(self, "_parts", tuple(parts_of(times, positions)))

    @property
    def duration(self) -> float:
        """Seconds from the first to the last point."""
        return self.times[-1]

    @property
    def span(self) -> tuple[float, float]:
        """The lowest and the highest position."""
        return span_of(self._parts)

    @property
    def top_speed(self) -> float:
        """The highest speed in unit/s."""
        found = [0.0]
        for part in self._parts:
            middle = -part.bend / (3.0 * part.twist) if part.twist else 0.0
            found += [abs(part.speed_at(s)) for s in (0.0, middle) if 0.0 <= s <= part.length]
        return max(found)

    @property
    def top_acceleration(self) -> float:
        """The highest acceleration in unit/s²."""
        ends = ((2.0 * part.bend, 2.0 * part.bend + 6.0 * part.twist * part.length) for part in self._parts)
        return max(abs(bend) for pair in ends for bend in pair)

    def position(self, t: float) -> float:
        """Return the position at ``t`` seconds; beyond an end, the position at that end."""
        if t >= self.times[-1]:
            return self.positions[-1]
        number = max(bisect_right(self.times, t) - 1, 0)
        return self._parts[number].at(max(t, 0.0) - self.times[number])


@dataclass(frozen=True, slots=True)
class Computed:
    """A trajectory defined by a function of the user's program: ``call(t)`` for 0 to ``duration`` seconds."""

    call: Callable[[float], float]
    duration: float

    def position(self, t: float) -> float:
        """Return the position at ``t`` seconds."""
        return self.call(t)


Followed = Trajectory | Sequence[Sequence[float]] | Callable[[float], float]


def trajectory_of(given: Followed, duration: float | None, text: str) -> Trajectory:
    """Return ``given`` as a trajectory: itself, the spline through rows of time and position, or the values of a function.

    Raises:
        ArgumentError: it is none of these, or ``duration`` is missing or not permitted; ``text`` names the call.
    """
    is_one = hasattr(given, "position")
    if duration is not None and (is_one or not callable(given)):
        raise ArgumentError(
            f"{text}: a trajectory and points have their own duration",
            remedy="leave duration out: only a function needs it",
        )
    if is_one:
        return cast("Trajectory", given)
    if not callable(given):
        return _through(given, text)
    if duration is None:
        raise ArgumentError(
            f"{text}: a function needs a duration",
            remedy="follow(function, duration=seconds), function(t) returns a position for every t from 0 to that duration",
        )
    return Computed(given, duration)


def _through(given: object, text: str) -> SplineTrajectory:
    try:
        times, positions = zip(*((time, position) for time, position in cast("Any", given)), strict=True)
    except (TypeError, ValueError):
        raise ArgumentError(
            f"{text}: {short_repr(given)} is not a trajectory that can be followed",
            remedy="give rows of time (s, from 0 on) and position, a function with its duration, or an object with duration and "
            "position(t)",
        ) from None
    return SplineTrajectory(times, positions)


def parts_of(
    times: Sequence[float], positions: Sequence[float], *, periodic: bool = False
) -> Iterator[SplineSegment]:
    """Return the spline through points, with continuous speed and acceleration: at rest at both ends, or ``periodic``.

    A periodic spline continues after its end as after its beginning.
    """
    lengths = [b - a for a, b in pairwise(times)]
    slopes = [(b - a) / length for (a, b), length in zip(pairwise(positions), lengths, strict=True)]
    speeds = _round(lengths, slopes) if periodic else _speeds(lengths, slopes)
    for position, length, slope, (a, b) in zip(positions, lengths, slopes, pairwise(speeds), strict=False):
        bend, twist = (3.0 * slope - 2.0 * a - b) / length, (a + b - 2.0 * slope) / length**2
        yield SplineSegment(position, a, bend, twist, length)


def _speeds(lengths: Sequence[float], slopes: Sequence[float]) -> list[float]:
    """Solve for the speed at each point at which the acceleration is continuous: a tridiagonal system."""
    above, right = [0.0], [0.0]
    for (h, g), (a, b) in zip(pairwise(lengths), pairwise(slopes), strict=True):
        pivot = 2.0 * (h + g) - g * above[-1]
        right.append((3.0 * (g * a + h * b) - g * right[-1]) / pivot)
        above.append(h / pivot)
    speeds = [0.0]
    for factor, value in zip(reversed(above[1:]), reversed(right[1:]), strict=True):
        speeds.append(value - factor * speeds[-1])
    return [0.0, *reversed(speeds)]


def _round(lengths: Sequence[float], slopes: Sequence[float]) -> list[float]:
    """Solve the same for a closed curve, whose last point is the first; each sweep at least halves the error."""
    count = len(lengths)
    speeds = list(slopes)
    for _ in range(_SWEEPS):
        for n in range(count):
            h, g = lengths[n - 1], lengths[n]  # before and after the point
            known = 3.0 * (g * slopes[n - 1] + h * slopes[n])
            speeds[n] = (known - g * speeds[n - 1] - h * speeds[(n + 1) % count]) / (2.0 * (h + g))
    return [*speeds, speeds[0]]


def span_of(parts: Sequence[SplineSegment]) -> tuple[float, float]:
    """Return the lowest and the highest position of a curve."""
    found = [parts[-1].at(parts[-1].length)]
    for part in parts:
        found += [part.at(s) for s in (0.0, *_turns(part)) if 0.0 <= s <= part.length]
    return min(found), max(found)


def _turns(part: SplineSegment) -> tuple[float, ...]:
    """Return the positions within a part, in s, at which the speed is 0."""
    a, b, c = 3.0 * part.twist, 2.0 * part.bend, part.speed
    if not a:
        return (-c / b,) if b else ()
    inner = b * b - 4.0 * a * c
    if inner < 0.0:
        return ()
    # Not by the usual formula: with a small ``a``, the difference of ``b`` and the root would be rounding errors.
    far = -0.5 * (b + math.copysign(math.sqrt(inner), b))
    return (far / a, c / far) if far else (0.0,)
