"""Timed points that a group follows as a whole: checked before anything moves, then completely known to the core."""

from __future__ import annotations

import secrets
from collections.abc import Mapping, Sequence

from axisbus.machine.axis import Axis
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.handle import Handle, look_at_end
from axisbus.machine.request import items_of
from axisbus.machine.streaming.options import require_apart
from axisbus.motion.point_stream.commands import AddPoints, FollowPoints, Span
from axisbus.motion.point_stream.curve_fit import Between, CurveFit
from axisbus.motion.point_stream.timed import TrajectoryPoint, way_of
from axisbus.session import Target
from axisbus.wording import counted

_AT_ONCE = 8  # spans per command; a cycle takes 32 commands: about a millisecond for six axes


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
    spans = _checked(axes, text, points)
    number = secrets.randbits(48)
    handle = commanding.submit(key, FollowPoints(tuple(axes), number), text)
    first = 0
    for some in _in_parts(spans):
        last = first + len(some) == len(spans)
        command = AddPoints(tuple(axes), number, first, some, begins=last, ends=last)
        look_at_end(commanding.submit(key, command, f"{text}, spans from {first + 1} on"))
        first += len(some)
    return handle


def _in_parts(spans: Sequence[Span]) -> list[tuple[Span, ...]]:
    return [tuple(spans[n : n + _AT_ONCE]) for n in range(0, len(spans), _AT_ONCE)]


def _checked(axes: Mapping[str, Axis], text: str, points: Sequence[TrajectoryPoint]) -> list[Span]:
    """Return the checked spans for the core."""
    for axis in axes.values():
        axis._require_stream_limits(text)
    here = tuple(axis.commanded_position for axis in axes.values())
    scan = next(iter(axes.values())).scan_period
    way = way_of(points, here, scan, text)
    begins_here = points[0].time > 0.0
    for count, point in enumerate(points, 1):
        _require_places(axes, point, f"follow (point {count})")
    for between in way[1:-1]:
        require_apart(between.seconds, scan, text, "the time between two points", longest=None)
    if not begins_here:
        for axis, place in zip(axes.values(), points[0].positions, strict=True):
            axis._require_at_start(text, place)
    joining = CurveFit({name: axis._stream_limits() for name, axis in axes.items()}, text)
    return [_span(joining, number - begins_here, between) for number, between in enumerate(way)]


def _require_places(axes: Mapping[str, Axis], point: TrajectoryPoint, call: str) -> None:
    for axis, place in zip(axes.values(), point.positions, strict=True):
        if axis.modulo is None:
            axis._absolute_position(call, place)
        else:
            axis._require_homed(call)


def _span(joining: CurveFit, count: int, between: Between) -> Span:
    """Return a checked span. Error messages about it name the point after ``count``."""
    joining.count = max(count, 0)
    return joining.checked(between)
