"""Make a path from the arguments of a group's call: points in the axes' units, checked, as segments with velocities."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from functools import partial
from typing import TypeVar

from axisbus.errors import ArgumentError, AxisbusError, LimitError
from axisbus.machine.axis import Axis
from axisbus.machine.request import items_of
from axisbus.machine.user_kinematics.kinematics import UserKinematicsAdapter, prefixed
from axisbus.machine.user_kinematics.sampling import Sampling
from axisbus.motion.blending.mode import BufferMode
from axisbus.motion.group.commands import MovePath, PathTransition
from axisbus.motion.group.kinematic_segment import KinematicSegment, survey
from axisbus.motion.group.kinematics import Kinematics
from axisbus.motion.group.path import CycleVelocity, JerkLimit, PathSegment, build_path
from axisbus.motion.group.path_builder import arc_about, arc_through, polyline, require_end, window
from axisbus.motion.group.sampled_segment import SampledSegment
from axisbus.motion.group.segments import Arc, Coordinates, Corner, GeometricSegment
from axisbus.motion.numbers import number, short_repr
from axisbus.motion.override import MAX_OVERRIDE
from axisbus.wording import counted

T = TypeVar("T")
# points of one path: they are sent to the core at once, which takes a millisecond of its time
MAX_POINTS = 1000


def one_each(axes: Collection[str], text: str, values: Sequence[float]) -> Sequence[float]:
    """Return ``values``; raises ArgumentError unless there is one for each axis. ``text`` begins the message."""
    found = items_of(text.removesuffix(":"), "positions", values)
    if len(found) != len(axes):
        raise ArgumentError(
            f"{text} {counted(len(found), 'position')} for {counted(len(axes), 'axis', 'axes')}",
            remedy=f"give one for each of {', '.join(axes)}, in this order",
        )
    return found


def blend_of(text: str, blend: float, mode: BufferMode | None = None, axes: int = 2) -> float:
    """Return the corner distance; it must be above 0 for a motion of ``mode`` that blends.

    Raises:
        ArgumentError: not a distance; ``text`` names the call. A single axis (``axes`` is 1) has no corners.
    """
    corner_distance = number(blend)
    if corner_distance is None or corner_distance < 0.0:
        raise ArgumentError(
            f"{text}: blend {short_repr(blend)} is not a distance",
            remedy="give the distance within which corners are cut, or 0 to stop at each",
        )
    if corner_distance == 0.0 and axes > 1 and mode is not None and mode.blends:
        raise ArgumentError(
            f"{text}: without blend it would stop at the corner",
            observed=f'buffer is "{mode.value}", blend 0',
            remedy="give blend = the distance within which the corner may be cut, or let it begin at standstill: "
            'buffer="buffered"',
        )
    return corner_distance


class PathRequest:
    """Makes a ``MovePath`` from one call, such as ``xy.move_path(...)``. ``text`` names the call in messages."""

    def __init__(
        self,
        axes: Mapping[str, Axis],
        text: str,
        call: str,
        velocity: float,
        acceleration: float,
        jerk: float | None,
        *,
        after: Coordinates | None = None,
        buffer: BufferMode | None = None,
        blend: float = 0.0,
        more: bool = False,
        extends: bool = False,
        kinematics: Kinematics | UserKinematicsAdapter | None = None,
    ) -> None:
        """``velocity``, ``acceleration`` and ``jerk`` are already checked; ``call`` is the name of the method.

        ``after``: the end of the motion that it waits for; None: it begins at the axes' commanded positions. ``buffer``: PLCopen's
        BufferMode, with ``blend``. ``extends``: it extends the active path. ``more``: it reserves room for further points. Points
        are positions of the axes; with ``kinematics``, positions in the workspace.

        Raises:
            ArgumentError: an axis is endless.
            StaleError: the position of an axis is unknown.
        """
        self._axes = axes
        self._text, self._call = text, call
        self._velocity, self._acceleration, self._jerk = velocity, acceleration, jerk
        for name, axis in axes.items():
            if axis.modulo is not None:
                raise ArgumentError(
                    f"{text}: {name} is endless, so its positions cannot form a path",
                    observed=f"its modulo is {axis.modulo:g} {axis.unit}",
                    remedy="leave it out of the group, or move it by its own trajectory",
                )
        start: Coordinates = after or tuple(axis.commanded_position for axis in axes.values())
        self._axis_start = start
        self._kinematics = kinematics
        self._start = start if kinematics is None else self._within_reach(lambda: kinematics.forward(start))
        self._buffer, self._blend, self._more, self._extends = buffer, blend, more, extends

    @property
    def _takeover(self) -> PathTransition | None:
        if self._buffer is None or not self._buffer.blends:
            return None
        return PathTransition(self._buffer, self._blend, self._extends)

    def along(self, points: Sequence[Sequence[float]]) -> MovePath:
        """Return the path through ``points``; corners are cut by at most ``blend``.

        Raises:
            LimitError, ArgumentError: a point is invalid, there are none or too many, or ``blend`` is no distance.
        """
        if not 0 < len(points) <= MAX_POINTS:
            raise ArgumentError(
                f"{self._text}: a path has 1 to {MAX_POINTS} points, this one has {len(points)}",
                remedy="give its points in turn, as positions of the axes in the group's order",
            )
        checked_points = [self.point(f"point {number + 1}", point) for number, point in enumerate(points)]
        joins = self._takeover is not None
        segments, stops = polyline(
            [self._start, *checked_points], self._blend, joins=joins, more=joins or self._more
        )
        return self._path(segments, stops)

    def through(self, via: Sequence[float], end: Sequence[float]) -> MovePath:
        """Return the arc through ``via`` to ``end``.

        Raises:
            LimitError, ArgumentError: a point is invalid, or they make no circle.
        """
        by, to = self.point("via", via), self.point("end", end)
        return self._arc(lambda: arc_through(self._start, by, to))

    def about(self, centre: Sequence[float], end: Sequence[float], *, clockwise: bool) -> MovePath:
        """Return the arc about ``centre`` to ``end``.

        Raises:
            LimitError, ArgumentError: a point is invalid, the points define no circle, or there are not two axes.
        """
        if len(self._start) != 2:
            raise ArgumentError(
                f"{self._text}: a circle about a centre needs two axes, these are {len(self._start)}",
                remedy="make a group of two, or give a point that the circle goes through: via = ...",
            )
        middle = tuple(self._number("centre", value) for value in self._each("centre", centre))
        to = self.point("end", end)
        return self._arc(lambda: arc_about(self._start, middle, to, clockwise=clockwise))

    def point(self, what: str, values: Sequence[float]) -> Coordinates:
        """Return the position of ``values``, checked as an absolute move. A point in a workspace is checked with its path."""
        if self._kinematics is not None:
            for axis in self._axes.values():
                axis._require_homed(self._call)
            return tuple(self._number(what, value) for value in self._each(what, values))
        return tuple(
            axis._absolute_position(self._call, value)
            for axis, value in zip(self._axes.values(), self._each(what, values), strict=True)
        )

    def _each(self, what: str, values: Sequence[float]) -> Sequence[float]:
        if not isinstance(self._kinematics, UserKinematicsAdapter):
            return one_each(self._axes, f"{self._text}: {what} has", values)
        if len(values) != len(self._start):
            raise ArgumentError(
                f"{self._text}: {what} has {counted(len(values), 'coordinate')}",
                observed=f"{self._kinematics.name}.forward returns {len(self._start)}",
                remedy="give as many, in its order",
            )
        return values

    def _number(self, what: str, value: float) -> float:
        found = number(value)
        if found is None:
            raise ArgumentError(f"{self._text}: {what} {short_repr(value)} is not a finite number")
        return found

    def _arc(self, make: Callable[[], Arc]) -> MovePath:
        try:
            arc = make()
        except ValueError as error:
            raise ArgumentError(
                f"{self._text}: {error}", remedy="check the points, and the positions of the axes"
            ) from None
        if self._kinematics is None:
            self._require_within_limits(arc, "circle")
        return self._path([arc], set())

    def _require_within_limits(self, segment: Arc | KinematicSegment, what: str) -> None:
        for (name, axis), start, low, high in zip(
            self._axes.items(), self._axis_start, *segment.box, strict=True
        ):
            allowed = axis.room_from(start)
            if allowed is not None and not allowed[0] <= low <= high <= allowed[1]:
                raise LimitError(
                    f"{self._text}: the {what} leaves the position limits of {name}",
                    observed=f"it reaches from {low:g} to {high:g} {axis.unit}; "
                    f"the allowed range is {allowed[0]:g} to {allowed[1]:g}",
                    remedy=f"choose another {what}, or change position_limits in [axes.{name}] of cell.toml",
                )

    def _kinematic_segments(
        self, segments: Sequence[GeometricSegment], kinematics: Kinematics
    ) -> list[KinematicSegment]:
        """Return the segments as paths of the axes, each checked for reach and limits."""
        found = [KinematicSegment(segment, kinematics) for segment in segments]
        for segment in found:
            self._within_reach(lambda segment=segment: survey(segment))  # type: ignore[misc]
            self._require_within_limits(segment, "way")
        return found

    def _sampled(
        self, segments: Sequence[GeometricSegment], stops: Collection[int], own: UserKinematicsAdapter
    ) -> list[SampledSegment]:
        """Return the segments as paths of the axes, by the user's own kinematics, each checked for reach and limits."""
        return Sampling(own, segments, stops, self._axis_start, self._text).sampled_segments()

    def _within_reach(self, make: Callable[[], T]) -> T:
        try:
            return make()
        except AxisbusError as error:  # raised by the user's own kinematics
            raise prefixed(self._text, error) from error
        except ValueError as error:
            raise LimitError(
                f"{self._text}: the path leaves the reach of the machine",
                observed=str(error),
                remedy="choose another path: within the reach of the arms, and farther from positions with stretched or "
                "folded arms",
            ) from None

    def _path(self, straight: Sequence[GeometricSegment], stops: set[int]) -> MovePath:
        segments: Sequence[PathSegment] = straight
        if isinstance(self._kinematics, UserKinematicsAdapter):
            segments = self._sampled(straight, stops, self._kinematics)
        elif self._kinematics is not None:
            segments = self._kinematic_segments(straight, self._kinematics)
        limits = [axis.limits for axis in self._axes.values()]
        period = next(iter(self._axes.values())).scan_period
        plan = partial(
            build_path, segments, limits, self._acceleration, stops, CycleVelocity(self._velocity, period)
        )
        path = plan()
        hardest = max(path.ramps)
        cycles = window(hardest, self._jerk, period, self._text)
        if self._jerk is not None and len(path.max_speeds) > 1:
            self._require_no_corner(straight)
            path = plan(JerkLimit(self._jerk, cycles * period, hardest, MAX_OVERRIDE * self._velocity))
        require_end(path, self._velocity, self._text)
        waits = self._buffer is BufferMode.BUFFERED
        return MovePath(tuple(self._axes), path, self._velocity, cycles, waits, self._takeover)

    def _require_no_corner(self, segments: Sequence[GeometricSegment]) -> None:
        """Raise ArgumentError for corners by the user's own kinematics: the curvature between their samples is unknown."""
        if isinstance(self._kinematics, UserKinematicsAdapter) and any(
            isinstance(segment, Corner) for segment in segments
        ):
            raise ArgumentError(
                f"{self._text}: jerk cannot be limited along this path",
                observed=f"it has corners, and its set-points are samples of {self._kinematics.name}",
                remedy="let it stop at its points (blend=0); or leave jerk out, and give less acceleration",
            )
