"""What paths are made of, each by its own length: straight lines, arcs of circles, and corners that are rounded.

Theory of operation
-------------------
A piece is walked along by ``s`` from 0 to its ``length``, with a tangent of length 1, so that the speed along it is that of the
path. A corner turns with the curvature of a raised cosine, which is 0 where it joins its lines: neither velocity nor acceleration
jumps there. Its place is the integral of its direction, by eight points of Gauss and Legendre: a fixed number of steps, to within
a few billionths of its length.

``shares`` are the highest parts of the speed that each axis has of it, ``bends`` those that it can have of an acceleration, and
``curvatures(count)`` the highest of each of at most so many stretches of the same length, in 1/unit: what limits are made of.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

Place = tuple[float, ...]
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
# On a curve, of an axis's acceleration: what turns, and what speeds up (0.8² + 0.6² = 1).
TURNS, SPEEDS = 0.8, 0.6
_STRETCHES = 12  # of a corner: enough that it is gone into faster than through its middle


@dataclass(frozen=True, slots=True)
class Straight:
    """A straight line from ``start`` to ``end``; ``length`` in the unit of the path, which need not be that of the axes."""

    start: Place
    end: Place
    length: float

    def at(self, s: float) -> Place:
        """Return the place at ``s``."""
        if s >= self.length:
            return self.end
        share = s / self.length
        return tuple([a + (b - a) * share for a, b in zip(self.start, self.end, strict=True)])

    def curvatures(self, _count: int) -> Place:
        """It has none."""
        return (0.0,)

    @property
    def shares(self) -> Place:
        """Of each axis, its part of the speed."""
        length = self.length or math.inf
        return tuple(abs(b - a) / length for a, b in zip(self.start, self.end, strict=True))

    @property
    def bends(self) -> Place:
        """Of each axis, its part of the acceleration."""
        return self.shares

    @property
    def box(self) -> tuple[Place, Place]:
        """The lowest and the highest place of each axis."""
        return _box(self.start, self.end)


@dataclass(frozen=True, slots=True)
class Arc:
    """A part of a circle about ``centre``: ``out`` leads from there to its start, ``along`` is its direction there.

    Both are of length 1; ``radius`` in the unit of the path, ``angle`` in radians, above 0.
    """

    centre: Place
    out: Place
    along: Place
    radius: float
    angle: float

    @property
    def length(self) -> float:
        """Of the arc."""
        return self.radius * self.angle

    def at(self, s: float) -> Place:
        """Return the place at ``s``."""
        turned = min(s / self.radius, self.angle)
        cos, sin = self.radius * math.cos(turned), self.radius * math.sin(turned)
        return tuple(
            [c + cos * o + sin * a for c, o, a in zip(self.centre, self.out, self.along, strict=True)]
        )

    def curvatures(self, _count: int) -> Place:
        """The same everywhere."""
        return (1.0 / self.radius,)

    @property
    def shares(self) -> Place:
        """Of each axis, its highest part of the speed."""
        return tuple(_highest(a, -o, self.angle) for o, a in zip(self.out, self.along, strict=True))

    @property
    def bends(self) -> Place:
        """Of each axis, its highest part of an acceleration in the plane of the circle."""
        return tuple(map(math.hypot, self.out, self.along))

    @property
    def box(self) -> tuple[Place, Place]:
        """The lowest and the highest place of each axis."""
        ends = zip(self.at(0.0), self.at(self.length), strict=True)
        rows = [
            _swing(c, self.radius * o, self.radius * a, self.angle, each)
            for c, o, a, each in zip(self.centre, self.out, self.along, ends, strict=True)
        ]
        return tuple(low for low, _ in rows), tuple(high for _, high in rows)


@dataclass(frozen=True, slots=True)
class Corner:
    """A corner at ``tip``, rounded from ``trim`` before it to as far behind it; ``into`` and ``out`` are its directions.

    Both are of length 1; ``angle`` is by how much it turns, above 0 and below pi.
    """

    tip: Place
    into: Place
    out: Place
    trim: float
    length: float
    angle: float

    def at(self, s: float) -> Place:
        """Return the place at ``s``; both halves are the same, seen from their own ends."""
        if s <= 0.5 * self.length:
            return self._from(self.into, self.out, s, 1.0)
        return self._from(self.out, self.into, max(self.length - s, 0.0), -1.0)

    def _from(self, here: Place, there: Place, s: float, sign: float) -> Place:
        x, y = turned(self.angle, s / self.length)
        across = sign * y * self.length / math.sin(self.angle)
        along = sign * (x * self.length - self.trim) - across * math.cos(self.angle)
        return tuple([t + along * h + across * o for t, h, o in zip(self.tip, here, there, strict=True)])

    def curvatures(self, count: int) -> Place:
        """None at its ends, in its middle twice that of the circle that turns as much over the same length."""
        middle = self.angle / self.length
        return tuple(middle * factor for factor in _rise(min(count, _STRETCHES)))

    @property
    def shares(self) -> Place:
        """Of each axis, its highest part of the speed."""
        return tuple(_highest(d, n, self.angle) for d, n in zip(self.into, self._normal, strict=True))

    @property
    def bends(self) -> Place:
        """Of each axis, its highest part of an acceleration in the plane of the corner."""
        return tuple(map(math.hypot, self.into, self._normal))

    @property
    def box(self) -> tuple[Place, Place]:
        """The lowest and the highest place of each axis, that of the tip included."""
        low, high = _box(self.at(0.0), self.at(self.length))
        return tuple(map(min, low, self.tip)), tuple(map(max, high, self.tip))

    @property
    def _normal(self) -> Place:
        cos, sin = math.cos(self.angle), math.sin(self.angle)
        return tuple((o - cos * i) / sin for i, o in zip(self.into, self.out, strict=True))


Piece = Straight | Arc | Corner


@cache
def _rise(count: int) -> Place:
    """Return the highest curvature of each stretch of a corner that turns by 1 over a length of 1."""
    middle = (min(max(0.5, n / count), (n + 1) / count) for n in range(count))  # its place next to the middle
    return tuple(1.0 - math.cos(math.tau * at) for at in middle)


def turning(curvature: float, ramp: float) -> float:
    """Return how fast a curve may be gone along, of which ``ramp`` is the acceleration (per s²)."""
    return math.sqrt(TURNS * ramp / curvature) if curvature else math.inf


def turned(angle: float, share: float) -> tuple[float, float]:
    """Return where a corner of length 1 is after ``share`` of it, seen from its start along its first direction."""
    half, x, y = 0.5 * share, 0.0, 0.0
    for node, weight in _NODES:
        at = half * (1.0 + node)
        heading = angle * (at - math.sin(2.0 * math.pi * at) / (2.0 * math.pi))
        x += weight * math.cos(heading)
        y += weight * math.sin(heading)
    return half * x, half * y


def corner(tip: Place, into: Place, out: Place, *, within: float, room: float) -> Corner | None:
    """Return the corner that stays ``within`` so much of ``tip`` and takes no more than ``room`` of either line; None: it is none.

    A turn by less than a millionth of a millionth is a straight line; one that goes back on itself cannot be rounded (ValueError).
    """
    cos = sum(a * b for a, b in zip(into, out, strict=True))
    across = math.sqrt(sum((b - cos * a) ** 2 for a, b in zip(into, out, strict=True)))
    angle = math.atan2(across, cos)
    if angle < 1e-12:
        return None
    if angle > math.pi - 1e-3:
        raise ValueError("a way back cannot be rounded")
    x, y = turned(angle, 0.5)
    # Its middle lies on the line that halves the angle at the tip.
    trim = x + y * math.tan(0.5 * angle)
    away = y / math.cos(0.5 * angle)
    length = min(within / away, room / trim)
    return Corner(tip, into, out, length * trim, length, angle)


def _box(a: Place, b: Place) -> tuple[Place, Place]:
    return tuple(map(min, a, b)), tuple(map(max, a, b))


def _highest(first: float, second: float, angle: float) -> float:
    """Return the highest |first cos t + second sin t| for t from 0 to ``angle``."""
    ends = max(abs(first), abs(first * math.cos(angle) + second * math.sin(angle)))
    peak = math.atan2(second, first) % math.pi
    return math.hypot(first, second) if peak <= angle else ends


def _swing(
    centre: float, first: float, second: float, angle: float, ends: tuple[float, float]
) -> tuple[float, float]:
    """Return the lowest and highest centre + first cos t + second sin t for t from 0 to ``angle``; ``ends``: those at both."""
    peak, size = math.atan2(second, first) % math.tau, math.hypot(first, second)
    high = centre + size if _passes(peak, angle) else max(ends)
    low = centre - size if _passes((peak + math.pi) % math.tau, angle) else min(ends)
    return low, high


def _passes(at: float, angle: float) -> bool:
    return at <= angle or angle >= math.tau


def direction(a: Sequence[float], b: Sequence[float]) -> tuple[Place, float]:
    """Return the direction from ``a`` to ``b``, of length 1, and their distance; (all 0, 0.0) where they are the same."""
    way = [q - p for p, q in zip(a, b, strict=True)]
    length = math.hypot(*way)
    return tuple(part / length if length else 0.0 for part in way), length
