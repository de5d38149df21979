"""A path segment given by samples of the axis positions; only polynomials between samples are evaluated to move along it.

Theory of operation
-------------------
A sample is the motion of every axis as a function of the path length: its position, its slope (axis units per unit of path) and the
change of the slope. Between two samples runs the polynomial of degree five with the values of both. So neither the slope nor its
change jumps. Each polynomial lies between its control points, so the highest demand on an axis within an interval is known, and not
only at the samples.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

from axisbus.motion.group.kinematic_segment import SurveyedZone
from axisbus.motion.group.segments import Coordinates
from axisbus.motion.point_stream.curve_fit import Motion, at, coefficients, controls, derived

Row = tuple[Motion, ...]  # of each axis at one sample
_MAX_ZONES = 48  # zones per segment at most, so that a cycle crosses few of them
_PER_AXIS = 3  # numbers
_FLAT = 1e-9  # relative to a slope: a smaller change within an interval is only rounding


@dataclass(frozen=True, slots=True)
class SampledSegment:
    """``count`` intervals over ``length`` (units of the path); ``motions`` holds a sample before each and one at the end.

    A sample is three doubles (little-endian) for each of ``axes``. ``curved``: the highest curvature of the path in each interval.
    """

    length: float
    count: int
    axes: int
    motions: bytes
    curved: Coordinates

    @property
    def step(self) -> float:
        """The length of an interval."""
        return self.length / self.count

    def row(self, number: int) -> Row:
        """Return the sample with this number, 0 to ``count``."""
        size = _PER_AXIS * self.axes
        values = struct.unpack_from(f"<{size}d", self.motions, 8 * size * number)
        return tuple(Motion(*values[n : n + _PER_AXIS]) for n in range(0, size, _PER_AXIS))

    def at(self, s: float) -> Coordinates:
        """Return the axis positions at ``s``; beyond an end, the positions at that end."""
        step = self.step
        if not step:
            return tuple(motion.position for motion in self.row(0))
        number = min(max(int(s / step), 0), self.count - 1)
        t = min(max(s - number * step, 0.0), step)
        ends = zip(self.row(number), self.row(number + 1), strict=True)
        return tuple([at(coefficients(begin, end, step), t) for begin, end in ends])

    def curvatures(self, _count: int) -> Coordinates:
        """Return the curvatures of the path, one per interval."""
        return self.curved

    @property
    def speed_ratios(self) -> Coordinates:
        """The highest ratio of axis speed to path speed, by axis."""
        return tuple(map(max, zip(*(part.speed_ratios for part in surveyed(self)), strict=True)))

    @property
    def acceleration_ratios(self) -> Coordinates:
        """The highest ratio of axis acceleration to an acceleration along the path, by axis."""
        return self.speed_ratios

    @property
    def box(self) -> tuple[Coordinates, Coordinates]:
        """The lowest and the highest position of each axis."""
        found = surveyed(self)
        lows, highs = (part.low for part in found), (part.high for part in found)
        return tuple(map(min, zip(*lows, strict=True))), tuple(map(max, zip(*highs, strict=True)))


def sampled_segment_of(length: float, rows: Sequence[Row], curvatures: Sequence[float]) -> SampledSegment:
    """Return the segment of these equidistant samples; ``curvatures``: of any number of equal parts of the path."""
    count = len(rows) - 1
    values = [value for row in rows for motion in row for value in motion]
    spread = tuple(curvatures[n * len(curvatures) // count] for n in range(count))
    return SampledSegment(length, count, len(rows[0]), struct.pack(f"<{len(values)}d", *values), spread)


@lru_cache(maxsize=4096)
def surveyed(segment: SampledSegment) -> tuple[SurveyedZone, ...]:
    """Return the zones of a segment: for each axis, bounds of its speed ratio, of the change of the ratio, and of its position."""
    rows = [segment.row(number) for number in range(segment.count + 1)]
    each = math.ceil(segment.count / _MAX_ZONES)
    parts = [_interval(segment, rows, number) for number in range(segment.count)]
    return tuple(_merged(parts[n : n + each]) for n in range(0, segment.count, each))


def _interval(segment: SampledSegment, rows: Sequence[Row], number: int) -> SurveyedZone:
    """Return the bounds of the axes between two samples, from the control points of the polynomials."""
    step, curvature = segment.step, segment.curved[number]
    if not step:
        still = tuple(0.0 for _ in rows[0])
        here = tuple(motion.position for motion in rows[0])
        return SurveyedZone(0.0, still, still, 0.0, here, here)
    lines = [controls(a, b, step) for a, b in zip(rows[number], rows[number + 1], strict=True)]
    slopes = [derived(line, step) for line in lines]
    speed_ratios = tuple(max(map(abs, slope)) for slope in slopes)
    acceleration_ratios = tuple(max(map(abs, derived(slope, step))) for slope in slopes)
    return SurveyedZone(
        step,
        speed_ratios,
        tuple(
            b if b * step > _FLAT * s else 0.0 for b, s in zip(acceleration_ratios, speed_ratios, strict=True)
        ),
        curvature,
        tuple(map(min, lines)),
        tuple(map(max, lines)),
    )


def _merged(parts: Sequence[SurveyedZone]) -> SurveyedZone:
    """Return several intervals as one zone."""
    speed_ratios, acceleration_ratios, lows, highs = (
        list(zip(*rows, strict=True))
        for rows in (
            [part.speed_ratios for part in parts],
            [part.acceleration_ratios for part in parts],
            [part.low for part in parts],
            [part.high for part in parts],
        )
    )
    return SurveyedZone(
        sum(part.length for part in parts),
        tuple(map(max, speed_ratios)),
        tuple(map(max, acceleration_ratios)),
        max(part.curvature for part in parts),
        tuple(map(min, lows)),
        tuple(map(max, highs)),
    )
