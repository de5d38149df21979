"""Timed points that a group follows as a whole: checked before anything moves, then completely known to the core."""

from __future__ import annotations

import secrets
from collections.abc import Mapping, Sequence

from axisbus.machine.axis import Axis
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.handle import Handle, mark_end_as_read
from axisbus.machine.request import items_of
from axisbus.machine.streaming.options import require_apart
from axisbus.motion.point_stream.commands import AddPoints, FollowPoints, StreamSegment
from axisbus.motion.point_stream.curve_fit import CurveFit, SegmentEnds
from axisbus.motion.point_stream.timed import TrajectoryPoint, timed_segments
from axisbus.session import Target
from axisbus.wording import counted

_AT_ONCE = 8  # segments per command; a cycle takes 32 commands: about a millisecond for six axes


def follow_points(
    axes: Mapping[str, Axis],
    commanding: CommandDispatcher,
    key: Target,
    name: str,
    points: Sequence[TrajectoryPoint],
) -> Handle:
    """Follow points; as ``Group.follow``. ``key``: the core's key of the group, ``name``: its name."""
    points = items_of(f"{name}.follow", "points", points)
    text = f"{name}.follow({counted(len(points), 'point')})"
    segments = _checked(axes, text, points)
    number = secrets.randbits(48)
    handle = commanding.submit(key, FollowPoints(tuple(axes), number), text)
    first = 0
    for some in _in_parts(segments):
        last = first + len(some) == len(segments)
        command = AddPoints(tuple(axes), number, first, some, begins=last, ends=last)
        mark_end_as_read(commanding.submit(key, command, f"{text}, spans from {first + 1} on"))
        first += len(some)
    return handle


def _in_parts(segments: Sequence[StreamSegment]) -> list[tuple[StreamSegment, ...]]:
    return [tuple(segments[n : n + _AT_ONCE]) for n in range(0, len(segments), _AT_ONCE)]


def _checked(axes: Mapping[str, Axis], text: str, points: Sequence[TrajectoryPoint]) -> list[StreamSegment]:
    """Return the checked segments for the core."""
    for axis in axes.values():
        axis._require_stream_limits(text)
    here = tuple(axis.commanded_position for axis in axes.values())
    scan = next(iter(axes.values())).scan_period
    parts = timed_segments(points, here, scan, text)
    begins_here = points[0].time > 0.0
    for count, point in enumerate(points, 1):
        _require_positions(axes, point, f"follow (point {count})")
    for segment in parts[1:-1]:
        require_apart(segment.seconds, scan, text, "the time between two points", longest=None)
    if not begins_here:
        for axis, position in zip(axes.values(), points[0].positions, strict=True):
            axis._require_at_start(text, position)
    fit = CurveFit({name: axis._stream_limits() for name, axis in axes.items()}, text)
    return [_checked_segment(fit, number - begins_here, segment) for number, segment in enumerate(parts)]


def _require_positions(axes: Mapping[str, Axis], point: TrajectoryPoint, call: str) -> None:
    for axis, position in zip(axes.values(), point.positions, strict=True):
        if axis.modulo is None:
            axis._absolute_position(call, position)
        else:
            axis._require_homed(call)


def _checked_segment(fit: CurveFit, count: int, segment: SegmentEnds) -> StreamSegment:
    """Return a checked segment. Error messages about it name the point after ``count``."""
    fit.count = max(count, 0)
    return fit.checked(segment)
