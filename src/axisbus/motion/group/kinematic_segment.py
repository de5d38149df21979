"""A piece of a way in the workspace of a machine whose axes make its places together, as a piece of the axes' own.

Theory of operation
-------------------
Along such a piece the axes' parts of the speed change from place to place, and where they do the axes are accelerated though the
speed stays. So it is surveyed: at short distances, the first and the second difference of each axis's position. If an axis's part
changes much between two samples, the steepest interval is halved until the part hardly changes any more. If it never does
(``_HALVINGS``), or an axis leaps (``_WILD``), as near a place where arms are stretched out, the way is refused: no speed along it
would keep the axis's acceleration. In each stretch what turns and what speeds up have half of an axis's acceleration each.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

from axisbus.motion.group.kinematics import Kinematics
from axisbus.motion.group.segments import SPEEDS, Arc, Corner, Place, Straight, turning
from axisbus.motion.parameters import AxisLimits

_FINE = 24  # stretches in a piece as long as the machine is large
_CORNER = 12  # of a corner, whose curvature changes
_ROUND = 32  # of a whole circle
_MOST = 400
_STEPS = 4  # samples in a stretch
_SPARE = 1.05  # what may lie between two samples
_WILD = 2.0  # by how much an axis's part may change within a stretch
_UNEVEN = 0.25  # of an axis's part: what more it changes by within a stretch is looked at more closely
_STILL = 1e-9  # relative to an axis's position: smaller motion is rounding
_HALVINGS = 5  # of an interval; near stretched arms the part grows by 1.4 with each
_HALF = 0.5


class Surveyed(NamedTuple):
    """A stretch: its length, each axis's highest part of the speed and change of that (per unit), and its box."""

    length: float
    shares: Place
    bends: Place
    curvature: float
    low: Place
    high: Place


@dataclass(frozen=True, slots=True)
class KinematicSegment:
    """``base`` in the workspace, gone along by the axes of ``kinematics``."""

    base: Straight | Arc | Corner
    kinematics: Kinematics

    @property
    def length(self) -> float:
        """Of the piece, in the workspace."""
        return self.base.length

    def at(self, s: float) -> Place:
        """Return the axes' positions at ``s``; raises ValueError out of reach."""
        return self.kinematics.inverse(self.base.at(s))

    def curvatures(self, count: int) -> Place:
        """Those in the workspace."""
        return self.base.curvatures(count)

    @property
    def shares(self) -> Place:
        """Of each axis, its highest part of the speed."""
        return tuple(map(max, zip(*(part.shares for part in survey(self)), strict=True)))

    @property
    def bends(self) -> Place:
        """Of each axis, its part of an acceleration along the way."""
        return self.shares

    @property
    def box(self) -> tuple[Place, Place]:
        """The lowest and the highest position of each axis."""
        found = survey(self)
        lows, highs = (part.low for part in found), (part.high for part in found)
        return tuple(map(min, zip(*lows, strict=True))), tuple(map(max, zip(*highs, strict=True)))


class SegmentLimits(NamedTuple):
    """A stretch as the axes' limits leave it: its length, highest speed and acceleration."""

    length: float
    top: float
    ramp: float


def held(
    parts: Iterable[Surveyed], limits: Sequence[AxisLimits], acceleration: float
) -> Iterator[SegmentLimits]:
    """Return the stretches of a piece, of which ``acceleration`` is what may be along it, and across it."""
    for part in parts:
        ramp, top = acceleration, math.inf
        for limit, share, bend in zip(limits, part.shares, part.bends, strict=True):
            if limit.velocity is not None and share:
                top = min(top, limit.velocity / share)
            if limit.acceleration is not None and share:
                ramp = min(ramp, _HALF * limit.acceleration / share if bend else limit.acceleration / share)
            if limit.acceleration is not None and bend:
                top = min(top, math.sqrt(_HALF * limit.acceleration / bend))
        if part.curvature:
            ramp, top = min(ramp, SPEEDS * acceleration), min(top, turning(part.curvature, acceleration))
        yield SegmentLimits(part.length, top, ramp)


@lru_cache(maxsize=4096)
def survey(piece: KinematicSegment) -> tuple[Surveyed, ...]:
    """Return the stretches of a piece, as they were found.

    Raises:
        ValueError: a place of it is out of reach, or too near to where an axis would have to leap.
    """
    base = piece.base
    count = _CORNER if isinstance(base, Corner) else 1
    if isinstance(base, Arc):
        count = math.ceil(_ROUND * base.angle / math.tau)
    if math.isfinite(piece.kinematics.characteristic_length):
        count = max(
            count, min(_MOST, math.ceil(_FINE * base.length / piece.kinematics.characteristic_length))
        )
    curvatures = base.curvatures(count)
    step = base.length / (count * _STEPS)
    places = [piece.at(min(max(n * step, 0.0), base.length)) for n in range(count * _STEPS + 1)]
    return tuple(
        _stretch(piece, places, n, step, curvatures[n * len(curvatures) // count]) for n in range(count)
    )


def _stretch(
    piece: KinematicSegment, places: Sequence[Place], number: int, step: float, curvature: float
) -> Surveyed:
    first = max(number * _STEPS - 1, 0)
    near = places[first : (number + 1) * _STEPS + 2]  # and one on either side
    columns = list(zip(*near, strict=True))
    length = step * _STEPS
    if not step:
        still = tuple(0.0 for _ in columns)
        return Surveyed(0.0, still, still, 0.0, near[0], near[0])
    slopes = [[(b - a) / step for a, b in pairwise(column)] for column in columns]
    bends = [[(b - a) / step for a, b in pairwise(row)] for row in slopes]
    parts: list[tuple[float, float]] = []  # of each axis: its highest slope, and the highest change of that
    for axis, (row, changes) in enumerate(zip(slopes, bends, strict=True)):
        least, most = min(map(abs, row)), max(map(abs, row))
        if most - least > _WILD * (least + 1e-9) and (most - least) * length > _LEAP:
            raise _leap(near[0])
        change = max(map(abs, changes))
        if most - least > _UNEVEN * most and most * length > _STILL * (1.0 + abs(columns[axis][0])):
            n = max(range(len(row)), key=lambda n: abs(row[n]))
            most, found = _steepest(piece, axis, (first + n) * step, step, near[n], near[n + 1])
            change = max(change, found)
        parts.append((_SPARE * most, _SPARE * change))
    low, high = tuple(map(min, columns)), tuple(map(max, columns))
    shares = tuple(share for share, _ in parts)
    curves = tuple(_rounded(change, share, length) for share, change in parts)
    return Surveyed(length, shares, curves, curvature, low, high)


def _steepest(
    piece: KinematicSegment, axis: int, start: float, step: float, a: Place, b: Place
) -> tuple[float, float]:
    """Return the highest slope of an axis within an interval from ``a`` to ``b``, and the highest change of it that was found.

    Raises:
        ValueError: the slope does not become steady, however short the interval.
    """
    slope, change = abs(b[axis] - a[axis]) / step, 0.0
    for _ in range(_HALVINGS):
        step *= 0.5
        middle = piece.at(start + step)
        before, after = (middle[axis] - a[axis]) / step, (b[axis] - middle[axis]) / step
        change = max(change, abs(after - before) / step)
        found = max(abs(before), abs(after))
        if found <= _SPARE * slope:
            return max(slope, found), change
        slope = found
        if abs(before) >= abs(after):
            b = middle
        else:
            start, a = start + step, middle
    raise _leap(a)


def _leap(place: Place) -> ValueError:
    return ValueError(
        f"at {', '.join(f'{value:.4g}' for value in place)} of its axes it comes too near to a leap"
    )


_LEAP = 20.0  # units of an axis within a stretch: what is less is no leap, however its part changes


def _rounded(bend: float, share: float, length: float) -> float:
    """Return a change of an axis's part, or 0 where it is nothing but what numbers are rounded to."""
    return bend if bend * length > 1e-6 * share else 0.0
