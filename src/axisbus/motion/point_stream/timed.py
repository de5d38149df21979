"""Convert points with times, with or without speeds and accelerations, to the curve of each axis between them.

Theory of operation
-------------------
Between two points runs a polynomial with the given values of both: of degree three with positions only or with velocities, of
degree five with accelerations. If no velocities are given, they are chosen so that no axis goes beyond the two points around its
position (Fritsch and Carlson). The motion begins and ends at rest. Before and after it the axes are at standstill for one
``rest_time``, during which the pace of a stream rises and falls. So the axes are at their points at the given times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

from axisbus.errors import ArgumentError
from axisbus.motion.numbers import number, short_repr
from axisbus.motion.point_stream.curve_fit import Motion, SegmentEnds, StreamPoint
from axisbus.wording import counted

MAX_POINTS = 4000  # points: as many segments as the core stores
STANDSTILL_SPEED = 1e-4  # units per s: a lower speed counts as rest


@dataclass(frozen=True, slots=True)
class TrajectoryPoint:
    """Positions of the axes at ``time`` (s), in their order and units, optionally with velocities (unit/s) and accelerations.

    Accelerations (unit/s²) require velocities. All points must have the same kinds of values.
    """

    time: float
    positions: Sequence[float]
    velocities: Sequence[float] | None = None
    accelerations: Sequence[float] | None = None


class _Row(NamedTuple):
    """A point, with optional speeds and accelerations of the axes."""

    time: float
    positions: tuple[float, ...]
    speeds: tuple[float, ...] | None
    rates: tuple[float, ...] | None


def timed_segments(
    points: Sequence[TrajectoryPoint], here: Sequence[float], rest_time: float, text: str
) -> list[SegmentEnds]:
    """Return the curve of the axes; it starts at ``here`` if the first point is later than 0. ``text``: beginning of messages.

    Raises:
        ArgumentError: a point is invalid, the times do not increase, or the motion does not begin and end at rest.
    """
    rows = [_row(number, point, len(here), text) for number, point in enumerate(points, 1)]
    _require_kinds(rows, text)
    _require_times(rows, text)
    if rows[0].time > 0.0:
        rest = tuple(0.0 for _ in here)
        begin = rows[0]._replace(time=0.0, positions=tuple(here))
        rows.insert(0, _given(begin, rest))
    rows[0] = _at_rest(rows[0], f"{text}: its first point")
    rows[-1] = _at_rest(rows[-1], f"{text}: its last point")
    known = rows if rows[0].speeds is not None else _with_speeds(rows)
    return [
        _rest_segment(known[0], -rest_time, 0.0),
        *map(_segment, pairwise(known)),
        _rest_segment(known[-1], 0.0, rest_time),
    ]


def _given(row: _Row, rest: tuple[float, ...]) -> _Row:
    """Return a point at rest, with the same kinds of values as ``row``."""
    return row._replace(
        speeds=None if row.speeds is None else rest, rates=None if row.rates is None else rest
    )


def _row(count: int, point: TrajectoryPoint, axes: int, text: str) -> _Row:
    given: tuple[Any, ...] = (None, None, None)
    if isinstance(point, TrajectoryPoint):
        given = (point.positions, point.velocities, point.accelerations)
    time = number(getattr(point, "time", None))
    found = [None if values is None else _numbers(values) for values in given]
    wrong = any(
        values is not None and (each is None or len(each) != axes)
        for values, each in zip(given, found, strict=True)
    )
    if time is None or wrong or found[0] is None:
        raise ArgumentError(
            f"{text}: point {count} is invalid: {short_repr(point)}",
            observed=f"a point is a time and {counted(axes, 'finite number')} of each kind",
            remedy="give one number for each axis, in their order; all points were rejected",
        )
    return _Row(time, found[0], found[1], found[2])


def _numbers(values: Sequence[float]) -> tuple[float, ...] | None:
    try:
        found = [number(value) for value in values]
    except TypeError:
        return None
    known = tuple(value for value in found if value is not None)
    return known if len(known) == len(found) else None


def _require_kinds(rows: Sequence[_Row], text: str) -> None:
    if not 0 < len(rows) <= MAX_POINTS:
        raise ArgumentError(
            f"{text}: {counted(len(rows), 'point')} cannot form a trajectory",
            remedy=f"give 1 to {MAX_POINTS} of them",
        )
    kinds = {(row.speeds is not None, row.rates is not None) for row in rows}
    if len(kinds) > 1 or (False, True) in kinds:
        raise ArgumentError(
            f"{text}: some points have velocities or accelerations, and some do not",
            remedy="give all points the same: positions; with velocities; or with velocities and accelerations",
        )


def _require_times(rows: Sequence[_Row], text: str) -> None:
    times = [row.time for row in rows]
    falls = next((n for n, (a, b) in enumerate(pairwise(times), 2) if b <= a), None)
    if falls is not None or times[0] < 0.0 or times[-1] <= 0.0:
        which = 1 if falls is None else falls
        raise ArgumentError(
            f"{text}: the time of point {which} is invalid",
            observed=f"it is {times[which - 1]:.6g} s"
            + ("" if falls is None else f", after {times[which - 2]:.6g} s"),
            remedy="times must begin at 0 or later and rise from one point to the next, and one must be later than 0; all "
            "points were rejected",
        )


def _at_rest(row: _Row, text: str) -> _Row:
    """Return an end point with a speed of exactly 0; raise ArgumentError if it is in motion."""
    if row.speeds is None:
        return row
    fastest = max(row.speeds, key=abs, default=0.0)
    if abs(fastest) > STANDSTILL_SPEED:
        raise ArgumentError(
            f"{text} is in motion",
            observed=f"its highest velocity is {fastest:.6g} units/s",
            remedy="begin and end with velocities of 0; all points were rejected",
        )
    return row._replace(speeds=tuple(0.0 for _ in row.speeds))


def _rest_segment(row: _Row, before: float, after: float) -> SegmentEnds:
    still = tuple(Motion(place, 0.0, 0.0) for place in row.positions)
    return SegmentEnds(
        StreamPoint(row.time + before, row.positions),
        StreamPoint(row.time + after, row.positions),
        still,
        still,
    )


def _segment(pair: tuple[_Row, _Row]) -> SegmentEnds:
    begin, end = pair
    ends = [_ends(begin, end, axis) for axis in range(len(begin.positions))]
    return SegmentEnds(
        StreamPoint(begin.time, begin.positions),
        StreamPoint(end.time, end.positions),
        tuple(one for one, _ in ends),
        tuple(other for _, other in ends),
    )


def _ends(begin: _Row, end: _Row, axis: int) -> tuple[Motion, Motion]:
    """Return the motion of an axis at both points; without accelerations, those of the polynomial of degree three."""
    assert begin.speeds is not None
    assert end.speeds is not None
    a, b, v, w = begin.positions[axis], end.positions[axis], begin.speeds[axis], end.speeds[axis]
    if begin.rates is not None and end.rates is not None:
        return Motion(a, v, begin.rates[axis]), Motion(b, w, end.rates[axis])
    seconds = end.time - begin.time
    bend = 6.0 * (b - a) / (seconds * seconds)
    return (
        Motion(a, v, bend - (4.0 * v + 2.0 * w) / seconds),
        Motion(b, w, (2.0 * v + 4.0 * w) / seconds - bend),
    )


def _with_speeds(rows: Sequence[_Row]) -> list[_Row]:
    """Return the points with speeds at which no axis overshoots a point; 0 at both ends."""
    times = [row.time for row in rows]
    columns = [
        _speeds(times, [row.positions[axis] for row in rows]) for axis in range(len(rows[0].positions))
    ]
    return [row._replace(speeds=speeds) for row, speeds in zip(rows, zip(*columns, strict=True), strict=True)]


def _speeds(times: Sequence[float], positions: Sequence[float]) -> list[float]:
    lengths = [b - a for a, b in pairwise(times)]
    slopes = [(b - a) / length for (a, b), length in zip(pairwise(positions), lengths, strict=True)]
    inner = (_through(h, g, a, b) for (h, g), (a, b) in zip(pairwise(lengths), pairwise(slopes), strict=True))
    return [0.0, *inner, 0.0]


def _through(h: float, g: float, before: float, after: float) -> float:
    """Return the speed between slopes of ``h`` and ``g`` seconds: 0 if the sign changes, else their weighted harmonic mean."""
    if before * after <= 0.0:
        return 0.0
    first, second = 2.0 * g + h, g + 2.0 * h
    return (first + second) / (first / before + second / after)
