"""Geometry of path segments, each parametrised by its own length: straight lines, circular arcs and rounded corners.

Theory of operation
-------------------
A segment is traversed by ``s`` from 0 to its ``length``, with a tangent of length 1, so that the rate of ``s`` is the path speed.
The curvature of a corner is a raised cosine, which is 0 at both ends: neither velocity nor acceleration jumps where the corner
joins its lines. A position in a corner is the integral of the direction, by eight-point Gauss-Legendre quadrature: a fixed number
of steps, accurate to a few billionths of the corner's length.

The limits of a segment are computed from three properties. ``speed_ratios`` are the highest ratios of axis speed to path speed, by
axis. ``acceleration_ratios`` are the highest ratios of axis acceleration to an acceleration of the path. ``curvatures(count)``
divides the segment into at most that many parts of equal length, and returns the highest curvature of each, in 1/unit.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

Coordinates = tuple[float, ...]
_NODES = (
    (-0.9602898564975363, 0.1012285362903763),
    (-0.7966664774136267, 0.2223810344533745),
    (-0.5255324099163290, 0.3137066458778873),
    (-0.1834346424956498, 0.3626837833783620),
    (0.1834346424956498, 0.3626837833783620),
    (0.5255324099163290, 0.3137066458778873),
    (0.7966664774136267, 0.2223810344533745),
    (0.9602898564975363, 0.1012285362903763),
)
# On a curve, shares of an axis's acceleration: for the change of direction, and for the change of speed (0.8² + 0.6² = 1).
TURNS, SPEEDS = 0.8, 0.6
_MAX_PARTS = 12  # parts of a corner: enough that its ends can be faster than its middle


@dataclass(frozen=True, slots=True)
class Straight:
    """A straight line from ``start`` to ``end``; ``length`` in the unit of the path, which need not be that of the axes."""

    start: Coordinates
    end: Coordinates
    length: float

    def at(self, s: float) -> Coordinates:
        """Return the axis positions at ``s``."""
        if s >= self.length:
            return self.end
        share = s / self.length
        return tuple([a + (b - a) * share for a, b in zip(self.start, self.end, strict=True)])

    def curvatures(self, _count: int) -> Coordinates:
        """Return 0: a straight line has no curvature."""
        return (0.0,)

    @property
    def speed_ratios(self) -> Coordinates:
        """Ratio of axis speed to path speed, by axis."""
        length = self.length or math.inf
        return tuple(abs(b - a) / length for a, b in zip(self.start, self.end, strict=True))

    @property
    def acceleration_ratios(self) -> Coordinates:
        """Ratio of axis acceleration to path acceleration, by axis."""
        return self.speed_ratios

    @property
    def box(self) -> tuple[Coordinates, Coordinates]:
        """The lowest and the highest position of each axis."""
        return _box(self.start, self.end)


@dataclass(frozen=True, slots=True)
class Arc:
    """An arc around ``centre``: ``out`` is the direction from the centre to the start, ``along`` the tangent at the start.

    Both have length 1; ``radius`` is in the unit of the path, ``angle`` in radians, above 0.
    """

    centre: Coordinates
    out: Coordinates
    along: Coordinates
    radius: float
    angle: float

    @property
    def length(self) -> float:
        """Length of the arc."""
        return self.radius * self.angle

    def at(self, s: float) -> Coordinates:
        """Return the axis positions at ``s``."""
        turned = min(s / self.radius, self.angle)
        cos, sin = self.radius * math.cos(turned), self.radius * math.sin(turned)
        return tuple(
            [c + cos * o + sin * a for c, o, a in zip(self.centre, self.out, self.along, strict=True)]
        )

    def curvatures(self, _count: int) -> Coordinates:
        """Return the curvature, which is constant."""
        return (1.0 / self.radius,)

    @property
    def speed_ratios(self) -> Coordinates:
        """The highest ratio of axis speed to path speed, by axis."""
        return tuple(_highest(a, -o, self.angle) for o, a in zip(self.out, self.along, strict=True))

    @property
    def acceleration_ratios(self) -> Coordinates:
        """The highest ratio of axis acceleration to an acceleration in the plane of the circle, by axis."""
        return tuple(map(math.hypot, self.out, self.along))

    @property
    def box(self) -> tuple[Coordinates, Coordinates]:
        """The lowest and the highest position of each axis."""
        ends = zip(self.at(0.0), self.at(self.length), strict=True)
        rows = [
            _swing(c, self.radius * o, self.radius * a, self.angle, each)
            for c, o, a, each in zip(self.centre, self.out, self.along, ends, strict=True)
        ]
        return tuple(low for low, _ in rows), tuple(high for _, high in rows)


@dataclass(frozen=True, slots=True)
class Corner:
    """A corner at ``tip``, rounded from ``trim`` before it to ``trim`` after it; ``into`` and ``out`` are its directions.

    Both have length 1; ``angle`` is the change of direction in radians, above 0 and below pi.
    """

    tip: Coordinates
    into: Coordinates
    out: Coordinates
    trim: float
    length: float
    angle: float

    def at(self, s: float) -> Coordinates:
        """Return the axis positions at ``s``; both halves are symmetric, each computed from its own end."""
        if s <= 0.5 * self.length:
            return self._from(self.into, self.out, s, 1.0)
        return self._from(self.out, self.into, max(self.length - s, 0.0), -1.0)

    def _from(self, here: Coordinates, there: Coordinates, s: float, sign: float) -> Coordinates:
        x, y = turned(self.angle, s / self.length)
        across = sign * y * self.length / math.sin(self.angle)
        along = sign * (x * self.length - self.trim) - across * math.cos(self.angle)
        return tuple([t + along * h + across * o for t, h, o in zip(self.tip, here, there, strict=True)])

    def curvatures(self, count: int) -> Coordinates:
        """Return curvatures: 0 at both ends; in the middle, twice the curvature of an arc with the same angle and length."""
        middle = self.angle / self.length
        return tuple(middle * factor for factor in _rise(min(count, _MAX_PARTS)))

    @property
    def speed_ratios(self) -> Coordinates:
        """The highest ratio of axis speed to path speed, by axis."""
        return tuple(_highest(d, n, self.angle) for d, n in zip(self.into, self._normal, strict=True))

    @property
    def acceleration_ratios(self) -> Coordinates:
        """The highest ratio of axis acceleration to an acceleration in the plane of the corner, by axis."""
        return tuple(map(math.hypot, self.into, self._normal))

    @property
    def box(self) -> tuple[Coordinates, Coordinates]:
        """The lowest and the highest position of each axis; includes the tip."""
        low, high = _box(self.at(0.0), self.at(self.length))
        return tuple(map(min, low, self.tip)), tuple(map(max, high, self.tip))

    @property
    def _normal(self) -> Coordinates:
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        return tuple((o - cos * i) / sin for i, o in zip(self.into, self.out, strict=True))


GeometricSegment = Straight | Arc | Corner


@cache
def _rise(count: int) -> Coordinates:
    """Return the highest curvature in each part of a corner with angle 1 and length 1."""
    # The point of each part that is closest to the middle.
    middle = (min(max(0.5, n / count), (n + 1) / count) for n in range(count))
    return tuple(1.0 - math.cos(math.tau * at) for at in middle)


def turning(curvature: float, ramp: float) -> float:
    """Return the highest speed on a curve, for which ``ramp`` is the permitted acceleration (per s²)."""
    return math.sqrt(TURNS * ramp / curvature) if curvature else math.inf


def turned(angle: float, share: float) -> tuple[float, float]:
    """Return the coordinates after ``share`` of a corner of length 1, relative to its start and its first direction."""
    half, x, y = 0.5 * share, 0.0, 0.0
    for node, weight in _NODES:
        at = half * (1.0 + node)
        heading = angle * (at - math.sin(2.0 * math.pi * at) / (2.0 * math.pi))
        x += weight * math.cos(heading)
        y += weight * math.sin(heading)
    return half * x, half * y


def corner(
    tip: Coordinates, into: Coordinates, out: Coordinates, *, within: float, max_trim: float
) -> Corner | None:
    """Return the corner that stays ``within`` that distance of ``tip`` and uses at most ``max_trim`` of either line; None: none.

    If the direction changes by less than 1e-12 rad, the lines are treated as one straight line.

    Raises:
        ValueError: the path reverses its direction, so that the corner cannot be rounded.
    """
    cos = sum(a * b for a, b in zip(into, out, strict=True))
    across = math.sqrt(sum((b - cos * a) ** 2 for a, b in zip(into, out, strict=True)))
    angle = math.atan2(across, cos)
    if angle < 1e-12:
        return None
    if angle > math.pi - 1e-3:
        raise ValueError("a reversal of the path cannot be rounded")
    x, y = turned(angle, 0.5)
    # The middle of the corner lies on the bisector of the angle at the tip.
    trim = x + y * math.tan(0.5 * angle)
    away = y / math.cos(0.5 * angle)
    length = min(within / away, max_trim / trim)
    return Corner(tip, into, out, length * trim, length, angle)


def _box(a: Coordinates, b: Coordinates) -> tuple[Coordinates, Coordinates]:
    return tuple(map(min, a, b)), tuple(map(max, a, b))


def _highest(first: float, second: float, angle: float) -> float:
    """Return the highest |first cos t + second sin t| for t from 0 to ``angle``."""
    ends = max(abs(first), abs(first * math.cos(angle) + second * math.sin(angle)))
    peak = math.atan2(second, first) % math.pi
    return math.hypot(first, second) if peak <= angle else ends


def _swing(
    centre: float, first: float, second: float, angle: float, ends: tuple[float, float]
) -> tuple[float, float]:
    """Return the range of centre + first cos t + second sin t for t from 0 to ``angle``; ``ends``: the values at both ends."""
    peak, size = math.atan2(second, first) % math.tau, math.hypot(first, second)
    high = centre + size if _passes(peak, angle) else max(ends)
    low = centre - size if _passes((peak + math.pi) % math.tau, angle) else min(ends)
    return low, high


def _passes(at: float, angle: float) -> bool:
    return at <= angle or angle >= math.tau


def direction(a: Sequence[float], b: Sequence[float]) -> tuple[Coordinates, float]:
    """Return the direction from ``a`` to ``b``, of length 1, and their distance; (all 0, 0.0) if they are equal."""
    vector = [q - p for p, q in zip(a, b, strict=True)]
    length = math.hypot(*vector)
    return tuple(part / length if length else 0.0 for part in vector), length
