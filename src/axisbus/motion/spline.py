"""A smooth curve through points in time: neither velocity nor acceleration jumps between them, and it begins and ends at rest."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, NamedTuple, cast

from axisbus.errors import ArgumentError
from axisbus.motion.numbers import number, told
from axisbus.motion.trajectory import Trajectory

_SWEEPS = 60  # then nothing is left that a number could hold


class SplineSegment(NamedTuple):
    """The curve from one point to the next: place + s (speed + s (bend + s twist)), for s from 0 to ``length`` seconds."""

    place: float
    speed: float
    bend: float
    twist: float
    length: float

    def at(self, s: float) -> float:
        return self.place + s * (self.speed + s * (self.bend + s * self.twist))

    def speed_at(self, s: float) -> float:
        return self.speed + s * (2.0 * self.bend + s * 3.0 * self.twist)

    def bend_at(self, s: float) -> float:
        """How the speed changes at ``s``."""
        return 2.0 * self.bend + 6.0 * self.twist * s


@dataclass(frozen=True, slots=True)
class SplineTrajectory:
    """A cubic spline through ``positions`` at ``times`` (s, from 0 on, rising), at rest at both ends.

    Between its points it may go a little beyond them: ``span``, ``top_speed`` and ``top_acceleration`` tell how far, how fast and
    how hard, and ``Axis.follow`` holds them against the limits before anything moves.
    """

    times: Sequence[float]
    positions: Sequence[float]
    _parts: tuple[SplineSegment, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Compute the curve.

        Raises:
            ArgumentError: fewer than two points, what is no finite number, or times that do not begin at 0 and rise.
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
        """Return the position at ``t`` seconds; before and after, the ends."""
        if t >= self.times[-1]:
            return self.positions[-1]
        place = max(bisect_right(self.times, t) - 1, 0)
        return self._parts[place].at(max(t, 0.0) - self.times[place])


@dataclass(frozen=True, slots=True)
class Computed:
    """A trajectory that a function of the program gives: ``call(t)`` for 0 to ``duration`` seconds."""

    call: Callable[[float], float]
    duration: float

    def position(self, t: float) -> float:
        """Return the position at ``t`` seconds."""
        return self.call(t)


Followed = Trajectory | Sequence[Sequence[float]] | Callable[[float], float]


def trajectory_of(given: Followed, duration: float | None, text: str) -> Trajectory:
    """Return what was given as a trajectory: itself, the curve through rows of time and position, or a function's.

    Raises:
        ArgumentError: it is none, or ``duration`` is missing or too much; ``text`` names the call.
    """
    is_one = hasattr(given, "position")
    if duration is not None and (is_one or not callable(given)):
        raise ArgumentError(
            f"{text}: a trajectory and points have a duration of their own",
            remedy="leave duration out: it is that of a function",
        )
    if is_one:
        return cast("Trajectory", given)
    if not callable(given):
        return _through(given, text)
    if duration is None:
        raise ArgumentError(
            f"{text}: a function needs a duration",
            remedy="follow(function, duration=seconds), where function(t) gives a position for every t from 0 to that",
        )
    return Computed(given, duration)


def _through(given: object, text: str) -> SplineTrajectory:
    try:
        times, positions = zip(*((time, place) for time, place in cast("Any", given)), strict=True)
    except (TypeError, ValueError):
        raise ArgumentError(
            f"{text}: {told(given)} is nothing that can be followed",
            remedy="give rows of time (s, from 0 on) and position, a function with its duration, or an object with duration and "
            "position(t)",
        ) from None
    return SplineTrajectory(times, positions)


def parts_of(
    times: Sequence[float], positions: Sequence[float], *, periodic: bool = False
) -> Iterator[SplineSegment]:
    """Return the curve through points, between which neither speed nor acceleration jumps: at rest at both ends, or ``periodic``.

    Then it goes on after its end as it does after its beginning.
    """
    lengths = [b - a for a, b in pairwise(times)]
    slopes = [(b - a) / length for (a, b), length in zip(pairwise(positions), lengths, strict=True)]
    speeds = _round(lengths, slopes) if periodic else _speeds(lengths, slopes)
    for place, length, slope, (a, b) in zip(positions, lengths, slopes, pairwise(speeds), strict=False):
        bend, twist = (3.0 * slope - 2.0 * a - b) / length, (a + b - 2.0 * slope) / length**2
        yield SplineSegment(place, a, bend, twist, length)


def _speeds(lengths: Sequence[float], slopes: Sequence[float]) -> list[float]:
    """Solve for the speed at each point with which no acceleration jumps: a system of three diagonals."""
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
    """Solve for the same where the last point is the first again: each sweep leaves at most half of what is off."""
    count = len(lengths)
    speeds = list(slopes)
    for _ in range(_SWEEPS):
        for n in range(count):
            h, g = lengths[n - 1], lengths[n]  # before the point, and after it
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
    """Where the speed of a part is 0."""
    a, b, c = 3.0 * part.twist, 2.0 * part.bend, part.speed
    if not a:
        return (-c / b,) if b else ()
    inner = b * b - 4.0 * a * c
    if inner < 0.0:
        return ()
    root = math.sqrt(inner)
    return (-b - root) / (2.0 * a), (-b + root) / (2.0 * a)
