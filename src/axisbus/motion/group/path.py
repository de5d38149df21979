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

from axisbus.motion.group.kinematic_segment import KinematicSegment, held, survey
from axisbus.motion.group.sampled_segment import SampledSegment, surveyed
from axisbus.motion.group.segments import SPEEDS, Corner, Piece, Place, Straight, turning
from axisbus.motion.moves.profile import duration
from axisbus.motion.parameters import AxisLimits

_AT_ONCE = 8  # speed zones per cycle: each one costs computing time
_FINE, _LEAST = 1 << 30, 1e-290
Part = Piece | KinematicSegment | SampledSegment  # a segment of a path
_CHANGING = (
    Corner,
    KinematicSegment,
    SampledSegment,
)  # segments along which the permitted speed and acceleration vary


@dataclass(frozen=True, slots=True)
class Path:
    """The segments of a path, starting at ``starts``, and its speed zones, starting at ``marks``; path positions: 0 to ``length``.

    Each speed zone has a highest speed (``tops``), an acceleration (``ramps``) and a highest speed at its end (``leaves``). All are
    in the unit of the path, per s and per s². For each axis there are the ``lowest`` and ``highest`` position, the highest ratio of
    axis speed to path speed (``shares``), the highest speed and the highest acceleration.
    """

    pieces: tuple[Part, ...]
    starts: tuple[float, ...]
    marks: tuple[float, ...]  # followed by the total length
    tops: tuple[float, ...]
    ramps: tuple[float, ...]
    leaves: tuple[float, ...]
    lowest: Place
    highest: Place
    shares: Place
    speeds: Place
    accelerations: Place

    @property
    def length(self) -> float:
        """Length of all segments."""
        return self.marks[-1]

    def number(self, s: float) -> int:
        """Return the number of the speed zone that contains ``s``; at a boundary, the second zone."""
        return min(max(bisect_right(self.marks, s) - 1, 0), len(self.tops) - 1)

    def is_last(self, number: int) -> bool:
        """Whether a speed zone is the last one."""
        return number + 1 == len(self.tops)

    def piece(self, s: float) -> tuple[Part, float]:
        """Return the segment that contains ``s``, and the distance along it."""
        number = max(bisect_right(self.starts, s) - 1, 0)
        return self.pieces[number], max(s - self.starts[number], 0.0)

    def at(self, s: float) -> Place:
        """Return the axis positions at ``s``; beyond an end, the positions at that end."""
        piece, gone = self.piece(s)
        return piece.at(gone)

    def seconds(self, velocity: float) -> float:
        """Return an upper bound of the duration at ``velocity``, computed as if the path stopped at the end of each speed zone."""
        lengths = (b - a for a, b in pairwise(self.marks))
        return sum(
            duration(length, min(velocity, top), ramp)
            for length, top, ramp in zip(lengths, self.tops, self.ramps, strict=True)
        )

    def larger(self, by: float) -> Path:
        """Return the same path with path positions multiplied by ``by``; for paths of straight lines only."""
        rows = (self.starts, self.marks, self.tops, self.ramps, self.leaves)
        starts, marks, tops, ramps, leaves = (tuple(by * one for one in each) for each in rows)
        pieces = tuple(
            replace(piece, length=by * piece.length) for piece in self.pieces if isinstance(piece, Straight)
        )
        shares = tuple(share / by for share in self.shares)
        way = replace(self, pieces=pieces, starts=starts, marks=marks, tops=tops, ramps=ramps)
        return replace(way, leaves=leaves, shares=shares)

    def slower(self, share: float) -> Path:
        """Return the path with its speeds and accelerations multiplied by ``share`` (above 0, at most 1), which is feasible too."""
        tops, ramps, leaves = ([share * one for one in each] for each in (self.tops, self.ramps, self.leaves))
        return replace(self, tops=tuple(tops), ramps=tuple(ramps), leaves=tuple(leaves))


NOWHERE = Path((), (), (0.0,), (), (), (), (), (), (), (), ())


class CycleVelocity(NamedTuple):
    """The requested velocity, and the scan period in s."""

    velocity: float
    period: float


def way_of(
    pieces: Sequence[Part],
    limits: Sequence[AxisLimits],
    acceleration: float,
    stops: Collection[int] = (),
    cycle: CycleVelocity | None = None,
    soft: Soft | None = None,
) -> Path:
    """Return the path of ``pieces`` for axes with these limits (in the order of a ``Place``).

    ``acceleration``: acceleration of the path, in its unit per s². ``stops``: the indices of the segments that end with a stop.
    ``cycle``: if given, the speed zones of a corner are no shorter than the distance in one cycle, and a cycle crosses little more
    than eight of them. ``soft``: the limit of jerk, for straight lines and corners; also for a path in the workspace, where it
    limits the jerk of the tool.
    """
    shares, bends, boxes = zip(*((piece.shares, piece.bends, piece.box) for piece in pieces), strict=True)
    hardest = [min(acceleration, least([limit.acceleration for limit in limits], parts)) for parts in bends]
    fastest = [least([limit.velocity for limit in limits], parts) for parts in shares]
    stretches: list[SpeedZone] = []
    for number, piece in enumerate(pieces):
        if isinstance(piece, (KinematicSegment, SampledSegment)):
            found = survey(piece) if isinstance(piece, KinematicSegment) else surveyed(piece)
            parts = [SpeedZone(number, *part) for part in held(found, limits, acceleration)]
        else:
            parts = list(_stretches(number, piece, fastest[number], hardest[number], cycle))
        base = piece.base if isinstance(piece, KinematicSegment) else piece
        if soft is not None and isinstance(base, Corner):
            parts = softened(base, parts, soft)
        stretches += parts
    if soft is not None:
        changing = [n for n, each in enumerate(stretches) if isinstance(pieces[each.piece], _CHANGING)]
        stretches = list(reaching(stretches, changing, soft)) if changing else stretches
    if cycle is not None:
        stretches = _not_too_many(stretches, cycle.period)
    ramps = tuple(each.ramp for each in stretches)
    tops = [max(each.top for each in group) for _, group in groupby(stretches, key=lambda each: each.piece)]
    return Path(
        pieces=tuple(pieces),
        starts=tuple(accumulate((piece.length for piece in pieces[:-1]), initial=0.0)),
        marks=tuple(accumulate((each.length for each in stretches), initial=0.0)),
        tops=tuple(each.top for each in stretches),
        ramps=ramps,
        leaves=_leaves(stretches, ramps, stops),
        lowest=_each(min, [low for low, _ in boxes]),
        highest=_each(max, [high for _, high in boxes]),
        shares=_each(max, shares),
        speeds=_each(max, _scaled(shares, tops)),
        accelerations=_each(max, _scaled(bends, hardest)),
    )


def _stretches(
    number: int, piece: Piece, fastest: float, ramp: float, cycle: CycleVelocity | None
) -> Iterator[SpeedZone]:
    """Divide a segment into speed zones, each of which takes at least one cycle."""
    count = _FINE
    if cycle is not None:
        slowest = min(cycle.velocity, fastest, turning(piece.curvatures(1)[0], ramp))
        count = int(max(1.0, min(piece.length / max(slowest * cycle.period, _LEAST), _FINE)))
    curvatures = piece.curvatures(count)
    slower = ramp if isinstance(piece, Straight) else SPEEDS * ramp
    for curvature in curvatures:
        top = min(fastest, turning(curvature, ramp))
        yield SpeedZone(number, piece.length / len(curvatures), top, slower)


def _not_too_many(stretches: Sequence[SpeedZone], period: float) -> list[SpeedZone]:
    """Reduce speeds so that one cycle does not cross more than ``_AT_ONCE`` speed zones."""
    marks = list(accumulate((each.length for each in stretches), initial=0.0))
    last = len(stretches) - _AT_ONCE
    return [
        each._replace(top=min(each.top, (marks[n + _AT_ONCE] - marks[n]) / period)) if n <= last else each
        for n, each in enumerate(stretches)
    ]


def _each(choose: Callable[[Iterable[float]], float], rows: Sequence[Place]) -> Place:
    """Apply ``choose`` to each column."""
    return tuple(choose(column) for column in zip(*rows, strict=True))


def _scaled(rows: Sequence[Place], by: Sequence[float]) -> list[Place]:
    return [tuple(part * one if part else 0.0 for part in row) for row, one in zip(rows, by, strict=True)]


def least(limits: Sequence[float | None], parts: Place) -> float:
    """Return the path speed or acceleration that the axes' limits allow; ``parts``: ratio of axis speed to path speed, by axis."""
    allowed = (limit / part for limit, part in zip(limits, parts, strict=True) if part and limit is not None)
    return min(allowed, default=math.inf)


def _leaves(
    stretches: Sequence[SpeedZone], ramps: Sequence[float], stops: Collection[int]
) -> tuple[float, ...]:
    """Compute the highest exit speed of each speed zone, from the end of the path backwards."""
    found, after = [0.0] * len(stretches), None
    for number in range(len(stretches) - 1, -1, -1):
        here = stretches[number]
        if after is not None and not (here.piece in stops and after.piece != here.piece):
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
_ROUNDS = 40  # of bisection
_NEXT = 1e-9  # relative to the length: the smallest distance between two boundaries
# Where the curvature of a corner and its rate of change are high: the second quarter (the third is symmetric).
_PLACES = tuple(0.25 + n / 32 for n in range(9))
_CURVED = tuple((1.0 - math.cos(math.tau * x), math.tau * math.sin(math.tau * x)) for x in _PLACES)


class Soft(NamedTuple):
    """The ``jerk`` (unit/s³), the time of the mean (s), and the highest acceleration (unit/s²) and speed (unit/s) on the path."""

    jerk: float
    seconds: float
    hardest: float
    fastest: float = math.inf


def softened(corner: Corner, parts: Sequence[SpeedZone], soft: Soft) -> list[SpeedZone]:
    """Return the speed zones of a corner with speed and acceleration reduced for the jerk; one zone if all are equal."""
    ramp = min(_SHARE * soft.hardest, *(part.ramp for part in parts))
    fastest = _fastest(corner, ramp, soft)
    found = [part._replace(top=min(part.top, fastest), ramp=ramp) for part in parts]
    if len({part.top for part in found}) == 1:
        return [found[0]._replace(length=corner.length)]
    return found


def _fastest(corner: Corner, ramp: float, soft: Soft) -> float:
    """Return the highest speed in a corner that does not exceed the jerk."""
    jerk, mean = _SAFE * soft.jerk, corner.angle / corner.length
    changes = 2.0 * ramp / soft.seconds
    bends = [(mean * rise, mean * change / corner.length) for rise, change in _CURVED]
    slow, fast = 0.0, math.cbrt(jerk) / mean ** (2.0 / 3.0)
    for _ in range(_ROUNDS):
        v = 0.5 * (slow + fast)
        cube = v * v * v
        kept = all(
            math.hypot(changes + k * k * cube, 3.0 * k * v * ramp + more * cube) <= jerk for k, more in bends
        )
        slow, fast = (v, fast) if kept else (slow, v)
    return slow


def reaching(stretches: Sequence[SpeedZone], corners: Sequence[int], soft: Soft) -> Iterator[SpeedZone]:
    """Divide speed zones so that the limits of corners hold over the distance of the mean; ``corners``: indices of corner zones.

    Speed zones of a path in the workspace are treated like corners, because their limits change from each zone to the next.
    """
    marks = list(accumulate((each.length for each in stretches), initial=0.0))
    gone = [soft.seconds * min(stretches[n].top, soft.fastest) for n in corners]
    spans = [(marks[n] - far, marks[n + 1] + far, stretches[n]) for n, far in zip(corners, gone, strict=True)]
    spans.sort(key=lambda span: span[0])
    edges = _edges(marks, [edge for begin, end, _ in spans for edge in (begin, end)])
    number, coming, near = 0, 0, spans[:0]
    for a, b in pairwise(edges):
        middle = 0.5 * (a + b)
        while marks[number + 1] <= middle:
            number += 1
        while coming < len(spans) and spans[coming][0] <= middle:
            near.append(spans[coming])
            coming += 1
        near = [span for span in near if span[1] > middle]
        here = stretches[number]
        top = min([here.top, *(other.top for _, _, other in near)])
        ramp = min([here.ramp, *(other.ramp for _, _, other in near)])
        yield SpeedZone(here.piece, b - a, top, ramp)


def _edges(marks: Sequence[float], others: Sequence[float]) -> list[float]:
    """Return the zone boundaries: all ``marks``, and those of ``others`` that lie on the path and not next to another boundary."""
    least = _NEXT * marks[-1]
    found, is_mark = [marks[0]], True
    inside = [(edge, False) for edge in others if marks[0] < edge < marks[-1]]
    for edge, marks_it in sorted([*((mark, True) for mark in marks[1:]), *inside]):
        if edge - found[-1] > least or (marks_it and is_mark and edge > found[-1]):
            found.append(edge)
            is_mark = marks_it
        elif marks_it:
            found[-1], is_mark = edge, True
    return found


# -- A part of a path with one highest speed and one acceleration ------------------------------------------------------


class SpeedZone(NamedTuple):
    """A part of a segment: the segment's index, and the part's length, highest speed and acceleration."""

    piece: int
    length: float
    top: float
    ramp: float
