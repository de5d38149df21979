"""The public group of axes: lines, paths, circles, trajectories and streams of several axes."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from axisbus.errors import ArgumentError, LimitError, StateError
from axisbus.machine.axis import Axis
from axisbus.machine.axis_set import AxisSet
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.handle import Handle
from axisbus.machine.paths import PathRequest, blend_of, one_each
from axisbus.machine.request import buffering_of, flag_of, items_of, shown
from axisbus.machine.streaming.options import options_of
from axisbus.machine.streaming.points import PointStream
from axisbus.machine.streaming.timed import follow_points
from axisbus.machine.user_kinematics.kinematics import UserKinematics, UserKinematicsAdapter, kinematics_for
from axisbus.motion import commands as c
from axisbus.motion.blending.mode import BufferMode
from axisbus.motion.group.commands import (
    ForEach,
    GroupContinue,
    MoveLinear,
    MovePath,
)
from axisbus.motion.group.kinematics import Kinematics
from axisbus.motion.group.segments import Coordinates
from axisbus.motion.numbers import items, number, short_repr
from axisbus.motion.point_stream.timed import TrajectoryPoint
from axisbus.session import Target
from axisbus.wording import counted

_MAX_STORED = 256  # the number of commands with a stored end: more cannot be active
_REFUSALS = (ArgumentError, LimitError, StateError)  # errors of a command that has moved nothing


class _Path(NamedTuple):
    """Parameters of the last path, the defaults for points that are added to it."""

    velocity: float
    acceleration: float | None
    blend: float


class Group(AxisSet):
    """Axes that are enabled, halted, stopped and started in one SYNC; each command returns one ``Handle`` for all axes.

    "In one SYNC" applies to drives with synchronous RPDOs; ``axisbus boot`` reports which drives these are.
    """

    def __init__(
        self,
        name: str,
        axes: Mapping[str, Axis],
        commanding: CommandDispatcher,
        key: Target | None = None,
        kinematics: Kinematics | UserKinematicsAdapter | None = None,
    ) -> None:
        """``key``: the core's key of the group, if it is not its name. ``kinematics``: see ``with_kinematics``."""
        super().__init__(name, axes, commanding, key)
        self._kinematics = kinematics
        self._path: _Path | None = None  # the last path, for points that are added to it
        # Each motion of the group and its end position; None: not known yet.
        self._ends_at: deque[tuple[Handle, Coordinates | None]] = deque(maxlen=_MAX_STORED)

    def with_kinematics(
        self, kinematics: Kinematics | UserKinematics, *, accuracy: float | None = None
    ) -> Group:
        """Return the group of the same axes with lines, paths and circles in a workspace, in the units of the workspace.

        ``kinematics`` takes the axes in their order. Velocity, acceleration and blend are then those in the workspace; the limits
        of each axis still apply. Everything else is unchanged: ``move_direct`` takes positions of the axes.

        ``CoreXY``, ``Scara`` and ``Delta`` run in the core. The user's own kinematics (``UserKinematics``) are called only in this
        program. They sample each path before it begins, which blocks. The samples are so fine that the tool stays within
        ``accuracy`` of the path (units of the workspace; by default the distance by which one increment of an axis moves the tool).

        Raises:
            ArgumentError: they have no ``forward`` and ``inverse``, or ``accuracy`` is not a distance above 0.
        """
        made = kinematics_for(f"{self.name}.with_kinematics", kinematics, self._axes, accuracy)
        return Group(self.name, self._axes, self._commanding, self._key, made)

    def enable(self) -> Handle:
        """Switch all power stages on when all axes are at standstill; all drives make the last transition together."""
        return self._all("enable()", c.EnableCommand, together=True)

    def move_linear(
        self,
        positions: Sequence[float],
        *,
        velocity: float,
        acceleration: float | None = None,
        jerk: float | None = None,
        buffer: bool | str = False,
        blend: float = 0.0,
    ) -> Handle:
        """Move all axes on a straight line to ``positions`` (in the group's order of axes) in cyclic synchronous position mode.

        ``velocity`` (unit/s) and ``acceleration`` (unit/s², by default the smallest of the defaults) refer to the path: the
        Euclidean length over all axes. If an axis would exceed its own limits, all axes are slower. ``jerk`` (unit/s³) limits
        the change of the acceleration along the path, also in a halt and under an override; None: no limit. With ``buffer``
        (True, or ``"buffered"``) the line begins when the group's present command has ended successfully, from its end; at most
        100 commands are queued.

        With ``"blending_low"``, ``"blending_previous"``, ``"blending_next"`` or ``"blending_high"`` (PLCopen's BufferMode) the line
        continues from the active line or path without a stop. The corner passes within ``blend`` of the transition point (units; a
        group of one axis needs none). Its velocity is the lowest of the two, that of the previous line, that of this line, or the
        highest, as far as the axes' limits allow. If the path reverses, or if the command comes too late for a corner, the axes
        stop at the transition point. The handle of the previous line is done when the transition point has been passed. If no
        command is active, the line begins at once.

        Raises:
            LimitError: an end is beyond an axis's position limits.
            ArgumentError: a value is missing, not finite or not positive; or blending is impossible: with ``jerk``, in a workspace.
        """
        name = f"move_linear({_list(positions)}, velocity={shown(velocity)})"
        mode = buffering_of(f"{self.name}.{name}", buffer)
        if self._kinematics is not None:
            self._blend(name, blend, mode, jerk)
            request = self._request(name, "move_linear", velocity, acceleration, jerk, mode)
            return self._move(name, request.along([positions]))
        ends = self._ends(name, positions)
        self._path = _Path(velocity, acceleration, blend)
        if mode is not None and mode.blends:
            corner_distance = self._blend(name, blend, mode, jerk)
            request = self._request(
                name, "move_linear", velocity, acceleration, None, mode, blend=corner_distance
            )
            return self._move(name, request.along([positions]))
        line = MoveLinear(ends, *self._dynamics(name, velocity, acceleration, jerk), mode is not None)
        return self._move(name, line, tuple(ends.values()))

    def move_path(
        self,
        points: Sequence[Sequence[float]],
        *,
        velocity: float,
        acceleration: float | None = None,
        jerk: float | None = None,
        blend: float = 0.0,
        buffer: bool | str = False,
        more: bool = False,
    ) -> Handle:
        """Move all axes on straight lines through ``points`` (positions in the group's order), to the last one (MC_MovePath).

        Each corner is rounded so that the path comes within ``blend`` (units, Euclidean) of it. The rounding is smaller if a line
        is too short; with 0 the axes stop at the corner. ``velocity`` and ``acceleration`` as ``move_linear``; corners keep the
        velocity as far as the axes' velocities and accelerations allow. ``jerk`` (unit/s³) limits the change of the acceleration
        along the path and across it (Euclidean), and makes corners slower; None: no limit. At most 1000 points. ``buffer`` as
        ``move_linear``. With ``more`` half of the last line is reserved for the corner to points added later (``extend_path``);
        this excludes ``jerk``.

        Raises:
            LimitError: a point is beyond an axis's position limits.
            ArgumentError: a value is missing, not finite or not positive, or an axis is endless; or blending or adding is
                impossible with ``jerk``; the user's own kinematics allow no ``jerk`` in corners.
            StaleError: the position of an axis is unknown.
        """
        points = items_of(f"{self.name}.move_path", "points", points)
        is_extendable = flag_of(f"{self.name}.move_path", "more", more)
        text = f"move_path({counted(len(points), 'point')}, velocity={shown(velocity)}, blend={shown(blend)})"
        mode = buffering_of(f"{self.name}.{text}", buffer)
        corner_distance = self._blend(text, blend, mode, jerk)
        if is_extendable and jerk is not None:
            raise ArgumentError(
                f"{self.name}.{text}: with a jerk limit no points can be added to a path",
                remedy="give all points at once, without more=True; or leave jerk out",
            )
        request = self._request(
            text,
            "move_path",
            velocity,
            acceleration,
            jerk,
            mode,
            blend=corner_distance,
            more=is_extendable or _blends(mode),
        )
        handle = self._move(text, request.along(points))
        self._path = _Path(velocity, acceleration, corner_distance)
        return handle

    def extend_path(
        self,
        points: Sequence[Sequence[float]],
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        blend: float | None = None,
    ) -> Handle:
        """Add ``points`` at the end of the active path; the handle is done when the last of them has been reached.

        Points that come in time are planned together with the rest of the path: the velocity is kept through the new corner as
        well. If no more points come, the axes come to rest at the last point, on the path. They continue from there if more
        points come before the handle of the path has ended. If ``velocity``, ``acceleration`` or ``blend`` are left out, the
        values of the last ``move_path`` of this object apply. At a corner between two velocities the lower one applies. At most
        1000 points in a call; at most 100 calls with 2000 lines and corners may be ahead of the axes. The handles of the path,
        and of earlier additions, are done when their ends are passed. A halt, a stop or a fault ends all of them, and
        ``resume`` continues to the end of all.

        If the path has ended, or too much is ahead, the handle ends with a StateError. Raises as ``move_path``.
        """
        points = items_of(f"{self.name}.extend_path", "points", points)
        text = f"extend_path({counted(len(points), 'point')})"
        last = self._path
        if last is None:
            raise ArgumentError(
                f"{self.name}.{text}: there is no path to which points could be added",
                remedy="begin one: group.move_path(points, velocity=..., blend=..., more=True)",
            )
        mode = BufferMode.LOW
        speed = last.velocity if velocity is None else velocity
        ramp = last.acceleration if acceleration is None else acceleration
        corner_distance = self._blend(text, last.blend if blend is None else blend, mode)
        request = self._request(
            text, "extend_path", speed, ramp, None, mode, blend=corner_distance, extends=True
        )
        handle = self._move(text, request.along(points))
        self._path = _Path(speed, ramp, corner_distance)
        return handle

    def move_circular(
        self,
        end: Sequence[float],
        *,
        via: Sequence[float] | None = None,
        centre: Sequence[float] | None = None,
        clockwise: bool = False,
        velocity: float,
        acceleration: float | None = None,
        jerk: float | None = None,
        buffer: bool | str = False,
    ) -> Handle:
        """Move all axes on an arc to ``end``, through ``via`` or about ``centre`` (MC_MoveCircularAbsolute, BORDER and CENTER).

        About a centre, for two axes: counter-clockwise from the first axis to the second, or ``clockwise``; a full circle if
        ``end`` is the present position. ``velocity``, ``acceleration`` and ``jerk`` (along the path) as ``move_linear``; the motion
        is slower if the curvature demands it. ``buffer`` as ``move_linear``, without blending.

        Raises:
            LimitError: the arc leaves an axis's position limits.
            ArgumentError: a value is missing, not finite or not positive, the points define no circle, or an axis is endless.
            StaleError: the position of an axis is unknown.
        """
        turns_back = flag_of(f"{self.name}.move_circular", "clockwise", clockwise)
        text = f"move_circular({_list(end)}, velocity={shown(velocity)})"
        if (via is None) is (centre is None):
            raise ArgumentError(
                f"{self.name}.{text}: exactly one of via and centre must define the circle",
                remedy="give via = a point that the circle goes through, or centre = its centre",
            )
        mode = buffering_of(f"{self.name}.{text}", buffer)
        if _blends(mode):
            raise ArgumentError(
                f"{self.name}.{text}: a circle cannot be blended with the path before it",
                remedy='let it begin at standstill: buffer="buffered"',
            )
        request = self._request(text, "move_circular", velocity, acceleration, jerk, mode)
        if centre is not None:
            return self._move(text, request.about(centre, end, clockwise=turns_back))
        assert via is not None
        return self._move(text, request.through(via, end))

    @property
    def tool_position(self) -> Coordinates:
        """The positions of the axes; with kinematics, the position of the tool in the workspace.

        Raises:
            StaleError: a position is unknown.
            LimitError: the axes' positions give no position in the workspace: for instance, arms do not meet.
        """
        axes = tuple(axis.unwrapped_position for axis in self._axes.values())
        if self._kinematics is None:
            return axes
        try:
            return self._kinematics.forward(axes)
        except ValueError as error:
            raise LimitError(
                f"{self.name}: the positions of the axes have no pose in the workspace: {error}",
                observed=f"axis positions: {_list(axes)}",
                remedy="compare homing and the lengths in cell.toml with the machine; move its axes one by one",
            ) from None

    def resume(self) -> Handle:
        """Continue the group's last interrupted line, path, circle or stream, to its end (MC_GroupContinue).

        The end of a stream is its last accepted point; to push more points, see ``PointStream.resume``. The motion continues from
        the position of the interruption: a halt, a stop that was released, or an error that was reset. Every axis must still be
        there, within ``position_window`` (a tenth of ``standstill_window`` if that is unknown). Otherwise the handle ends with a
        StateError, because an axis was moved meanwhile or has left the path in a stop of the drive's own.
        """
        ends = [end for handle, end in self._ends_at if not isinstance(handle.error, _REFUSALS)]
        handle = self._submit("resume()", GroupContinue(tuple(self._axes)))
        if ends:
            self._ends_at.append((handle, ends[-1]))  # so that points can be added after it
        return handle

    def stream(
        self,
        *,
        period: float | str | None = None,
        on_underrun: str = "hold",
        buffer: float | str = "250ms",
    ) -> PointStream:
        """Follow points that this program gives at its own pace, in cyclic synchronous position mode, on a smooth curve.

        ``with xy.stream(period="10ms") as points: points.push((x, y))``: one point every ``period`` (seconds, or a time with its
        unit). Without ``period`` each point begins with its time. The first point is the present position of the axes. The axes
        begin when ``buffer`` (same form) plus the braking time is ahead; then ``push`` blocks. If no point comes in time, the axes
        brake together along the points that exist. With ``on_underrun="hold"`` they continue when there are more points; with
        ``"error"`` the stream ends. With kinematics the points are positions in the workspace; ``push`` calls the user's own
        kinematics.

        Raises:
            ArgumentError: a value that a stream cannot have, an axis is endless, or an axis has no known braking deceleration.
            StaleError: the position of an axis is unknown.
        """
        text = f"{self.name}.stream"
        kinematics = self._kinematics
        options = options_of(
            self._axes, text, period, on_underrun, buffer, in_workspace=kinematics is not None
        )
        made = PointStream(self._axes, self._commanding, self._key, text, options, self.halt, kinematics)
        self._ends_at.append((made.handle, None))
        return made

    def follow(self, points: Sequence[TrajectoryPoint]) -> Handle:
        """Reach ``points`` at their times (s, from the common start), in cyclic synchronous position mode; from rest to rest.

        ``TrajectoryPoint(time, positions, velocities, accelerations)``: in the group's order of axes, and positions of the axes
        also with kinematics. All points have velocities (unit/s), or velocities and accelerations (unit/s²), or neither. The path
        between two points is the polynomial of degree three or five with these values; with positions alone no axis overshoots the
        two points. The first point is the present position of the axes, or has a time later than 0: the axes then move to it from
        their commanded position. At most 4000 points. Positions of an endless axis are not wrapped at the modulo.

        The whole trajectory is checked against the limits before anything moves; it may use four fifths of ``max_acceleration``.
        The check blocks for less than 0.1 ms for each point and axis. The core then has the whole trajectory. A halt brakes along
        it, and ``resume`` continues; an override slows it.

        Raises:
            LimitError: it goes beyond an axis's ``position_limits``, ``max_velocity`` or ``max_acceleration``.
            ArgumentError: there are no points, their times do not rise, they do not begin and end at rest, or an axis has no known
                braking deceleration. StateError: the axes are not at the first point. StaleError: the position of an axis is
                unknown.
        """
        handle = follow_points(self._axes, self._commanding, self._key, self.name, points)
        self._ends_at.append((handle, None))
        return handle

    def move_direct(self, positions: Sequence[float], *, velocity: float | None = None) -> Handle:
        """Move each axis to its position by its own profile (profile position mode); all axes start in the same cycle.

        ``velocity`` (unit/s) replaces each axis's default. If an axis that has reached its position gets another command before the
        others have reached theirs, the handle ends as interrupted. Raises as ``Axis.move_absolute``.
        """
        name = f"move_direct({_list(positions)})"
        self._ends(name, positions)
        moves = {
            axis.name: axis._absolute_command(name, value, velocity)
            for axis, value in zip(self._axes.values(), positions, strict=True)
        }
        return self._submit(name, ForEach(moves, together=True))

    def _request(
        self,
        text: str,
        call: str,
        velocity: float,
        acceleration: float | None,
        jerk: float | None,
        mode: BufferMode | None,
        *,
        blend: float = 0.0,
        more: bool = False,
        extends: bool = False,
    ) -> PathRequest:
        dynamics = self._dynamics(text, velocity, acceleration, jerk)
        after = None if mode is None else self._end_of_all
        name, kinematics = f"{self.name}.{text}", self._kinematics
        return PathRequest(
            self._axes,
            name,
            call,
            *dynamics,
            after=after,
            buffer=mode,
            blend=blend,
            more=more,
            extends=extends,
            kinematics=kinematics,
        )

    def _blend(self, text: str, blend: float, mode: BufferMode | None, jerk: float | None = None) -> float:
        """Return the corner distance ``blend``, checked: raise ArgumentError if the group cannot blend."""
        corner_distance = blend_of(f"{self.name}.{text}", blend, mode, len(self._axes))
        if _blends(mode) and (jerk is not None or self._kinematics is not None):
            why = "in a workspace" if jerk is None else "with a jerk limit"
            raise ArgumentError(
                f"{self.name}.{text}: {why} the axes must stop at each corner",
                remedy='let it begin at standstill: buffer="buffered"'
                + ("; or give all points to one move_path" if jerk is None else "; or leave jerk out"),
            )
        return corner_distance

    @property
    def _end_of_all(self) -> Coordinates | None:
        """The end position of the last active or queued motion, None if there is none; refused motions do not count."""
        return next((end for handle, end in reversed(self._ends_at) if handle.busy), None)

    def _move(self, name: str, command: MoveLinear | MovePath, end: Coordinates | None = None) -> Handle:
        """Submit a command that moves all axes, and store its end position, where a buffered command begins."""
        if end is None and isinstance(command, MovePath):
            end = command.path.at(command.path.length)
        handle = self._submit(name, command)
        if end is not None:
            self._ends_at.append((handle, end))
        return handle

    def _dynamics(
        self, name: str, velocity: float, acceleration: float | None, jerk: float | None
    ) -> tuple[float, float, float | None]:
        """Return velocity, acceleration (by default the smallest of the axes) and jerk of a path, checked."""
        speed = self._positive(name, "velocity", velocity)
        known = self._smallest_acceleration(name) if acceleration is None else acceleration
        ramp = self._positive(name, "acceleration", known)
        return speed, ramp, None if jerk is None else self._positive(name, "jerk", jerk)

    def _ends(self, name: str, positions: Sequence[float]) -> dict[str, float]:
        given = one_each(self._axes, f"{self.name}.{name}:", positions)
        return {
            axis.name: axis._absolute_position(name, value)
            for axis, value in zip(self._axes.values(), given, strict=True)
        }

    def _smallest_acceleration(self, name: str) -> float:
        if self._kinematics is not None:
            raise ArgumentError(
                f"{self.name}.{name}: acceleration is missing",
                observed="in a workspace, the default accelerations of the axes do not apply",
                remedy="give acceleration = ... in the call, in units of the workspace per s²",
            )
        known = [axis.default_acceleration for axis in self._axes.values()]
        if any(value is None for value in known):
            missing = [axis.name for axis in self._axes.values() if axis.default_acceleration is None]
            raise ArgumentError(
                f"{self.name}.{name}: acceleration is missing",
                observed=f"the call does not give it, and {missing[0]} has no default",
                remedy=f"give acceleration = ... in the call, or acceleration in [axes.{missing[0]}.defaults]",
            )
        return min(value for value in known if value is not None)

    def _positive(self, name: str, what: str, value: float) -> float:
        magnitude = number(value)
        if magnitude is None or magnitude <= 0:
            raise LimitError(
                f"{self.name}.{name}: {what} {short_repr(value)} must be a finite number above 0",
                remedy=f"give the {what} of the path, a magnitude in the axes' unit",
            )
        return magnitude


def _blends(mode: BufferMode | None) -> bool:
    return mode is not None and mode.blends


def _list(values: object) -> str:
    found = items(values)
    return short_repr(values) if found is None else ", ".join(shown(value) for value in found)
