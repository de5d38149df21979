"""The curve through points that come one by one, and whether the axes may follow it.

Theory of operation
-------------------
At each point the speed and the acceleration are those of the parabola through it and its neighbours, and between two points goes
the polynomial of degree five that has both: place, speed and acceleration never jump (C2), and straight lines and constant
accelerations stay what they are. So the curve up to a point is known when the next point is.

With each point two spans are looked at: the one that it makes known, and the one up to itself as it would be if no more came. So
what has been taken can always be ended. Of an axis's acceleration the points may use four fifths; the rest is there for braking
along them, and for going on again.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Generic, NamedTuple, TypeVar

from axisbus.errors import LimitError
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.path_limit_check import PathLimitCheck, pace_of
from axisbus.motion.point_stream.commands import Span
from axisbus.motion.point_stream.quintic import Controls, Motion, coefficients, controls, derived, reach
from axisbus.motion.position_limits import widened
from axisbus.motion.trajectory import SampledTrajectory

SHARE = 0.8  # of an axis's acceleration, which the points may use
LONGEST = 10.0  # seconds that braking along the points may take
_STEEPEST = 1e4  # per s: what does not move needs no ramp
_COMPUTED = 1.0 + 1e-6  # what numbers that were computed may be off
STILL = SampledTrajectory((0.0, 0.0), 1.0)  # what tells nothing of its acceleration


T = TypeVar("T")


class StreamPoint(NamedTuple):
    """Where the axes are to be (in their order, in their units), and when (seconds of the stream)."""

    t: float
    place: tuple[float, ...]


class Between(NamedTuple):
    """From one point to the next, each with the motion of every axis there."""

    begin: StreamPoint
    end: StreamPoint
    from_: tuple[Motion, ...]
    to: tuple[Motion, ...]

    @property
    def seconds(self) -> float:
        """How far apart they are."""
        return self.end.t - self.begin.t


class Allowed(NamedTuple):
    """What one axis may do, in its units; ``key`` says where its acceleration comes from. None: nothing limits it."""

    unit: str
    positions: tuple[float, float] | None
    velocity: float | None
    acceleration: float | None
    key: str
    braking: float


def allowed_of(parameters: AxisParameters, start: float) -> Allowed:
    """Return what an axis may do that begins at ``start``; its ``path_deceleration`` must be known."""
    pace: PathLimitCheck = pace_of(parameters, STILL)
    positions, braking = parameters.limits.position, parameters.path_deceleration
    assert braking is not None
    if positions is not None:
        positions = widened(positions, start, abs(parameters.units.position.to_units(1)))
    return Allowed(pace.unit, positions, pace.velocity, pace.acceleration, pace.key, braking)


class PointAccepted(Generic[T]):
    """Makes something of the curve between points; holds the last three, and what moves how at the last but one."""

    def __init__(self) -> None:
        self._points: tuple[StreamPoint, ...] = ()
        self._moving: tuple[Motion, ...] = ()  # at the last point but one
        self.count = 0

    @property
    def last(self) -> StreamPoint | None:
        """The last point that was taken."""
        return self._points[-1] if self._points else None

    def take(self, point: StreamPoint) -> T | None:
        """Take a point, later than the last; return what is made of the span that it makes known, None where it makes none.

        Raises:
            LimitError: an axis would be led beyond what it may; then nothing has changed.
        """
        points = (*self._points[-2:], point)
        made, moving = None, self._moving
        if len(points) == 3:
            begin = moving or _motions(points, 0)
            moving = _motions(points, 1)
            made = self._made(Between(points[0], points[1], begin, moving))
            self._made(Between(points[1], point, moving, _motions(points, 2)))
        elif len(points) == 2:
            self._made(_straight(*points))
        self._points, self._moving = points, moving
        self.count += 1
        return made

    def end(self) -> T | None:
        """Return the same for the span up to the last point, after which none comes; None where there are not two points."""
        points = self._points
        if len(points) < 2:
            return None
        if len(points) == 2:
            return self._made(_straight(*points))
        return self._made(Between(points[1], points[2], self._moving, _motions(points, 2)))

    def _made(self, between: Between) -> T:
        """Return what is made of the curve between two points; raise LimitError where an axis may not follow it."""
        raise NotImplementedError


class CurveFit(PointAccepted[Span]):
    """Makes spans of points."""

    def __init__(self, axes: Mapping[str, Allowed], text: str) -> None:
        """``text``: what messages begin with."""
        super().__init__()
        self._axes = axes
        self._text = text

    def _made(self, between: Between) -> Span:
        return self.checked(between)

    def checked(self, span: Between) -> Span:
        """Return a span as it crosses; raise LimitError where an axis may not follow it."""
        ramp = _STEEPEST
        for number, (name, may) in enumerate(self._axes.items()):
            line = controls(span.from_[number], span.to[number], span.seconds)
            speeds = derived(line, span.seconds)
            rates = derived(speeds, span.seconds)
            self._require(name, span, line, "position", may.unit, may.positions, "position_limits")
            top = self._require(
                name, span, speeds, "velocity", f"{may.unit}/s", _both(may.velocity), "max_velocity"
            )
            share = None if may.acceleration is None else SHARE * may.acceleration
            key = f"{SHARE:.0%} of {may.key}"
            hard = self._require(name, span, rates, "acceleration", f"{may.unit}/s²", _both(share), key)
            left = may.braking if may.acceleration is None else min(may.braking, may.acceleration - hard)
            if top > left / _STEEPEST:
                ramp = min(ramp, left / top)
        if ramp * LONGEST < 1.0:
            raise self._endless(span, 1.0 / ramp)
        curves = (
            coefficients(begin, end, span.seconds) for begin, end in zip(span.from_, span.to, strict=True)
        )
        return Span(span.seconds, ramp, tuple(curves))

    def _require(
        self,
        name: str,
        span: Between,
        values: Controls,
        what: str,
        unit: str,
        limits: tuple[float, float] | None,
        key: str,
    ) -> float:
        """Return the largest magnitude of what an axis does within a span; raise LimitError where that is beyond a limit."""
        low, high = min(values), max(values)
        if limits is not None and not limits[0] * _COMPUTED <= low <= high <= limits[1] * _COMPUTED:
            low, high = reach(values)
            if not (_beyond(low, limits) or _beyond(high, limits)):
                low, high = max(low, limits[0]), min(high, limits[1])
            else:
                raise self._too_much(
                    name, span, what, unit, low if _beyond(low, limits) else high, limits, key
                )
        return max(-low, high)

    def _too_much(
        self,
        name: str,
        span: Between,
        what: str,
        unit: str,
        seen: float,
        limits: tuple[float, float],
        key: str,
    ) -> LimitError:
        within = f"{limits[1]:g}" if limits[0] == -limits[1] else f"{limits[0]:g} to {limits[1]:g}"
        return LimitError(
            f"{self._text}: point {self.count + 1} leads {name} beyond its {what}",
            observed=f"{what} {seen:.6g} {unit} between {span.begin.t:.3f} s and {span.end.t:.3f} s of the stream; "
            f"allowed are {within} {unit} ({key})",
            remedy=f"give points that are nearer to each other or further apart in time, or change the limit in [axes.{name}] of "
            "cell.toml; nothing of this point was taken",
        )

    def _endless(self, span: Between, seconds: float) -> LimitError:
        return LimitError(
            f"{self._text}: point {self.count + 1} could not be braked from along its way in time",
            observed=f"it would take {seconds:.3g} s from {span.begin.t:.3f} s of the stream; {LONGEST:g} s are allowed",
            remedy="give points that are slower, or raise deceleration in [axes.NAME.defaults] or max_acceleration in [axes.NAME] "
            "of cell.toml; nothing of this point was taken",
        )


def _both(limit: float | None) -> tuple[float, float] | None:
    return None if limit is None else (-limit, limit)


def _beyond(value: float, limits: tuple[float, float]) -> bool:
    low, high = limits
    spare = (_COMPUTED - 1.0) * max(abs(low), abs(high))
    return not low - spare <= value <= high + spare


def _motions(points: Sequence[StreamPoint], number: int) -> tuple[Motion, ...]:
    """Return how each axis moves at one of three points, by the parabola through them."""
    (a, first), (b, second), (c, third) = points
    t = points[number].t
    found = []
    for x, y, z, here in zip(first, second, third, points[number].place, strict=True):
        before, after = (y - x) / (b - a), (z - y) / (c - b)
        rate = 2.0 * (after - before) / (c - a)
        found.append(Motion(here, before + rate * (t - 0.5 * (a + b)), rate))
    return tuple(found)


def _straight(begin: StreamPoint, end: StreamPoint) -> Between:
    seconds = end.t - begin.t
    speeds = [(b - a) / seconds for a, b in zip(begin.place, end.place, strict=True)]
    from_, to = (
        tuple(Motion(place, speed, 0.0) for place, speed in zip(point.place, speeds, strict=True))
        for point in (begin, end)
    )
    return Between(begin, end, from_, to)
