"""The curve through points that come one by one, and the check of the axes' limits along it.

Theory of operation
-------------------
At each point, speed and acceleration are those of the parabola through the point and its neighbours. Between two points runs the
polynomial of degree five with the values of both. So position, speed and acceleration never jump (C2), and straight lines and
constant accelerations are reproduced exactly. The curve up to a point is known when the next point is known.

Each new point leads to two checks: of the segment that it completes, and of the segment up to itself as if no more points came. An
accepted stream can therefore always be ended. The points may use four fifths of an axis's acceleration; the rest is reserved for
braking along them and for resuming.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import pairwise
from typing import Generic, NamedTuple, TypeVar

from axisbus.errors import LimitError
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.path_limit_check import PathLimitCheck, limit_check_of
from axisbus.motion.point_stream.commands import StreamSegment
from axisbus.motion.position_limits import widened
from axisbus.motion.trajectory import SampledTrajectory

SHARE = 0.8  # of an axis's acceleration: the part that the points may use
LONGEST = 10.0  # seconds that braking along the points may take
_STEEPEST = 1e4  # per s: a segment without motion needs no ramp
_COMPUTED = 1.0 + 1e-6  # tolerance for rounding errors
STILL = SampledTrajectory((0.0, 0.0), 1.0)  # a placeholder, which makes no statement about its acceleration


T = TypeVar("T")


# ----------------------------------------------------------------------------------------------------------------------
# Motion of one axis between two points: the polynomial of degree five through position, speed and acceleration of both.


_HALVINGS = 5  # of a curve: the range found is then accurate to a thousandth of the control points' range


Coefficients = tuple[float, float, float, float, float, float]  # of the powers of the time, starting at 0
Controls = tuple[float, ...]


class Motion(NamedTuple):
    """Motion of one axis at a point: position (unit), speed (unit/s) and acceleration (unit/s²)."""

    position: float
    speed: float
    rate: float


def coefficients(begin: Motion, end: Motion, seconds: float) -> Coefficients:
    """Return the polynomial from ``begin`` to ``end``, ``seconds`` (above 0) apart."""
    distance = end.position - begin.position - (begin.speed + 0.5 * begin.rate * seconds) * seconds
    faster = (end.speed - begin.speed - begin.rate * seconds) * seconds
    harder = 0.5 * (end.rate - begin.rate) * seconds * seconds
    cube = seconds**3
    return (
        begin.position,
        begin.speed,
        0.5 * begin.rate,
        (10.0 * distance - 4.0 * faster + harder) / cube,
        (-15.0 * distance + 7.0 * faster - 2.0 * harder) / (cube * seconds),
        (6.0 * distance - 3.0 * faster + harder) / (cube * seconds * seconds),
    )


def at(curve: Sequence[float], t: float) -> float:
    """Return the position ``t`` seconds after the beginning."""
    a, b, c, d, e, f = curve
    return a + t * (b + t * (c + t * (d + t * (e + t * f))))


def controls(begin: Motion, end: Motion, seconds: float) -> Controls:
    """Return the control points (Bernstein) of the same polynomial; its values lie within their range."""
    a, b = seconds / 5.0, seconds * seconds / 20.0
    return (
        begin.position,
        begin.position + a * begin.speed,
        begin.position + 2.0 * a * begin.speed + b * begin.rate,
        end.position - 2.0 * a * end.speed + b * end.rate,
        end.position - a * end.speed,
        end.position,
    )


def derived(points: Controls, seconds: float) -> Controls:
    """Return the control points of the derivative, per s."""
    times = (len(points) - 1) / seconds
    return tuple(times * (b - a) for a, b in pairwise(points))


def reach(points: Controls, halvings: int = _HALVINGS) -> tuple[float, float]:
    """Return bounds of the values, found by halving the curve: never too narrow, and hardly too wide."""
    if not halvings:
        return min(points), max(points)
    first, second = _halves(points)
    low, high = reach(first, halvings - 1)
    lower, higher = reach(second, halvings - 1)
    return min(low, lower), max(high, higher)


def _halves(points: Controls) -> tuple[Controls, Controls]:
    first, second = [points[0]], [points[-1]]
    while len(points) > 1:
        points = tuple(0.5 * (a + b) for a, b in pairwise(points))
        first.append(points[0])
        second.append(points[-1])
    return tuple(first), tuple(second[::-1])


# -- curve fit ---------------------------------------------------------------------------------------------------------


class StreamPoint(NamedTuple):
    """The positions of the axes (in their order, in their units) at a time (seconds of the stream)."""

    t: float
    positions: tuple[float, ...]


class SegmentEnds(NamedTuple):
    """From one point to the next, with the motion of every axis at both."""

    begin: StreamPoint
    end: StreamPoint
    from_: tuple[Motion, ...]
    to: tuple[Motion, ...]

    @property
    def seconds(self) -> float:
        """Time between the points in seconds."""
        return self.end.t - self.begin.t


class StreamLimits(NamedTuple):
    """The limits of one axis in its units; ``key``: the setting that its acceleration comes from. None: not limited."""

    unit: str
    positions: tuple[float, float] | None
    velocity: float | None
    acceleration: float | None
    key: str
    braking: float


def stream_limits_of(parameters: AxisParameters, start: float) -> StreamLimits:
    """Return the limits of an axis that begins at ``start``; its ``path_deceleration`` must be known."""
    limit_check: PathLimitCheck = limit_check_of(parameters, STILL)
    positions, braking = parameters.limits.position, parameters.path_deceleration
    assert braking is not None
    if positions is not None:
        positions = widened(positions, start, abs(parameters.units.position.to_units(1)))
    return StreamLimits(
        limit_check.unit, positions, limit_check.velocity, limit_check.acceleration, limit_check.key, braking
    )


class IncrementalFit(Generic[T]):
    """Processes the curve between points; stores the last three points, and the motion of the axes at the last but one."""

    def __init__(self) -> None:
        self._points: tuple[StreamPoint, ...] = ()
        self._moving: tuple[Motion, ...] = ()  # at the last point but one
        self.count = 0

    @property
    def last(self) -> StreamPoint | None:
        """The last accepted point."""
        return self._points[-1] if self._points else None

    def take(self, point: StreamPoint) -> T | None:
        """Accept a point later than the last one; return the result for the segment that it completes, None if it completes none.

        Raises:
            LimitError: an axis would exceed its limits; nothing has changed then.
        """
        points = (*self._points[-2:], point)
        fitted, moving = None, self._moving
        if len(points) == 3:
            begin = moving or _motions(points, 0)
            moving = _motions(points, 1)
            fitted = self._fitted(SegmentEnds(points[0], points[1], begin, moving))
            self._fitted(SegmentEnds(points[1], point, moving, _motions(points, 2)))
        elif len(points) == 2:
            self._fitted(_straight(*points))
        self._points, self._moving = points, moving
        self.count += 1
        return fitted

    def end(self) -> T | None:
        """Return the result for the segment up to the last point, as the end of the stream; None with fewer than two points."""
        points = self._points
        if len(points) < 2:
            return None
        if len(points) == 2:
            return self._fitted(_straight(*points))
        return self._fitted(SegmentEnds(points[1], points[2], self._moving, _motions(points, 2)))

    def _fitted(self, segment: SegmentEnds) -> T:
        """Return the result for the curve between two points; raise LimitError if an axis would exceed its limits."""
        raise NotImplementedError


class CurveFit(IncrementalFit[StreamSegment]):
    """Makes segments from points."""

    def __init__(self, axes: Mapping[str, StreamLimits], text: str) -> None:
        """``text``: beginning of messages."""
        super().__init__()
        self._axes = axes
        self._text = text

    def _fitted(self, segment: SegmentEnds) -> StreamSegment:
        return self.checked(segment)

    def checked(self, segment: SegmentEnds) -> StreamSegment:
        """Return a segment as it is sent to the core; raise LimitError if an axis would exceed its limits on it."""
        ramp = _STEEPEST
        for number, (name, allowed) in enumerate(self._axes.items()):
            line = controls(segment.from_[number], segment.to[number], segment.seconds)
            speeds = derived(line, segment.seconds)
            rates = derived(speeds, segment.seconds)
            self._require(name, segment, line, "position", allowed.unit, allowed.positions, "position_limits")
            top = self._require(
                name,
                segment,
                speeds,
                "velocity",
                f"{allowed.unit}/s",
                _symmetric(allowed.velocity),
                "max_velocity",
            )
            share = None if allowed.acceleration is None else SHARE * allowed.acceleration
            key = f"{SHARE:.0%} of {allowed.key}"
            hard = self._require(
                name, segment, rates, "acceleration", f"{allowed.unit}/s²", _symmetric(share), key
            )
            left = (
                allowed.braking
                if allowed.acceleration is None
                else min(allowed.braking, allowed.acceleration - hard)
            )
            if top > left / _STEEPEST:
                ramp = min(ramp, left / top)
        if ramp * LONGEST < 1.0:
            raise self._endless(segment, 1.0 / ramp)
        curves = (
            coefficients(begin, end, segment.seconds)
            for begin, end in zip(segment.from_, segment.to, strict=True)
        )
        return StreamSegment(segment.seconds, ramp, tuple(curves))

    def _require(
        self,
        name: str,
        segment: SegmentEnds,
        values: Controls,
        what: str,
        unit: str,
        limits: tuple[float, float] | None,
        key: str,
    ) -> float:
        """Return the largest magnitude of an axis's value within a segment; raise LimitError if it exceeds a limit."""
        low, high = min(values), max(values)
        if limits is not None and not limits[0] * _COMPUTED <= low <= high <= limits[1] * _COMPUTED:
            low, high = reach(values)
            if not (_beyond(low, limits) or _beyond(high, limits)):
                low, high = max(low, limits[0]), min(high, limits[1])
            else:
                raise self._too_much(
                    name, segment, what, unit, low if _beyond(low, limits) else high, limits, key
                )
        return max(-low, high)

    def _too_much(
        self,
        name: str,
        segment: SegmentEnds,
        what: str,
        unit: str,
        observed: float,
        limits: tuple[float, float],
        key: str,
    ) -> LimitError:
        within = (
            f"maximum is {limits[1]:g}"
            if limits[0] == -limits[1]
            else f"range is {limits[0]:g} to {limits[1]:g}"
        )
        return LimitError(
            f"{self._text}: point {self.count + 1} takes {name} beyond its {what}",
            observed=f"{what} {observed:.6g} {unit} between {segment.begin.t:.3f} s and {segment.end.t:.3f} s of the stream; "
            f"the allowed {within} {unit} ({key})",
            remedy="give points that are nearer to each other or further apart in time, or change the limit in "
            f"[axes.{name}] of cell.toml; this point was rejected",
        )

    def _endless(self, segment: SegmentEnds, seconds: float) -> LimitError:
        return LimitError(
            f"{self._text}: the axes could not brake in time along the path after point {self.count + 1}",
            observed=f"it would take {seconds:.3g} s from {segment.begin.t:.3f} s of the stream; {LONGEST:g} s are allowed",
            remedy="give points that are slower, or raise deceleration in [axes.NAME.defaults] or max_acceleration in "
            "[axes.NAME] of cell.toml; this point was rejected",
        )


def _symmetric(limit: float | None) -> tuple[float, float] | None:
    return None if limit is None else (-limit, limit)


def _beyond(value: float, limits: tuple[float, float]) -> bool:
    low, high = limits
    tolerance = (_COMPUTED - 1.0) * max(abs(low), abs(high))
    return not low - tolerance <= value <= high + tolerance


def _motions(points: Sequence[StreamPoint], number: int) -> tuple[Motion, ...]:
    """Return the motion of each axis at one of three points, by the parabola through them."""
    (a, first), (b, second), (c, third) = points
    t = points[number].t
    found = []
    for x, y, z, here in zip(first, second, third, points[number].positions, strict=True):
        before, after = (y - x) / (b - a), (z - y) / (c - b)
        rate = 2.0 * (after - before) / (c - a)
        found.append(Motion(here, before + rate * (t - 0.5 * (a + b)), rate))
    return tuple(found)


def _straight(begin: StreamPoint, end: StreamPoint) -> SegmentEnds:
    seconds = end.t - begin.t
    speeds = [(b - a) / seconds for a, b in zip(begin.positions, end.positions, strict=True)]
    from_, to = (
        tuple(Motion(position, speed, 0.0) for position, speed in zip(point.positions, speeds, strict=True))
        for point in (begin, end)
    )
    return SegmentEnds(begin, end, from_, to)
