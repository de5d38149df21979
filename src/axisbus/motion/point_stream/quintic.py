"""Motion of one axis between two points: the polynomial of degree five through position, speed and acceleration of both."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

_HALVINGS = 5  # of a curve: the range found is then accurate to a thousandth of the control points' range

Coefficients = tuple[float, float, float, float, float, float]  # of the powers of the time, starting at 0
Controls = tuple[float, ...]


class Motion(NamedTuple):
    """Motion of one axis at a point: position (unit), speed (unit/s) and acceleration (unit/s²)."""

    place: float
    speed: float
    rate: float


def coefficients(begin: Motion, end: Motion, seconds: float) -> Coefficients:
    """Return the polynomial from ``begin`` to ``end``, ``seconds`` (above 0) apart."""
    way = end.place - begin.place - (begin.speed + 0.5 * begin.rate * seconds) * seconds
    faster = (end.speed - begin.speed - begin.rate * seconds) * seconds
    harder = 0.5 * (end.rate - begin.rate) * seconds * seconds
    cube = seconds**3
    return (
        begin.place,
        begin.speed,
        0.5 * begin.rate,
        (10.0 * way - 4.0 * faster + harder) / cube,
        (-15.0 * way + 7.0 * faster - 2.0 * harder) / (cube * seconds),
        (6.0 * way - 3.0 * faster + harder) / (cube * seconds * seconds),
    )


def at(curve: Sequence[float], t: float) -> float:
    """Return the position ``t`` seconds after the beginning."""
    a, b, c, d, e, f = curve
    return a + t * (b + t * (c + t * (d + t * (e + t * f))))


def controls(begin: Motion, end: Motion, seconds: float) -> Controls:
    """Return the control points (Bernstein) of the same polynomial; its values lie within their range."""
    a, b = seconds / 5.0, seconds * seconds / 20.0
    return (
        begin.place,
        begin.place + a * begin.speed,
        begin.place + 2.0 * a * begin.speed + b * begin.rate,
        end.place - 2.0 * a * end.speed + b * end.rate,
        end.place - a * end.speed,
        end.place,
    )


def derived(points: Controls, seconds: float) -> Controls:
    """Return the control points of the derivative, per s."""
    times = (len(points) - 1) / seconds
    return tuple(times * (b - a) for a, b in pairwise(points))


def reach(points: Controls, halvings: int = _HALVINGS) -> tuple[float, float]:
    """Return bounds of the values, found by halving the curve: never too narrow, and hardly too wide."""
    if not halvings:
        return min(points), max(points)
    first, second = _halves(points)
    low, high = reach(first, halvings - 1)
    lower, higher = reach(second, halvings - 1)
    return min(low, lower), max(high, higher)


def _halves(points: Controls) -> tuple[Controls, Controls]:
    first, second = [points[0]], [points[-1]]
    while len(points) > 1:
        points = tuple(0.5 * (a + b) for a, b in pairwise(points))
        first.append(points[0])
        second.append(points[-1])
    return tuple(first), tuple(second[::-1])
