"""Append a path to the active path: the corner between both, and the speeds of the part that is still ahead.

Theory of operation
-------------------
A path ends at rest, so the exit speeds of its last speed zones decrease towards its end. When another path is appended, the corner
between both is rounded. The exit speeds are recomputed from the transition backwards, as far as they change. A rounded corner
begins before the end of its line, so the appended path may come too late for the present speed. The corner is then made narrower
until it fits. If none fits, the axes stop at the transition, as they would have done without the appended path.

Path positions stay the same, and the part that has been passed is dropped. ``PathSpeed`` therefore continues where it is.

Each speed zone has a requested velocity (``velocities``) and a requested exit velocity (``exits``). Both are requests within the
path's limits: if it is too late to meet them, the speed comes as close as the acceleration permits.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

from axisbus.motion.blending.mode import BufferMode, narrower_corner, stopped_at_transition
from axisbus.motion.group.path import CycleVelocity, Path, PathSegment, build_path
from axisbus.motion.group.path_speed import PathSpeed, SpeedRequest
from axisbus.motion.group.segments import Coordinates, Corner, Straight, corner, direction
from axisbus.motion.parameters import AxisLimits

_HALVINGS = 12  # number of times that a corner is halved before it becomes a stop
_SAME = 1e-12


class ActivePath(NamedTuple):
    """An active path, with the requested velocities of its speed zones, and the velocity of its last command."""

    path: Path
    requested: SpeedRequest
    velocity: float


class PathContinuation(NamedTuple):
    """The path to append, which begins at the end of the active path, with its velocity and how it takes over.

    ``blend``: the greatest distance of the corner from the transition.
    """

    path: Path
    velocity: float
    mode: BufferMode
    blend: float = 0.0


class ExtendedPath(NamedTuple):
    """The combined path, and the path position at which the appended path takes over (``mark``).

    ``note``: the note on the handle if the transition differs from the requested one.
    """

    active: ActivePath
    mark: float
    note: str = ""


class _Rows(NamedTuple):
    """The speed zones of a path, as lists."""

    marks: list[float]
    max_speeds: list[float]
    ramps: list[float]
    max_exit_speeds: list[float]
    velocities: list[float]
    exits: list[float]


def active_path_of(path: Path, velocity: float) -> ActivePath:
    """Return an active path with one velocity."""
    same = (velocity,) * len(path.max_speeds)
    return ActivePath(path, SpeedRequest(same, same), velocity)


def append_path(
    active: ActivePath,
    travel: PathSpeed,
    following: PathContinuation,
    limits: Sequence[AxisLimits],
    period: float,
    ease: float = 1.0,
) -> ExtendedPath:
    """Return both paths as one; ``travel`` is on the first one, at any speed.

    ``ease``: the share of the permitted speeds that the corner and the appended path may use. The appended path must
    have a length. The axes stop at the transition if the path reverses there, or if no corner fits any more.
    """
    path = active.path
    if ease != 1.0:
        following = following._replace(path=following.path.slower(ease))
    first, last = following.path.segments[0], path.segments[-1]
    if not path.length > path.starts[-1] or not isinstance(last, Straight) or not isinstance(first, Straight):
        return _stopped(active, travel, following, "the end of the segment before it cannot be rounded")
    into, out = direction(last.start, last.end)[0], direction(first.start, first.end)[0]
    max_trim = min(path.length - max(travel.ahead, path.marks[-2]), 0.5 * first.length)
    is_late = travel.ahead > max(path.marks[-2], path.length - 0.5 * first.length)
    width = following.blend
    for _ in range(_HALVINGS):
        try:
            rounding = corner(last.end, into, out, within=width, max_trim=max(max_trim, 0.0))
        except ValueError:
            return _stopped(active, travel, following, "the path reverses there")
        if rounding is None:
            return _extended_at(None, active, travel, following, stops=False)
        if not rounding.length > _SAME * (1.0 + path.length):
            break
        corner_path = _corner_path(rounding, active, following, limits, period)
        corner_path = corner_path if ease == 1.0 else corner_path.slower(ease)
        found = _extended_at(corner_path, active, travel, following, stops=False)
        if travel.fits(found.active.path, period):
            is_narrower = is_late and rounding.trim >= max_trim * (1.0 - _SAME)
            return found._replace(note=narrower_corner()) if is_narrower else found
        width = max_trim = 0.5 * rounding.trim if width > rounding.trim else 0.5 * width
        is_late = True
    why = "it came too late for the corner" if is_late else "there is no room for a corner"
    return _stopped(active, travel, following, why)


def _stopped(active: ActivePath, travel: PathSpeed, following: PathContinuation, why: str) -> ExtendedPath:
    found = _extended_at(None, active, travel, following, stops=True)
    return found._replace(note=stopped_at_transition(why))


def _corner_path(
    rounding: Corner,
    active: ActivePath,
    following: PathContinuation,
    limits: Sequence[AxisLimits],
    period: float,
) -> Path:
    """Return the corner as a path of its own, with its speed zones."""
    cycle = CycleVelocity(max(active.velocity, following.velocity), period)
    return build_path([rounding], limits, min(active.path.ramps[-1], following.path.ramps[0]), (), cycle)


def _extended_at(
    corner_path: Path | None,
    active: ActivePath,
    travel: PathSpeed,
    following: PathContinuation,
    *,
    stops: bool,
) -> ExtendedPath:
    speed = 0.0 if stops else following.mode.velocity(active.velocity, following.velocity)
    path, rows = active.path, _rows_ahead(active, travel)
    behind = min(bisect_right(path.starts, travel.t) - 1, len(path.segments) - 1)
    segments, starts = list(path.segments[behind:]), list(path.starts[behind:])
    trim = 0.0 if corner_path is None else _trim(corner_path)
    end = path.length - trim
    rows.marks[-1] = end
    segments[-1] = _shortened(segments[-1], trim, at_end=True)
    if speed > active.velocity:
        _split(rows, speed, travel.ahead)
    settled, mark = len(rows.max_speeds) - 2, end
    rows.max_exit_speeds[-1] = rows.max_speeds[-1]
    if corner_path is not None:
        mark = end + 0.5 * corner_path.length
        rows.exits[-1] = speed
        _add(rows, corner_path, speed)
        segments += corner_path.segments
        starts.append(end)
    rows.exits[-1] = speed
    last = len(rows.max_speeds) - 1
    end = rows.marks[-1]
    _add(rows, following.path, following.velocity, trim)
    tail = following.path
    segments += [_shortened(tail.segments[0], trim, at_end=False), *tail.segments[1:]]
    starts += [end, *(end - trim + start for start in tail.starts[1:])]
    _recompute_exits(rows, last, settled, stops=stops)
    whole = _whole(path, corner_path, tail, rows, segments, starts)
    requested = SpeedRequest(tuple(rows.velocities), tuple(rows.exits))
    return ExtendedPath(ActivePath(whole, requested, following.velocity), mark)


def _trim(corner_path: Path) -> float:
    rounding = corner_path.segments[0]
    assert isinstance(rounding, Corner)
    return rounding.trim


def _rows_ahead(active: ActivePath, travel: PathSpeed) -> _Rows:
    path, requested = active.path, active.requested
    first = path.number(travel.t)
    rows = (path.max_speeds, path.ramps, path.max_exit_speeds, requested.velocities, requested.exits)
    return _Rows(list(path.marks[first:]), *(list(row[first:]) for row in rows))


def _add(rows: _Rows, path: Path, velocity: float, trim: float = 0.0) -> None:
    """Append the speed zones of ``path``, whose first zone is shortened by ``trim``."""
    begin = rows.marks[-1] - trim
    rows.marks.extend(begin + mark for mark in path.marks[1:])
    rows.max_speeds.extend(path.max_speeds)
    rows.ramps.extend(path.ramps)
    rows.max_exit_speeds.extend(path.max_exit_speeds)
    rows.velocities.extend([velocity] * len(path.max_speeds))
    rows.exits.extend([velocity] * len(path.max_speeds))


def _split(rows: _Rows, speed: float, here: float) -> None:
    """Split the last speed zone where acceleration to ``speed`` must begin, so that its end is reached at that speed."""
    ramp, velocity = rows.ramps[-1], rows.velocities[-1]
    top = min(speed, rows.max_speeds[-1])
    at = rows.marks[-1] - max(top * top - velocity * velocity, 0.0) / (2.0 * ramp)
    if at > max(here, rows.marks[-2]) and at < rows.marks[-1]:
        rows.marks.insert(-1, at)
        for row in rows[1:]:
            row.append(row[-1])
        rows.max_exit_speeds[-2] = rows.max_speeds[-1]
        rows.exits[-2] = velocity
    rows.velocities[-1] = rows.exits[-1] = speed


def _recompute_exits(rows: _Rows, last_zone: int, settled: int, *, stops: bool) -> None:
    """Recompute permitted and requested exit speeds, from speed zone ``last_zone`` backwards.

    Zones before ``settled`` have exit speeds already. The recomputation ends at the first of them that does not change.
    """
    if stops:
        rows.max_exit_speeds[last_zone] = rows.exits[last_zone] = 0.0
    else:
        # It was 0, because the path ended there.
        rows.max_exit_speeds[last_zone] = rows.max_speeds[last_zone]
    for number in range(last_zone - 1 if stops else last_zone, -1, -1):
        before = rows.max_exit_speeds[number], rows.exits[number]
        _recompute_exit(rows, number)
        if number < settled and before == (rows.max_exit_speeds[number], rows.exits[number]):
            return


def _recompute_exit(rows: _Rows, number: int) -> None:
    behind = number + 1
    gain = 2.0 * rows.ramps[behind] * (rows.marks[behind + 1] - rows.marks[behind])
    if rows.max_exit_speeds[number] > 0.0:  # otherwise a stop at its end
        reach = math.sqrt(rows.max_exit_speeds[behind] ** 2 + gain)
        rows.max_exit_speeds[number] = min(reach, rows.max_speeds[number], rows.max_speeds[behind])
    rows.exits[number] = min(rows.exits[number], math.sqrt(rows.exits[behind] ** 2 + gain))


def _shortened(segment: PathSegment, by: float, *, at_end: bool) -> PathSegment:
    if not by:
        return segment
    assert isinstance(segment, Straight)
    rest = max(segment.length - by, 0.0)
    share = by / segment.length
    if at_end:
        return Straight(segment.start, _between(segment.end, segment.start, share), rest)
    return Straight(_between(segment.start, segment.end, share), segment.end, rest)


def _between(a: Coordinates, b: Coordinates, share: float) -> Coordinates:
    return tuple(p + (q - p) * share for p, q in zip(a, b, strict=True))


def _whole(
    path: Path,
    corner_path: Path | None,
    tail: Path,
    rows: _Rows,
    segments: list[PathSegment],
    starts: list[float],
) -> Path:
    parts = [part for part in (path, corner_path, tail) if part is not None]

    def highest_of(name: str) -> Coordinates:
        return tuple(map(max, *(getattr(part, name) for part in parts)))

    return replace(
        path,
        segments=tuple(segments),
        starts=tuple(starts),
        marks=tuple(rows.marks),
        max_speeds=tuple(rows.max_speeds),
        ramps=tuple(rows.ramps),
        max_exit_speeds=tuple(rows.max_exit_speeds),
        lowest=tuple(map(min, *(part.lowest for part in parts))),
        highest=highest_of("highest"),
        speed_ratios=highest_of("speed_ratios"),
        speeds=highest_of("speeds"),
        accelerations=highest_of("accelerations"),
    )
