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

from axisbus.motion.blending.mode import BufferMode, narrower_corner, stopped_at_joint
from axisbus.motion.group.path import CycleVelocity, Part, Path, way_of
from axisbus.motion.group.path_speed import PathSpeed, SpeedRequest
from axisbus.motion.group.segments import Corner, Place, Straight, corner, direction
from axisbus.motion.parameters import AxisLimits

_NARROWER = 12  # number of times that a corner is halved before it becomes a stop
_SAME = 1e-12


class ActivePath(NamedTuple):
    """An active path, with the requested velocities of its speed zones, and the velocity of its last command."""

    way: Path
    asked: SpeedRequest
    velocity: float


class PathContinuation(NamedTuple):
    """The path to append, which begins at the end of the active path, with its velocity and how it takes over.

    ``blend``: the greatest distance of the corner from the transition.
    """

    way: Path
    velocity: float
    mode: BufferMode
    blend: float = 0.0


class JoinedPath(NamedTuple):
    """The combined path, and the path position at which the appended path takes over (``mark``).

    ``told``: the note on the handle if the transition differs from the requested one.
    """

    going: ActivePath
    mark: float
    told: str = ""


class _Rows(NamedTuple):
    """The speed zones of a path, as lists."""

    marks: list[float]
    tops: list[float]
    ramps: list[float]
    leaves: list[float]
    velocities: list[float]
    exits: list[float]


def going_of(way: Path, velocity: float) -> ActivePath:
    """Return an active path with one velocity."""
    same = (velocity,) * len(way.tops)
    return ActivePath(way, SpeedRequest(same, same), velocity)


def joined(
    going: ActivePath,
    travel: PathSpeed,
    following: PathContinuation,
    limits: Sequence[AxisLimits],
    period: float,
    ease: float = 1.0,
) -> JoinedPath:
    """Return both paths as one; ``travel`` is on the first one, at any speed.

    ``ease``: the share of the permitted speeds that the corner and the appended path may use. The appended path must
    have a length. The axes stop at the transition if the path reverses there, or if no corner fits any more.
    """
    way = going.way
    if ease != 1.0:
        following = following._replace(way=following.way.slower(ease))
    first, last = following.way.pieces[0], way.pieces[-1]
    if not way.length > way.starts[-1] or not isinstance(last, Straight) or not isinstance(first, Straight):
        return _stopped(going, travel, following, "the end of the segment before it cannot be rounded")
    into, out = direction(last.start, last.end)[0], direction(first.start, first.end)[0]
    room = min(way.length - max(travel.ahead, way.marks[-2]), 0.5 * first.length)
    late = travel.ahead > max(way.marks[-2], way.length - 0.5 * first.length)
    width = following.blend
    for _ in range(_NARROWER):
        try:
            bend = corner(last.end, into, out, within=width, room=max(room, 0.0))
        except ValueError:
            return _stopped(going, travel, following, "the path reverses there")
        if bend is None:
            return _joined_at(None, going, travel, following, stands=False)
        if not bend.length > _SAME * (1.0 + way.length):
            break
        bent = _bent(bend, going, following, limits, period)
        bent = bent if ease == 1.0 else bent.slower(ease)
        found = _joined_at(bent, going, travel, following, stands=False)
        if travel.fits(found.going.way, period):
            is_narrower = late and bend.trim >= room * (1.0 - _SAME)
            return found._replace(told=narrower_corner()) if is_narrower else found
        width = room = 0.5 * bend.trim if width > bend.trim else 0.5 * width
        late = True
    why = "it came too late for the corner" if late else "there is no room for a corner"
    return _stopped(going, travel, following, why)


def _stopped(going: ActivePath, travel: PathSpeed, following: PathContinuation, why: str) -> JoinedPath:
    found = _joined_at(None, going, travel, following, stands=True)
    return found._replace(told=stopped_at_joint(why))


def _bent(
    bend: Corner, going: ActivePath, following: PathContinuation, limits: Sequence[AxisLimits], period: float
) -> Path:
    """Return the corner as a path of its own, with its speed zones."""
    cycle = CycleVelocity(max(going.velocity, following.velocity), period)
    return way_of([bend], limits, min(going.way.ramps[-1], following.way.ramps[0]), (), cycle)


def _joined_at(
    bent: Path | None, going: ActivePath, travel: PathSpeed, following: PathContinuation, *, stands: bool
) -> JoinedPath:
    speed = 0.0 if stands else following.mode.velocity(going.velocity, following.velocity)
    way, rows = going.way, _rows_ahead(going, travel)
    behind = min(bisect_right(way.starts, travel.t) - 1, len(way.pieces) - 1)
    pieces, starts = list(way.pieces[behind:]), list(way.starts[behind:])
    trim = 0.0 if bent is None else _trim(bent)
    end = way.length - trim
    rows.marks[-1] = end
    pieces[-1] = _shortened(pieces[-1], trim, at_end=True)
    if speed > going.velocity:
        _split(rows, speed, travel.ahead)
    settled, mark = len(rows.tops) - 2, end
    rows.leaves[-1] = rows.tops[-1]
    if bent is not None:
        mark = end + 0.5 * bent.length
        rows.exits[-1] = speed
        _add(rows, bent, speed)
        pieces += bent.pieces
        starts.append(end)
    rows.exits[-1] = speed
    last = len(rows.tops) - 1
    end = rows.marks[-1]
    _add(rows, following.way, following.velocity, trim)
    tail = following.way
    pieces += [_shortened(tail.pieces[0], trim, at_end=False), *tail.pieces[1:]]
    starts += [end, *(end - trim + start for start in tail.starts[1:])]
    _reckon(rows, last, settled, stands=stands)
    whole = _whole(way, bent, tail, rows, pieces, starts)
    asked = SpeedRequest(tuple(rows.velocities), tuple(rows.exits))
    return JoinedPath(ActivePath(whole, asked, following.velocity), mark)


def _trim(bent: Path) -> float:
    bend = bent.pieces[0]
    assert isinstance(bend, Corner)
    return bend.trim


def _rows_ahead(going: ActivePath, travel: PathSpeed) -> _Rows:
    way, asked = going.way, going.asked
    first = way.number(travel.t)
    rows = (way.tops, way.ramps, way.leaves, asked.velocities, asked.exits)
    return _Rows(list(way.marks[first:]), *(list(row[first:]) for row in rows))


def _add(rows: _Rows, way: Path, velocity: float, trim: float = 0.0) -> None:
    """Append the speed zones of ``way``, whose first zone is shortened by ``trim``."""
    begin = rows.marks[-1] - trim
    rows.marks.extend(begin + mark for mark in way.marks[1:])
    rows.tops.extend(way.tops)
    rows.ramps.extend(way.ramps)
    rows.leaves.extend(way.leaves)
    rows.velocities.extend([velocity] * len(way.tops))
    rows.exits.extend([velocity] * len(way.tops))


def _split(rows: _Rows, speed: float, here: float) -> None:
    """Split the last speed zone where acceleration to ``speed`` must begin, so that its end is reached at that speed."""
    ramp, velocity = rows.ramps[-1], rows.velocities[-1]
    top = min(speed, rows.tops[-1])
    at = rows.marks[-1] - max(top * top - velocity * velocity, 0.0) / (2.0 * ramp)
    if at > max(here, rows.marks[-2]) and at < rows.marks[-1]:
        rows.marks.insert(-1, at)
        for row in rows[1:]:
            row.append(row[-1])
        rows.leaves[-2] = rows.tops[-1]
        rows.exits[-2] = velocity
    rows.velocities[-1] = rows.exits[-1] = speed


def _reckon(rows: _Rows, joint: int, settled: int, *, stands: bool) -> None:
    """Recompute permitted and requested exit speeds, from speed zone ``joint`` backwards.

    Zones before ``settled`` have exit speeds already. The recomputation ends at the first of them that does not change.
    """
    if stands:
        rows.leaves[joint] = rows.exits[joint] = 0.0
    else:
        rows.leaves[joint] = rows.tops[joint]  # the former end of the path, where it was 0
    for number in range(joint - 1 if stands else joint, -1, -1):
        before = rows.leaves[number], rows.exits[number]
        _reckon_one(rows, number)
        if number < settled and before == (rows.leaves[number], rows.exits[number]):
            return


def _reckon_one(rows: _Rows, number: int) -> None:
    behind = number + 1
    gain = 2.0 * rows.ramps[behind] * (rows.marks[behind + 1] - rows.marks[behind])
    if rows.leaves[number] > 0.0:  # otherwise a stop at its end
        reach = math.sqrt(rows.leaves[behind] ** 2 + gain)
        rows.leaves[number] = min(reach, rows.tops[number], rows.tops[behind])
    rows.exits[number] = min(rows.exits[number], math.sqrt(rows.exits[behind] ** 2 + gain))


def _shortened(piece: Part, by: float, *, at_end: bool) -> Part:
    if not by:
        return piece
    assert isinstance(piece, Straight)
    rest = max(piece.length - by, 0.0)
    share = by / piece.length
    if at_end:
        return Straight(piece.start, _between(piece.end, piece.start, share), rest)
    return Straight(_between(piece.start, piece.end, share), piece.end, rest)


def _between(a: Place, b: Place, share: float) -> Place:
    return tuple(p + (q - p) * share for p, q in zip(a, b, strict=True))


def _whole(
    way: Path, bent: Path | None, tail: Path, rows: _Rows, pieces: list[Part], starts: list[float]
) -> Path:
    parts = [part for part in (way, bent, tail) if part is not None]

    def most(name: str) -> Place:
        return tuple(map(max, *(getattr(part, name) for part in parts)))

    return replace(
        way,
        pieces=tuple(pieces),
        starts=tuple(starts),
        marks=tuple(rows.marks),
        tops=tuple(rows.tops),
        ramps=tuple(rows.ramps),
        leaves=tuple(rows.leaves),
        lowest=tuple(map(min, *(part.lowest for part in parts))),
        highest=most("highest"),
        shares=most("shares"),
        speeds=most("speeds"),
        accelerations=most("accelerations"),
    )
