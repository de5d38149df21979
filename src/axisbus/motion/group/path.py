"""A way that axes go together: its pieces, how fast and how hard each may be gone along, and how fast it may be left.

Theory of operation
-------------------
On a curve, the acceleration of an axis is made of what turns and what speeds up. Both together are no more than the axis's limit
where the one is at most 0.8 of it and the other 0.6 (0.8² + 0.6² = 1, and so are the squares of a tangent's and a normal's part).
The speed at each joint is low enough to come to rest at the end of the way, and at each stop on it, by what each piece allows:
whatever was asked for, and whatever becomes of that meanwhile, keeps to that (``travel``).
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, groupby, pairwise
from typing import NamedTuple

from axisbus.motion.group.jerk_limits import Soft, reaching, softened
from axisbus.motion.group.kinematic_segment import KinematicSegment, held, survey
from axisbus.motion.group.segments import SPEEDS, Corner, Piece, Place, Straight, turning
from axisbus.motion.group.speed_zone import SpeedZone
from axisbus.motion.moves.profile import duration
from axisbus.motion.parameters import AxisLimits
from axisbus.motion.sampled_path.segment import SampledSegment, surveyed

_AT_ONCE = 8  # stretches in a cycle: each takes some of its time
_FINE, _LEAST = 1 << 30, 1e-290
Part = Piece | KinematicSegment | SampledSegment  # of a way
_CHANGING = (
    Corner,
    KinematicSegment,
    SampledSegment,
)  # along which what is allowed changes from place to place


@dataclass(frozen=True, slots=True)
class Path:
    """The pieces of a way, begun at ``starts``, and its stretches, begun at ``marks``; a place is ``s``, 0 to ``length``.

    Each stretch has its highest speed (``tops``) and acceleration (``ramps``), and ``leaves``: the speed at its end; in the unit of
    the path, per s and per s². What each axis of a place comes to is known, too: ``lowest`` and ``highest`` place, its highest part
    of the speed (``shares``), highest speed and acceleration.
    """

    pieces: tuple[Part, ...]
    starts: tuple[float, ...]
    marks: tuple[float, ...]  # and the length of all
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
        """Of all pieces."""
        return self.marks[-1]

    def number(self, s: float) -> int:
        """Return which stretch ``s`` lies on; where two join, the second."""
        return min(max(bisect_right(self.marks, s) - 1, 0), len(self.tops) - 1)

    def is_last(self, number: int) -> bool:
        """Whether a stretch is the last one."""
        return number + 1 == len(self.tops)

    def piece(self, s: float) -> tuple[Part, float]:
        """Return the piece on which ``s`` lies, and how far along it."""
        number = max(bisect_right(self.starts, s) - 1, 0)
        return self.pieces[number], max(s - self.starts[number], 0.0)

    def at(self, s: float) -> Place:
        """Return the place of each axis at ``s``; before and after, the ends."""
        piece, gone = self.piece(s)
        return piece.at(gone)

    def seconds(self, velocity: float) -> float:
        """Return how long it takes at ``velocity``, at most: as if it stopped at the end of each stretch."""
        lengths = (b - a for a, b in pairwise(self.marks))
        return sum(
            duration(length, min(velocity, top), ramp)
            for length, top, ramp in zip(lengths, self.tops, self.ramps, strict=True)
        )

    def larger(self, by: float) -> Path:
        """Return the same way with places that are ``by`` times as large, for pieces that are straight lines."""
        rows = (self.starts, self.marks, self.tops, self.ramps, self.leaves)
        starts, marks, tops, ramps, leaves = (tuple(by * one for one in each) for each in rows)
        pieces = tuple(
            replace(piece, length=by * piece.length) for piece in self.pieces if isinstance(piece, Straight)
        )
        shares = tuple(share / by for share in self.shares)
        way = replace(self, pieces=pieces, starts=starts, marks=marks, tops=tops, ramps=ramps)
        return replace(way, leaves=leaves, shares=shares)

    def slower(self, share: float) -> Path:
        """Return the same way with ``share`` (above 0, at most 1) of its speeds and accelerations: it can be gone along as well."""
        tops, ramps, leaves = ([share * one for one in each] for each in (self.tops, self.ramps, self.leaves))
        return replace(self, tops=tuple(tops), ramps=tuple(ramps), leaves=tuple(leaves))


NOWHERE = Path((), (), (0.0,), (), (), (), (), (), (), (), ())


class CycleVelocity(NamedTuple):
    """The velocity that is asked for, and the period of a cycle in s."""

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
    """Return the way of ``pieces`` for axes with these limits (in the order of a ``Place``).

    ``acceleration`` is that of the path, in its unit per s². ``stops``: the numbers of the pieces at whose end it stands still.
    ``cycle``: where it is given, corners are no finer than what a cycle makes, and no cycle has much more than eight stretches.
    ``soft``: the limit of jerk, for straight lines and corners; also of a workspace, where it is that of the tool.
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
    """Divide a piece into stretches, each of which takes a cycle at least."""
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
    """Slow down where a cycle would have to go through more stretches than it has the time for."""
    marks = list(accumulate((each.length for each in stretches), initial=0.0))
    last = len(stretches) - _AT_ONCE
    return [
        each._replace(top=min(each.top, (marks[n + _AT_ONCE] - marks[n]) / period)) if n <= last else each
        for n, each in enumerate(stretches)
    ]


def _each(choose: Callable[[Iterable[float]], float], rows: Sequence[Place]) -> Place:
    """Return what is chosen of each column."""
    return tuple(choose(column) for column in zip(*rows, strict=True))


def _scaled(rows: Sequence[Place], by: Sequence[float]) -> list[Place]:
    return [tuple(part * one if part else 0.0 for part in row) for row, one in zip(rows, by, strict=True)]


def least(limits: Sequence[float | None], parts: Place) -> float:
    """Return what the axes' limits allow along a way of which they have these parts."""
    allowed = (limit / part for limit, part in zip(limits, parts, strict=True) if part and limit is not None)
    return min(allowed, default=math.inf)


def _leaves(
    stretches: Sequence[SpeedZone], ramps: Sequence[float], stops: Collection[int]
) -> tuple[float, ...]:
    """From the end on backwards: what each stretch may be left with."""
    found, after = [0.0] * len(stretches), None
    for number in range(len(stretches) - 1, -1, -1):
        here = stretches[number]
        if after is not None and not (here.piece in stops and after.piece != here.piece):
            enter = math.sqrt(found[number + 1] ** 2 + 2.0 * ramps[number + 1] * after.length)
            found[number] = min(enter, here.top, after.top)
        after = here
    return tuple(found)
