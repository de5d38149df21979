"""A path segment in the workspace of a machine with kinematics, as a segment in axis positions.

Theory of operation
-------------------
Along such a segment the ratio of axis speed to path speed varies. While it varies, the axes accelerate even at constant path speed.
So the segment is surveyed: at short distances, the first and second differences of each axis position are computed. If an axis's
ratio changes much between two samples, the steepest interval is halved until the ratio hardly changes. If it keeps changing
(``_HALVINGS``), or an axis leaps (``_WILD``), for example near a position with stretched arms, the path is rejected: no path speed
would keep the axis within its acceleration. In each speed zone, the change of direction and the change of speed get half of an
axis's acceleration each.
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

_FINE = 24  # zones in a segment as long as the machine's characteristic length
_CORNER = 12  # in a corner, because its curvature varies
_ROUND = 32  # in a full circle
_MOST = 400
_STEPS = 4  # samples in a zone
_SPARE = 1.05  # margin for values between two samples
_WILD = 2.0  # permitted relative change of an axis's ratio within a zone
_UNEVEN = 0.25  # of an axis's ratio: a zone with a larger change is examined more closely
_STILL = 1e-9  # relative to an axis's position: smaller motion is rounding
_HALVINGS = 5  # of an interval; near stretched arms the ratio grows by 1.4 with each
_HALF = 0.5


class Surveyed(NamedTuple):
    """A surveyed zone: its length, each axis's highest speed ratio and change of that ratio (per unit), and its position range."""

    length: float
    shares: Place
    bends: Place
    curvature: float
    low: Place
    high: Place


@dataclass(frozen=True, slots=True)
class KinematicSegment:
    """Segment ``base`` in the workspace, executed by the axes of ``kinematics``."""

    base: Straight | Arc | Corner
    kinematics: Kinematics

    @property
    def length(self) -> float:
        """Length of the segment in the workspace."""
        return self.base.length

    def at(self, s: float) -> Place:
        """Return the axis positions at ``s``; raises ValueError if they are out of reach."""
        return self.kinematics.inverse(self.base.at(s))

    def curvatures(self, count: int) -> Place:
        """Return the curvatures in the workspace."""
        return self.base.curvatures(count)

    @property
    def shares(self) -> Place:
        """The highest ratio of axis speed to path speed, by axis."""
        return tuple(map(max, zip(*(part.shares for part in survey(self)), strict=True)))

    @property
    def bends(self) -> Place:
        """The highest ratio of axis acceleration to an acceleration along the path, by axis."""
        return self.shares

    @property
    def box(self) -> tuple[Place, Place]:
        """The lowest and the highest position of each axis."""
        found = survey(self)
        lows, highs = (part.low for part in found), (part.high for part in found)
        return tuple(map(min, zip(*lows, strict=True))), tuple(map(max, zip(*highs, strict=True)))


class SegmentLimits(NamedTuple):
    """A zone with the axes' limits applied: its length, highest speed and acceleration."""

    length: float
    top: float
    ramp: float


def held(
    parts: Iterable[Surveyed], limits: Sequence[AxisLimits], acceleration: float
) -> Iterator[SegmentLimits]:
    """Return the zones of a segment with limits applied; ``acceleration`` is the permitted value along the path and across it."""
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
    """Return the zones of a segment, without limits applied.

    Raises:
        ValueError: a position is out of reach, or too close to one at which an axis would have to leap.
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
    near = places[first : (number + 1) * _STEPS + 2]  # and one sample on either side
    columns = list(zip(*near, strict=True))
    length = step * _STEPS
    if not step:
        still = tuple(0.0 for _ in columns)
        return Surveyed(0.0, still, still, 0.0, near[0], near[0])
    slopes = [[(b - a) / step for a, b in pairwise(column)] for column in columns]
    bends = [[(b - a) / step for a, b in pairwise(row)] for row in slopes]
    parts: list[tuple[float, float]] = []  # by axis: the highest ratio, and its highest change
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
    """Return an axis's highest ratio within an interval from ``a`` to ``b``, and the highest change of it that was found.

    Raises:
        ValueError: the ratio does not become steady, however short the interval.
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
        f"at {', '.join(f'{value:.4g}' for value in place)} of its axes it comes too near to a jump"
    )


_LEAP = 20.0  # units of an axis within a zone: less is not a leap, however much the ratio changes


def _rounded(bend: float, share: float, length: float) -> float:
    """Return a change of an axis's ratio, or 0 if it is only a rounding error."""
    return bend if bend * length > 1e-6 * share else 0.0
