"""Paths for groups: straight lines, lines through points with rounded corners, and circular arcs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise

from axisbus.errors import LimitError
from axisbus.motion.group.path import Path, build_path
from axisbus.motion.group.segments import (
    Arc,
    Coordinates,
    Corner,
    GeometricSegment,
    Straight,
    corner,
    direction,
)
from axisbus.motion.parameters import AxisParameters

_LONGEST = 366 * 86400.0  # seconds per path: a longer duration is taken for a mistake
# For a path position from 0 to 1: far more than one scan period can use, while the squares are still finite numbers.
_FASTEST = 1e6  # per s
_STEEPEST = 1e12  # per s²
_SLOWEST = 0.5  # seconds by which a limit of jerk may prolong a halt
_SAME = 1e-9  # relative to the largest coordinate: points no farther apart count as equal


def plan_line(
    starts: Mapping[str, float],
    ends: Mapping[str, float],
    axes: Mapping[str, AxisParameters],
    velocity: float,
    acceleration: float,
    name: str = "move_linear",
) -> tuple[Path, float]:
    """Plan a straight line from rest to rest; return the path, with positions from 0 to 1, and the velocity along it.

    ``velocity`` and ``acceleration`` apply to the path (the Euclidean length over all axes, in the axes' units per s and s²). The
    path is slower if an axis's own limits require it: the slowest axis determines the duration, and all axes stay on the line.
    ``name``: the command's name for messages.

    Raises:
        LimitError: the line would take more than a year.
    """
    start, end = (tuple(positions[axis] for axis in ends) for positions in (starts, ends))
    limits = [axes[axis].limits for axis in ends]
    length = math.dist(start, end)
    if length == 0:
        return build_path([Straight(start, end, 0.0)], limits, 1.0), 1.0
    speed, ramp = min(velocity / length, _FASTEST), min(acceleration / length, _STEEPEST)
    if not speed or not ramp:
        raise _endless(name, math.inf, length, velocity, acceleration)
    path = build_path([Straight(start, end, 1.0)], limits, ramp)
    require_end(path, speed, name, length)
    return path, speed


def require_end(path: Path, velocity: float, name: str, unit: float = 1.0) -> None:
    """Raise LimitError if a path takes more than a year, because a velocity or acceleration is far too small.

    ``unit``: length of path position 1 in the axes' units.
    """
    slow = min((*path.max_speeds, velocity)), min(path.ramps)
    seconds = path.seconds(velocity) if all(slow) else math.inf
    if seconds > _LONGEST:
        raise _endless(name, seconds, *(value * unit for value in (path.length, *slow)))


def window(hardest: float, jerk: float | None, period: float, name: str) -> int:
    """Return the number of cycles of ``period`` s to average over, so that ``jerk`` (units/s³; None: no limit) is not exceeded.

    ``hardest``: the highest acceleration (units/s²); ``name``: the command's name for messages.

    Raises:
        LimitError: the jerk is so small that it would prolong a halt by more than 0.5 s.
    """
    if jerk is None or not hardest:
        return 1
    seconds = 2.0 * hardest / jerk
    if seconds > _SLOWEST:
        raise LimitError(
            f"{name}: jerk {jerk:g} is too small for this acceleration",
            observed=f"a halt would take {seconds:g} s longer; {_SLOWEST:g} are allowed",
            remedy=f"give at least {2.0 * hardest / _SLOWEST:.3g} units/s³, or less acceleration",
        )
    return max(1, math.ceil(seconds / period))


def polyline(
    points: Sequence[Coordinates], blend: float, *, joins: bool = False, more: bool = False
) -> tuple[list[GeometricSegment], set[int]]:
    """Return the segments of straight lines through ``points``, and the indices of the segments that end with a stop.

    Each corner is rounded so that the path passes within ``blend`` (units) of it. A corner uses at most half of a line between two
    corners. With ``blend`` 0, and where the path reverses its direction, the path stops at the corner. Consecutive equal points
    count once.

    ``joins``: the path is appended to another one, so half of its first line is left for the corner between both. ``more``: another
    path may be appended.
    """
    least = _SAME * _size(points)
    points = _different(points, least)
    rays, last = [direction(a, b) for a, b in pairwise(points)], len(points) - 1
    segments: list[GeometricSegment] = []
    stops: set[int] = set()
    here = points[0]
    for number, tip in enumerate(points[1:], 1):
        rounding, stops_there = (
            _corner_after(rays, number, tip, blend, joins=joins, more=more)
            if number < last
            else (None, False)
        )
        end = tip if rounding is None else rounding.at(0.0)
        if (length := math.dist(here, end)) > least:
            segments.append(Straight(here, end, length))
        if rounding is not None:
            segments.append(rounding)
            end = rounding.at(rounding.length)
        if stops_there:
            stops.add(len(segments) - 1)
        here = end
    return segments or [Straight(here, here, 0.0)], stops


def arc_through(start: Coordinates, via: Coordinates, end: Coordinates) -> Arc:
    """Return the arc from ``start`` through ``via`` to ``end``, in any number of dimensions.

    Raises:
        ValueError: the points lie on one line, or two are equal.
    """
    first, length = direction(start, via)
    across = [b - a for a, b in zip(start, end, strict=True)]
    x = sum(a * b for a, b in zip(across, first, strict=True))
    normal, y = direction([x * a for a in first], across)
    if length == 0.0 or y <= _SAME * _size([start, via, end]):
        raise ValueError("three points on one line make no circle")
    # In the plane of both directions, with the start as its zero: via is (length, 0), end is (x, y).
    u, v = 0.5 * length, (x * x + y * y - length * x) / (2.0 * y)
    centre = tuple(s + u * a + v * b for s, a, b in zip(start, first, normal, strict=True))
    radius = math.hypot(u, v)
    out = tuple((s - c) / radius for s, c in zip(start, centre, strict=True))
    # Perpendicular to ``out``, in the direction of ``via``.
    along = tuple((v * a - u * b) / radius for a, b in zip(first, normal, strict=True))
    return Arc(centre, out, along, radius, _angle(out, along, centre, end))


def arc_about(start: Coordinates, centre: Coordinates, end: Coordinates, *, clockwise: bool) -> Arc:
    """Return the arc of two axes from ``start`` around ``centre`` to ``end``; a full circle if those are equal.

    Raises:
        ValueError: the distances from the centre to the start and to the end differ, or the centre equals one of them.
    """
    out, radius = direction(centre, start)
    far = math.dist(centre, end)
    if radius == 0.0 or abs(far - radius) > 1e-3 * radius:
        raise ValueError("the centre is not as far from the end as from the start")
    along = (out[1], -out[0]) if clockwise else (-out[1], out[0])
    return Arc(tuple(centre), out, along, radius, _angle(out, along, centre, end))


def _angle(out: Coordinates, along: Coordinates, centre: Coordinates, end: Coordinates) -> float:
    """Return the angle of an arc up to ``end``, above 0; a full circle if the arc ends at its start."""
    spoke = [e - c for e, c in zip(end, centre, strict=True)]
    x, y = (sum(a * b for a, b in zip(spoke, axis, strict=True)) for axis in (out, along))
    angle = math.atan2(y, x) % math.tau
    return math.tau if min(angle, math.tau - angle) < _SAME else angle


def _corner_after(
    rays: Sequence[tuple[Coordinates, float]],
    number: int,
    tip: Coordinates,
    blend: float,
    *,
    joins: bool,
    more: bool,
) -> tuple[Corner | None, bool]:
    """Return the corner after line ``number``, and whether the path stops there instead; (None, False) if the line is straight."""
    (into, length_in), (out, length_out) = rays[number - 1], rays[number]
    is_first, is_last = number == 1 and not joins, number + 1 == len(rays) and not more
    max_trim = min(length_in if is_first else 0.5 * length_in, length_out if is_last else 0.5 * length_out)
    try:
        found = corner(tip, into, out, within=blend, max_trim=max_trim)
    except ValueError:
        return None, True
    return (found, False) if blend > 0.0 else (None, found is not None)


def _different(points: Sequence[Coordinates], least: float) -> list[Coordinates]:
    return [tuple(points[0]), *(tuple(b) for a, b in pairwise(points) if math.dist(a, b) > least)]


def _size(points: Sequence[Coordinates]) -> float:
    return max(1e-9, *(abs(value) for point in points for value in point))


def _endless(name: str, seconds: float, length: float, velocity: float, acceleration: float) -> LimitError:
    return LimitError(
        f"{name}: the path would take more than a year",
        observed=f"{length:g} units of path at {velocity:g} units/s with {acceleration:g} units/s²: {seconds:g} s",
        remedy="give a velocity and an acceleration that suit this path, and check the computation of these values",
    )
