"""A path for several axes: its segments, the highest speed and acceleration in each part, and the highest exit speeds.

Theory of operation
-------------------
On a curve, an axis needs acceleration for the change of direction and for the change of speed. Both together stay within the axis's
limit if the path's acceleration is at most 0.8 of the limit across the path and at most 0.6 along it. The reason: 0.8² + 0.6² = 1,
and the squares of an axis's tangential and normal components add up to at most 1 as well. The speed at the end of each speed zone
is limited: with the permitted accelerations of the following zones, the axes can still come to rest at the end of the path and at
each stop on it. These limits hold whatever velocity is requested, and however the request changes during the motion
(``path_speed``).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, groupby, pairwise
from typing import NamedTuple

from axisbus.motion.group.kinematic_segment import KinematicSegment, limited_zones, survey
from axisbus.motion.group.sampled_segment import SampledSegment, surveyed
from axisbus.motion.group.segments import SPEEDS, Coordinates, Corner, GeometricSegment, Straight, turning
from axisbus.motion.moves.profile import duration
from axisbus.motion.parameters import AxisLimits

_MAX_ZONES_PER_CYCLE = 8  # speed zones per cycle: each one costs computing time
_FINE, _LEAST = 1 << 30, 1e-290
PathSegment = GeometricSegment | KinematicSegment | SampledSegment  # a segment of a path
_VARYING = (
    Corner,
    KinematicSegment,
    SampledSegment,
)  # segments along which the permitted speed and acceleration vary


@dataclass(frozen=True, slots=True)
class Path:
    """The segments of a path, starting at ``starts``, and its speed zones, starting at ``marks``; path positions: 0 to ``length``.

    Each speed zone has a highest speed (``max_speeds``), an acceleration (``ramps``) and a highest speed at its end
    (``max_exit_speeds``). All are in the unit of the path, per s and per s². For each axis there are the ``lowest`` and ``highest``
    position, the highest ratio of axis speed to path speed (``speed_ratios``), the highest speed and the highest acceleration.
    """

    segments: tuple[PathSegment, ...]
    starts: tuple[float, ...]
    marks: tuple[float, ...]  # followed by the total length
    max_speeds: tuple[float, ...]
    ramps: tuple[float, ...]
    max_exit_speeds: tuple[float, ...]
    lowest: Coordinates
    highest: Coordinates
    speed_ratios: Coordinates
    speeds: Coordinates
    accelerations: Coordinates

    @property
    def length(self) -> float:
        """Length of all segments."""
        return self.marks[-1]

    def number(self, s: float) -> int:
        """Return the number of the speed zone that contains ``s``; at a boundary, the second zone."""
        return min(max(bisect_right(self.marks, s) - 1, 0), len(self.max_speeds) - 1)

    def is_last(self, number: int) -> bool:
        """Whether a speed zone is the last one."""
        return number + 1 == len(self.max_speeds)

    def segment(self, s: float) -> tuple[PathSegment, float]:
        """Return the segment that contains ``s``, and the distance along it."""
        number = max(bisect_right(self.starts, s) - 1, 0)
        return self.segments[number], max(s - self.starts[number], 0.0)

    def at(self, s: float) -> Coordinates:
        """Return the axis positions at ``s``; beyond an end, the positions at that end."""
        segment, distances = self.segment(s)
        return segment.at(distances)

    def seconds(self, velocity: float) -> float:
        """Return an upper bound of the duration at ``velocity``, computed as if the path stopped at the end of each speed zone."""
        lengths = (b - a for a, b in pairwise(self.marks))
        return sum(
            duration(length, min(velocity, top), ramp)
            for length, top, ramp in zip(lengths, self.max_speeds, self.ramps, strict=True)
        )

    def rescaled(self, by: float) -> Path:
        """Return the same path with path positions multiplied by ``by``; for paths of straight lines only."""
        rows = (self.starts, self.marks, self.max_speeds, self.ramps, self.max_exit_speeds)
        starts, marks, max_speeds, ramps, max_exit_speeds = (tuple(by * one for one in each) for each in rows)
        segments = tuple(
            replace(segment, length=by * segment.length)
            for segment in self.segments
            if isinstance(segment, Straight)
        )
        speed_ratios = tuple(share / by for share in self.speed_ratios)
        path = replace(
            self, segments=segments, starts=starts, marks=marks, max_speeds=max_speeds, ramps=ramps
        )
        return replace(path, max_exit_speeds=max_exit_speeds, speed_ratios=speed_ratios)

    def slower(self, share: float) -> Path:
        """Return the path with its speeds and accelerations multiplied by ``share`` (above 0, at most 1), which is feasible too."""
        max_speeds, ramps, max_exit_speeds = (
            [share * one for one in each] for each in (self.max_speeds, self.ramps, self.max_exit_speeds)
        )
        return replace(
            self, max_speeds=tuple(max_speeds), ramps=tuple(ramps), max_exit_speeds=tuple(max_exit_speeds)
        )


EMPTY_PATH = Path((), (), (0.0,), (), (), (), (), (), (), (), ())


class CycleVelocity(NamedTuple):
    """The requested velocity, and the scan period in s."""

    velocity: float
    period: float


def build_path(
    segments: Sequence[PathSegment],
    limits: Sequence[AxisLimits],
    acceleration: float,
    stops: Collection[int] = (),
    cycle: CycleVelocity | None = None,
    jerk_limit: JerkLimit | None = None,
) -> Path:
    """Return the path of ``segments`` for axes with these limits (in the order of a ``Coordinates``).

    ``acceleration``: acceleration of the path, in its unit per s². ``stops``: the indices of the segments that end with a stop.
    ``cycle``: if given, the speed zones of a corner are no shorter than the distance in one cycle, and a cycle crosses little more
    than eight of them. ``jerk_limit``: the limit of jerk, for straight lines and corners; also for a path in the workspace, where
    it limits the jerk of the tool.
    """
    speed_ratios, acceleration_ratios, boxes = zip(
        *((segment.speed_ratios, segment.acceleration_ratios, segment.box) for segment in segments),
        strict=True,
    )
    hardest = [
        min(acceleration, least([limit.acceleration for limit in limits], parts))
        for parts in acceleration_ratios
    ]
    fastest = [least([limit.velocity for limit in limits], parts) for parts in speed_ratios]
    zones: list[SpeedZone] = []
    for number, segment in enumerate(segments):
        if isinstance(segment, (KinematicSegment, SampledSegment)):
            found = survey(segment) if isinstance(segment, KinematicSegment) else surveyed(segment)
            parts = [SpeedZone(number, *part) for part in limited_zones(found, limits, acceleration)]
        else:
            parts = list(_speed_zones(number, segment, fastest[number], hardest[number], cycle))
        base = segment.base if isinstance(segment, KinematicSegment) else segment
        if jerk_limit is not None and isinstance(base, Corner):
            parts = jerk_limited_corner(base, parts, jerk_limit)
        zones += parts
    if jerk_limit is not None:
        varying = [n for n, each in enumerate(zones) if isinstance(segments[each.segment], _VARYING)]
        zones = list(spread_corner_limits(zones, varying, jerk_limit)) if varying else zones
    if cycle is not None:
        zones = _limit_zones_per_cycle(zones, cycle.period)
    ramps = tuple(each.ramp for each in zones)
    max_speeds = [
        max(each.top for each in group) for _, group in groupby(zones, key=lambda each: each.segment)
    ]
    return Path(
        segments=tuple(segments),
        starts=tuple(accumulate((segment.length for segment in segments[:-1]), initial=0.0)),
        marks=tuple(accumulate((each.length for each in zones), initial=0.0)),
        max_speeds=tuple(each.top for each in zones),
        ramps=ramps,
        max_exit_speeds=_max_exit_speeds(zones, ramps, stops),
        lowest=_each(min, [low for low, _ in boxes]),
        highest=_each(max, [high for _, high in boxes]),
        speed_ratios=_each(max, speed_ratios),
        speeds=_each(max, _scaled(speed_ratios, max_speeds)),
        accelerations=_each(max, _scaled(acceleration_ratios, hardest)),
    )


def _speed_zones(
    number: int, segment: GeometricSegment, fastest: float, ramp: float, cycle: CycleVelocity | None
) -> Iterator[SpeedZone]:
    """Divide a segment into speed zones, each of which takes at least one cycle."""
    count = _FINE
    if cycle is not None:
        slowest = min(cycle.velocity, fastest, turning(segment.curvatures(1)[0], ramp))
        count = int(max(1.0, min(segment.length / max(slowest * cycle.period, _LEAST), _FINE)))
    curvatures = segment.curvatures(count)
    slower = ramp if isinstance(segment, Straight) else SPEEDS * ramp
    for curvature in curvatures:
        top = min(fastest, turning(curvature, ramp))
        yield SpeedZone(number, segment.length / len(curvatures), top, slower)


def _limit_zones_per_cycle(zones: Sequence[SpeedZone], period: float) -> list[SpeedZone]:
    """Reduce speeds so that one cycle does not cross more than ``_MAX_ZONES_PER_CYCLE`` speed zones."""
    marks = list(accumulate((each.length for each in zones), initial=0.0))
    last = len(zones) - _MAX_ZONES_PER_CYCLE
    return [
        each._replace(top=min(each.top, (marks[n + _MAX_ZONES_PER_CYCLE] - marks[n]) / period))
        if n <= last
        else each
        for n, each in enumerate(zones)
    ]


def _each(choose: Callable[[Iterable[float]], float], rows: Sequence[Coordinates]) -> Coordinates:
    """Apply ``choose`` to each column."""
    return tuple(choose(column) for column in zip(*rows, strict=True))


def _scaled(rows: Sequence[Coordinates], by: Sequence[float]) -> list[Coordinates]:
    return [tuple(part * one if part else 0.0 for part in row) for row, one in zip(rows, by, strict=True)]


def least(limits: Sequence[float | None], parts: Coordinates) -> float:
    """Return the path speed or acceleration that the axes' limits allow; ``parts``: ratio of axis speed to path speed, by axis."""
    allowed = (limit / part for limit, part in zip(limits, parts, strict=True) if part and limit is not None)
    return min(allowed, default=math.inf)


def _max_exit_speeds(
    zones: Sequence[SpeedZone], ramps: Sequence[float], stops: Collection[int]
) -> tuple[float, ...]:
    """Compute the highest exit speed of each speed zone, from the end of the path backwards."""
    found, after = [0.0] * len(zones), None
    for number in range(len(zones) - 1, -1, -1):
        here = zones[number]
        if after is not None and not (here.segment in stops and after.segment != here.segment):
            enter = math.sqrt(found[number + 1] ** 2 + 2.0 * ramps[number + 1] * after.length)
            found[number] = min(enter, here.top, after.top)
        after = here
    return tuple(found)


# ----------------------------------------------------------------------------------------------------------------------
# Speed zones of a path with limited jerk: the highest speed in corners, and how far before and after them it applies.
#
# Theory of operation
# The position is the mean of the positions of the last cycles (``path_speed``). Speed and acceleration are therefore means as
# well. While the mean is in a corner, some of its values belong to positions before or after the corner. Therefore the corner's
# speed and acceleration also apply before and after it, over the distance covered at that speed in the time of the mean. Then all
# values comply with them, and so does the mean.
#
# Let v be the speed, a the acceleration and j its change. On a curve of curvature k the jerk is (j - k²v³) along the path and
# (3kva + k'v³) across it. In a corner, a is limited to a small share of its value on lines, and so is j. v is the highest speed
# at which both components together do not exceed the jerk.


# Of the acceleration, in corners: a larger share leaves too little jerk for the turn, a smaller one prolongs a halt in the corner.
_SHARE = 0.3
_SAFE = 0.99  # margin for values between two of the evaluated positions
_BISECTIONS = 40  # of bisection
_RESOLUTION = 1e-9  # relative to the length: the smallest distance between two boundaries
# Where the curvature of a corner and its rate of change are high: the second quarter (the third is symmetric).
_SAMPLED = tuple(0.25 + n / 32 for n in range(9))
_CURVED = tuple((1.0 - math.cos(math.tau * x), math.tau * math.sin(math.tau * x)) for x in _SAMPLED)


class JerkLimit(NamedTuple):
    """The ``jerk`` (unit/s³), the time of the mean (s), and the highest acceleration (unit/s²) and speed (unit/s) on the path."""

    jerk: float
    seconds: float
    hardest: float
    fastest: float = math.inf


def jerk_limited_corner(corner: Corner, parts: Sequence[SpeedZone], jerk_limit: JerkLimit) -> list[SpeedZone]:
    """Return the speed zones of a corner with speed and acceleration reduced for the jerk; one zone if all are equal."""
    ramp = min(_SHARE * jerk_limit.hardest, *(part.ramp for part in parts))
    fastest = _fastest(corner, ramp, jerk_limit)
    found = [part._replace(top=min(part.top, fastest), ramp=ramp) for part in parts]
    if len({part.top for part in found}) == 1:
        return [found[0]._replace(length=corner.length)]
    return found


def _fastest(corner: Corner, ramp: float, jerk_limit: JerkLimit) -> float:
    """Return the highest speed in a corner that does not exceed the jerk."""
    jerk, mean = _SAFE * jerk_limit.jerk, corner.angle / corner.length
    changes = 2.0 * ramp / jerk_limit.seconds
    acceleration_ratios = [(mean * rise, mean * change / corner.length) for rise, change in _CURVED]
    slow, fast = 0.0, math.cbrt(jerk) / mean ** (2.0 / 3.0)
    for _ in range(_BISECTIONS):
        v = 0.5 * (slow + fast)
        cube = v * v * v
        is_within = all(
            math.hypot(changes + k * k * cube, 3.0 * k * v * ramp + more * cube) <= jerk
            for k, more in acceleration_ratios
        )
        slow, fast = (v, fast) if is_within else (slow, v)
    return slow


def spread_corner_limits(
    zones: Sequence[SpeedZone], corners: Sequence[int], jerk_limit: JerkLimit
) -> Iterator[SpeedZone]:
    """Divide speed zones so that the limits of corners hold over the distance of the mean; ``corners``: indices of corner zones.

    Speed zones of a path in the workspace are treated like corners, because their limits change from each zone to the next.
    """
    marks = list(accumulate((each.length for each in zones), initial=0.0))
    distances = [jerk_limit.seconds * min(zones[n].top, jerk_limit.fastest) for n in corners]
    corner_zones = [
        (marks[n] - far, marks[n + 1] + far, zones[n]) for n, far in zip(corners, distances, strict=True)
    ]
    corner_zones.sort(key=lambda zone: zone[0])
    boundaries = _zone_boundaries(
        marks, [boundary for begin, end, _ in corner_zones for boundary in (begin, end)]
    )
    number, next_zone, active = 0, 0, corner_zones[:0]
    for a, b in pairwise(boundaries):
        middle = 0.5 * (a + b)
        while marks[number + 1] <= middle:
            number += 1
        while next_zone < len(corner_zones) and corner_zones[next_zone][0] <= middle:
            active.append(corner_zones[next_zone])
            next_zone += 1
        active = [zone for zone in active if zone[1] > middle]
        here = zones[number]
        top = min([here.top, *(other.top for _, _, other in active)])
        ramp = min([here.ramp, *(other.ramp for _, _, other in active)])
        yield SpeedZone(here.segment, b - a, top, ramp)


def _zone_boundaries(marks: Sequence[float], others: Sequence[float]) -> list[float]:
    """Return the zone boundaries: all ``marks``, and those of ``others`` that lie on the path and not next to another boundary."""
    least = _RESOLUTION * marks[-1]
    found, is_mark = [marks[0]], True
    inside = [(boundary, False) for boundary in others if marks[0] < boundary < marks[-1]]
    for boundary, marks_it in sorted([*((mark, True) for mark in marks[1:]), *inside]):
        if boundary - found[-1] > least or (marks_it and is_mark and boundary > found[-1]):
            found.append(boundary)
            is_mark = marks_it
        elif marks_it:
            found[-1], is_mark = boundary, True
    return found


# -- A part of a path with one highest speed and one acceleration ------------------------------------------------------


class SpeedZone(NamedTuple):
    """A part of a segment: the segment's index, and the part's length, highest speed and acceleration."""

    segment: int
    length: float
    top: float
    ramp: float
