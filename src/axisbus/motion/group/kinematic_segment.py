"""A path segment in the workspace of a machine with kinematics, as a segment in axis positions.

Theory of operation
-------------------
Along such a segment the ratio of axis speed to path speed varies. While it varies, the axes accelerate even at constant path speed.
So the segment is surveyed: at short distances, the first and second differences of each axis position are computed. If an axis's
ratio changes much between two samples, the steepest interval is halved until the ratio hardly changes. If it keeps changing
(``_HALVINGS``), or an axis leaps (``_MAX_RATIO_CHANGE``), for example near a position with stretched arms, the path is rejected: no
path speed would keep the axis within its acceleration. In each speed zone, the change of direction and the change of speed get half
of an axis's acceleration each.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

from axisbus.motion.group.kinematics import Kinematics
from axisbus.motion.group.segments import SPEEDS, Arc, Coordinates, Corner, Straight, turning
from axisbus.motion.parameters import AxisLimits

_ZONES_PER_LENGTH = 24  # zones in a segment as long as the machine's characteristic length
_ZONES_PER_CORNER = 12  # in a corner, because its curvature varies
_ZONES_PER_CIRCLE = 32  # in a full circle
_MAX_ZONES = 400
_SAMPLES_PER_ZONE = 4  # samples in a zone
_MARGIN = 1.05  # margin for values between two samples
_MAX_RATIO_CHANGE = 2.0  # permitted relative change of an axis's ratio within a zone
_UNEVEN = 0.25  # of an axis's ratio: a zone with a larger change is examined more closely
_ROUNDING = 1e-9  # relative to an axis's position: smaller motion is rounding
_HALVINGS = 5  # of an interval; near stretched arms the ratio grows by 1.4 with each
_HALF = 0.5


class SurveyedZone(NamedTuple):
    """A surveyed zone: its length, each axis's highest speed ratio and change of that ratio (per unit), and its position range."""

    length: float
    speed_ratios: Coordinates
    acceleration_ratios: Coordinates
    curvature: float
    low: Coordinates
    high: Coordinates


@dataclass(frozen=True, slots=True)
class KinematicSegment:
    """Segment ``base`` in the workspace, executed by the axes of ``kinematics``."""

    base: Straight | Arc | Corner
    kinematics: Kinematics

    @property
    def length(self) -> float:
        """Length of the segment in the workspace."""
        return self.base.length

    def at(self, s: float) -> Coordinates:
        """Return the axis positions at ``s``; raises ValueError if they are out of reach."""
        return self.kinematics.inverse(self.base.at(s))

    def curvatures(self, count: int) -> Coordinates:
        """Return the curvatures in the workspace."""
        return self.base.curvatures(count)

    @property
    def speed_ratios(self) -> Coordinates:
        """The highest ratio of axis speed to path speed, by axis."""
        return tuple(map(max, zip(*(part.speed_ratios for part in survey(self)), strict=True)))

    @property
    def acceleration_ratios(self) -> Coordinates:
        """The highest ratio of axis acceleration to an acceleration along the path, by axis."""
        return self.speed_ratios

    @property
    def box(self) -> tuple[Coordinates, Coordinates]:
        """The lowest and the highest position of each axis."""
        found = survey(self)
        lows, highs = (part.low for part in found), (part.high for part in found)
        return tuple(map(min, zip(*lows, strict=True))), tuple(map(max, zip(*highs, strict=True)))


class SegmentLimits(NamedTuple):
    """A zone with the axes' limits applied: its length, highest speed and acceleration."""

    length: float
    top: float
    ramp: float


def limited_zones(
    parts: Iterable[SurveyedZone], limits: Sequence[AxisLimits], acceleration: float
) -> Iterator[SegmentLimits]:
    """Return the zones of a segment with limits applied; ``acceleration`` is the permitted value along the path and across it."""
    for part in parts:
        ramp, top = acceleration, math.inf
        for limit, speed_ratio, acceleration_ratio in zip(
            limits, part.speed_ratios, part.acceleration_ratios, strict=True
        ):
            if limit.velocity is not None and speed_ratio:
                top = min(top, limit.velocity / speed_ratio)
            if limit.acceleration is not None and speed_ratio:
                ramp = min(
                    ramp,
                    _HALF * limit.acceleration / speed_ratio
                    if acceleration_ratio
                    else limit.acceleration / speed_ratio,
                )
            if limit.acceleration is not None and acceleration_ratio:
                top = min(top, math.sqrt(_HALF * limit.acceleration / acceleration_ratio))
        if part.curvature:
            ramp, top = min(ramp, SPEEDS * acceleration), min(top, turning(part.curvature, acceleration))
        yield SegmentLimits(part.length, top, ramp)


@lru_cache(maxsize=4096)
def survey(segment: KinematicSegment) -> tuple[SurveyedZone, ...]:
    """Return the zones of a segment, without limits applied.

    Raises:
        ValueError: a position is out of reach, or too close to one at which an axis would have to leap.
    """
    base = segment.base
    count = _ZONES_PER_CORNER if isinstance(base, Corner) else 1
    if isinstance(base, Arc):
        count = math.ceil(_ZONES_PER_CIRCLE * base.angle / math.tau)
    if math.isfinite(segment.kinematics.characteristic_length):
        count = max(
            count,
            min(
                _MAX_ZONES,
                math.ceil(_ZONES_PER_LENGTH * base.length / segment.kinematics.characteristic_length),
            ),
        )
    curvatures = base.curvatures(count)
    step = base.length / (count * _SAMPLES_PER_ZONE)
    samples = [segment.at(min(max(n * step, 0.0), base.length)) for n in range(count * _SAMPLES_PER_ZONE + 1)]
    return tuple(
        _surveyed_zone(segment, samples, n, step, curvatures[n * len(curvatures) // count])
        for n in range(count)
    )


def _surveyed_zone(
    segment: KinematicSegment, samples: Sequence[Coordinates], number: int, step: float, curvature: float
) -> SurveyedZone:
    first = max(number * _SAMPLES_PER_ZONE - 1, 0)
    neighbours = samples[first : (number + 1) * _SAMPLES_PER_ZONE + 2]  # and one sample on either side
    columns = list(zip(*neighbours, strict=True))
    length = step * _SAMPLES_PER_ZONE
    if not step:
        still = tuple(0.0 for _ in columns)
        return SurveyedZone(0.0, still, still, 0.0, neighbours[0], neighbours[0])
    slopes = [[(b - a) / step for a, b in pairwise(column)] for column in columns]
    acceleration_ratios = [[(b - a) / step for a, b in pairwise(row)] for row in slopes]
    parts: list[tuple[float, float]] = []  # by axis: the highest ratio, and its highest change
    for axis, (row, changes) in enumerate(zip(slopes, acceleration_ratios, strict=True)):
        least, most = min(map(abs, row)), max(map(abs, row))
        if most - least > _MAX_RATIO_CHANGE * (least + 1e-9) and (most - least) * length > _MIN_LEAP:
            raise _leap_error(neighbours[0])
        change = max(map(abs, changes))
        if most - least > _UNEVEN * most and most * length > _ROUNDING * (1.0 + abs(columns[axis][0])):
            n = max(range(len(row)), key=lambda n: abs(row[n]))
            most, found = _steepest(segment, axis, (first + n) * step, step, neighbours[n], neighbours[n + 1])
            change = max(change, found)
        parts.append((_MARGIN * most, _MARGIN * change))
    low, high = tuple(map(min, columns)), tuple(map(max, columns))
    speed_ratios = tuple(speed_ratio for speed_ratio, _ in parts)
    curves = tuple(_rounded(change, speed_ratio, length) for speed_ratio, change in parts)
    return SurveyedZone(length, speed_ratios, curves, curvature, low, high)


def _steepest(
    segment: KinematicSegment, axis: int, start: float, step: float, a: Coordinates, b: Coordinates
) -> tuple[float, float]:
    """Return an axis's highest ratio within an interval from ``a`` to ``b``, and the highest change of it that was found.

    Raises:
        ValueError: the ratio does not become steady, however short the interval.
    """
    slope, change = abs(b[axis] - a[axis]) / step, 0.0
    for _ in range(_HALVINGS):
        step *= 0.5
        middle = segment.at(start + step)
        before, after = (middle[axis] - a[axis]) / step, (b[axis] - middle[axis]) / step
        change = max(change, abs(after - before) / step)
        found = max(abs(before), abs(after))
        if found <= _MARGIN * slope:
            return max(slope, found), change
        slope = found
        if abs(before) >= abs(after):
            b = middle
        else:
            start, a = start + step, middle
    raise _leap_error(a)


def _leap_error(coordinates: Coordinates) -> ValueError:
    return ValueError(
        f"at {', '.join(f'{value:.4g}' for value in coordinates)} of its axes it comes too near to a jump"
    )


_MIN_LEAP = 20.0  # units of an axis within a zone: less is not a leap, however much the ratio changes


def _rounded(acceleration_ratio: float, speed_ratio: float, length: float) -> float:
    """Return a change of an axis's ratio, or 0 if it is only a rounding error."""
    return acceleration_ratio if acceleration_ratio * length > 1e-6 * speed_ratio else 0.0
