"""A group of axes as its user sees it."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from axisbus.errors import ArgumentError, LimitError, StateError
from axisbus.machine.axis import Axis
from axisbus.machine.axis_set.axis_set import AxisSet
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
from axisbus.motion.group.segments import Place
from axisbus.motion.numbers import items, number, told
from axisbus.motion.point_stream.timed import TrajectoryPoint
from axisbus.session import Target
from axisbus.wording import counted

_KEPT = 256  # commands of which the ends are kept: more cannot be under way
_REFUSALS = (ArgumentError, LimitError, StateError)  # of a command that has moved nothing


class _Path(NamedTuple):
    """What was asked for of a path, and holds for what is added to it."""

    velocity: float
    acceleration: float | None
    blend: float


class Group(AxisSet):
    """Axes that are enabled, halted, stopped and started in one SYNC; each command returns one ``Handle`` for all.

    "In one SYNC" holds for drives whose RPDOs are synchronous; ``axisbus boot`` says which are.
    """

    def __init__(
        self,
        name: str,
        axes: Mapping[str, Axis],
        commanding: CommandDispatcher,
        key: Target | None = None,
        kinematics: Kinematics | UserKinematicsAdapter | None = None,
    ) -> None:
        """``key``: by what the core knows it, where that is not its name. ``kinematics``: see ``with_kinematics``."""
        super().__init__(name, axes, commanding, key)
        self._kinematics = kinematics
        self._path: _Path | None = None  # the last one, for what is added to it
        # What moves all, and where it ends; None: nobody knows yet.
        self._ends_at: deque[tuple[Handle, Place | None]] = deque(maxlen=_KEPT)

    def with_kinematics(
        self, kinematics: Kinematics | UserKinematics, *, accuracy: float | None = None
    ) -> Group:
        """Return the group of the same axes with lines, paths and circles through places of a workspace, in its units.

        ``kinematics`` takes its axes in their order. Velocity, acceleration and blend are then those in the workspace, and each
        axis's limits hold all the same. All else is as it is: ``move_direct`` takes positions of the axes.

        ``CoreXY``, ``Scara`` and ``Delta`` run in the core. Kinematics of your own (``UserKinematics``) are called in this program
        alone: each way is sampled by them before it begins, which blocks, so finely that the tool stays within ``accuracy`` (units
        of the workspace; by default what one increment of an axis moves it by) of it.

        Raises:
            ArgumentError: they have no ``forward`` and ``inverse``, or ``accuracy`` is no distance above 0.
        """
        made = kinematics_for(f"{self.name}.with_kinematics", kinematics, self._axes, accuracy)
        return Group(self.name, self._axes, self._commanding, self._key, made)

    def enable(self) -> Handle:
        """Switch all power stages on, once all axes stand; the last transition is taken by all together."""
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
        """Move all on a straight line to ``positions`` (in the group's order of axes) in cyclic synchronous position mode.

        ``velocity`` (unit/s) and ``acceleration`` (unit/s², by default the smallest of the defaults) are those of the path: the
        Euclidean length over all axes. Axes that would be asked for more than their own limits slow all down. ``jerk``
        (unit/s³): the acceleration along the path changes by no more, also in a halt and under an override; None: at once. With
        ``buffer`` (True, or ``"buffered"``) it begins when what the group does has ended well, from where that ends; at most 100
        commands wait.

        With ``"blending_low"``, ``"blending_previous"``, ``"blending_next"`` or ``"blending_high"`` (PLCopen's BufferMode) it goes
        on from the line or path under way without a stop. The corner comes within ``blend`` (units; one axis alone needs none) of
        the joint, and is passed with the lowest velocity of both, that of the one before, that of this one, or the highest, as far
        as the axes' limits allow. Where the way turns back, and where it comes too late for a corner, the axes stop at the joint.
        The handle of the one before is done when the joint has been passed. With nothing under way it begins at once.

        Raises:
            LimitError: an end lies beyond an axis's position limits.
            ArgumentError: a value is missing, not finite or not positive; or it cannot blend: with ``jerk``, in a workspace.
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
            wide = self._blend(name, blend, mode, jerk)
            request = self._request(name, "move_linear", velocity, acceleration, None, mode, blend=wide)
            return self._move(name, request.along([positions]))
        line = MoveLinear(ends, *self._pace(name, velocity, acceleration, jerk), mode is not None)
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
        """Move all on straight lines through ``points`` (positions in the group's order of axes), to the last one (MC_MovePath).

        Each corner is rounded so that the path comes within ``blend`` (units, Euclidean) of it, and less where a line is too short
        for that; with 0 the axes stop there. ``velocity`` and ``acceleration`` as ``move_linear``; the velocity is kept through
        corners as far as the axes' velocities and accelerations allow. ``jerk`` (unit/s³): so much does the acceleration change at
        most, along the path and across it (Euclidean), and corners are slower for it; None: at once. At most 1000 points.
        ``buffer`` as ``move_linear``. With ``more`` half of the last line is kept for the corner of what is added to it
        (``extend_path``); that cannot be had with ``jerk``.

        Raises:
            LimitError: a point lies beyond an axis's position limits.
            ArgumentError: a value is missing, not finite or not positive, or an axis is endless; or it cannot blend or be added
                to with ``jerk``, of which there is none in corners by kinematics of the program's own.
            StaleError: where an axis stands is not known.
        """
        points = items_of(f"{self.name}.move_path", "points", points)
        goes_on = flag_of(f"{self.name}.move_path", "more", more)
        text = f"move_path({counted(len(points), 'point')}, velocity={shown(velocity)}, blend={shown(blend)})"
        mode = buffering_of(f"{self.name}.{text}", buffer)
        wide = self._blend(text, blend, mode, jerk)
        if goes_on and jerk is not None:
            raise ArgumentError(
                f"{self.name}.{text}: with a limit of jerk nothing can be added to a path",
                remedy="leave more out, and give all points at once; or leave jerk out",
            )
        request = self._request(
            text, "move_path", velocity, acceleration, jerk, mode, blend=wide, more=goes_on or _blends(mode)
        )
        handle = self._move(text, request.along(points))
        self._path = _Path(velocity, acceleration, wide)
        return handle

    def extend_path(
        self,
        points: Sequence[Sequence[float]],
        *,
        velocity: float | None = None,
        acceleration: float | None = None,
        blend: float | None = None,
    ) -> Handle:
        """Add ``points`` to the path that is under way, from its end on; the handle is done when the last of them has been reached.

        What comes in time is looked at together with what is ahead already: the velocity is kept through the new corner as well.
        Where no more comes, the axes come to rest at the last point, on the path, and go on from there if more comes before its
        handle has ended. ``velocity``, ``acceleration`` and ``blend`` are those of the last ``move_path`` of this object where they
        are left out; of two velocities the corner is passed with the lower one. At most 1000 points in a call; what is ahead may
        be 100 calls with 2000 lines and corners. The handles of the path, and of what was added before, are done as their ends are
        passed. A halt, a stop or a fault ends all of them, and ``resume`` goes on to the end of all.

        The handle ends with a StateError where the path has ended, or too much is ahead. Raises as ``move_path``.
        """
        points = items_of(f"{self.name}.extend_path", "points", points)
        text = f"extend_path({counted(len(points), 'point')})"
        last = self._path
        if last is None:
            raise ArgumentError(
                f"{self.name}.{text}: no path was begun to which points could be added",
                remedy="begin one: group.move_path(points, velocity=..., blend=..., more=True)",
            )
        mode = BufferMode.LOW
        speed = last.velocity if velocity is None else velocity
        ramp = last.acceleration if acceleration is None else acceleration
        wide = self._blend(text, last.blend if blend is None else blend, mode)
        request = self._request(text, "extend_path", speed, ramp, None, mode, blend=wide, extends=True)
        handle = self._move(text, request.along(points))
        self._path = _Path(speed, ramp, wide)
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
        """Move all on an arc to ``end``, by the point ``via`` or about ``centre`` (MC_MoveCircularAbsolute, BORDER and CENTER).

        About a centre, for two axes: counter-clockwise as the first axis turns to the second, or ``clockwise``; once round where
        ``end`` is where they stand. ``velocity``, ``acceleration`` and ``jerk`` (that of the speed along it) as ``move_linear``;
        the circle is slower where its curvature asks for it. ``buffer`` as ``move_linear``, without blending.

        Raises:
            LimitError: the arc leaves an axis's position limits.
            ArgumentError: a value is missing, not finite or not positive, the points make no circle, or an axis is endless.
            StaleError: where an axis stands is not known.
        """
        turns_back = flag_of(f"{self.name}.move_circular", "clockwise", clockwise)
        text = f"move_circular({_list(end)}, velocity={shown(velocity)})"
        if (via is None) is (centre is None):
            raise ArgumentError(
                f"{self.name}.{text}: one of via and centre says which circle it is",
                remedy="give via = a point that the circle goes through, or centre = its centre",
            )
        mode = buffering_of(f"{self.name}.{text}", buffer)
        if _blends(mode):
            raise ArgumentError(
                f"{self.name}.{text}: a circle does not go on from another way without a stop",
                remedy='let it begin from rest: buffer="buffered"',
            )
        request = self._request(text, "move_circular", velocity, acceleration, jerk, mode)
        if centre is not None:
            return self._move(text, request.about(centre, end, clockwise=turns_back))
        assert via is not None
        return self._move(text, request.through(via, end))

    @property
    def tool_position(self) -> Place:
        """Where its axes are: their positions, with kinematics the place in the workspace.

        Raises:
            StaleError: a position is unknown.
            LimitError: the axes' positions give no place in the workspace: for instance, arms do not meet.
        """
        axes = tuple(axis.unwrapped_position for axis in self._axes.values())
        if self._kinematics is None:
            return axes
        try:
            return self._kinematics.forward(axes)
        except ValueError as error:
            raise LimitError(
                f"{self.name}: the axes' positions give no place in the workspace: {error}",
                observed=f"axis positions: {_list(axes)}",
                remedy="compare homing and the lengths in cell.toml with the machine; move its axes one by one",
            ) from None

    def resume(self) -> Handle:
        """Go on along the group's last line, path, circle or stream, which was broken off, to its end (MC_GroupContinue).

        Of a stream, that is the last point that was taken; to push more, see ``PointStream.resume``. From where it was left: after
        a halt, a stop that was released, or an error that was reset. Every axis must still be there, within ``position_window`` (a
        tenth of ``standstill_window`` where that is not known), else the handle ends with a StateError: nothing goes on with what
        was moved meanwhile, or has left its way by a stop of the drive's own.
        """
        left = [end for handle, end in self._ends_at if not isinstance(handle.error, _REFUSALS)]
        handle = self._submit("resume()", GroupContinue(tuple(self._axes)))
        if left:
            self._ends_at.append((handle, left[-1]))  # so that points can be added behind it
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
        unit); without it each point begins with its time. The first point is where the axes stand. They begin when as
        much as ``buffer`` (the same) and what braking takes is ahead; then ``push`` blocks. Where no point comes in time, they
        brake along those that there are, together: with ``on_underrun="hold"`` they go on when there are more, with ``"error"``
        the stream ends. With kinematics the points are places of the workspace; those of this program's own are called by ``push``.

        Raises:
            ArgumentError: a value is none that a stream can have, an axis is endless, or nothing says how it is braked.
            StaleError: where an axis stands is not known.
        """
        text = f"{self.name}.stream"
        places = self._kinematics
        options = options_of(self._axes, text, period, on_underrun, buffer, places=places is not None)
        made = PointStream(self._axes, self._commanding, self._key, text, options, self.halt, places)
        self._ends_at.append((made.handle, None))
        return made

    def follow(self, points: Sequence[TrajectoryPoint]) -> Handle:
        """Be at ``points`` at their times (s, from when all begin), in cyclic synchronous position mode; from rest to rest.

        ``TrajectoryPoint(time, positions, velocities, accelerations)``: in the group's order of axes, of its axes also with
        kinematics; all points have velocities (unit/s), or velocities and accelerations (unit/s²), or neither. Between two points
        goes the polynomial of degree three or five that has them; with positions alone no axis goes beyond two points. The first
        point is where the axes stand, or later than 0: they come to it from where they are led to. At most 4000 points; those of an
        endless axis are as far as it has turned in all.

        All of it is held against the limits before anything moves: of ``max_acceleration`` a trajectory may use four fifths. That
        takes less than 0.1 ms for each point and axis, and so long does it block. The core then knows it up to its end. A halt
        brakes along it, and ``resume`` goes on; an override slows it.

        Raises:
            LimitError: it goes beyond an axis's ``position_limits``, ``max_velocity`` or ``max_acceleration``.
            ArgumentError: the points are none, do not rise in time, do not begin and end at rest, or nothing says how an axis is
                braked. StateError: the axes do not stand at the first. StaleError: where an axis stands is not known.
        """
        handle = follow_points(self._axes, self._commanding, self._key, self.name, points)
        self._ends_at.append((handle, None))
        return handle

    def move_direct(self, positions: Sequence[float], *, velocity: float | None = None) -> Handle:
        """Move each axis to its position by its own profile (profile position mode); all start in the same cycle.

        ``velocity`` (unit/s) replaces each axis's default. If an axis that has come to its position gets another command before the
        others have come to theirs, the handle ends as interrupted. Raises as ``Axis.move_absolute``.
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
        pace = self._pace(text, velocity, acceleration, jerk)
        after = None if mode is None else self._end_of_all
        name, kinematics = f"{self.name}.{text}", self._kinematics
        return PathRequest(
            self._axes,
            name,
            call,
            *pace,
            after=after,
            buffer=mode,
            blend=blend,
            more=more,
            extends=extends,
            kinematics=kinematics,
        )

    def _blend(self, text: str, blend: float, mode: BufferMode | None, jerk: float | None = None) -> float:
        """Return how far corners are cut, where the group can do so."""
        wide = blend_of(f"{self.name}.{text}", blend, mode, len(self._axes))
        if _blends(mode) and (jerk is not None or self._kinematics is not None):
            why = "in a workspace" if jerk is None else "with a limit of jerk"
            raise ArgumentError(
                f"{self.name}.{text}: {why} no corner is passed without a stop",
                remedy='let it begin from rest: buffer="buffered"'
                + ("; or give all points to one move_path" if jerk is None else "; or leave jerk out"),
            )
        return wide

    @property
    def _end_of_all(self) -> Place | None:
        """Where what is under way ends, with all that goes on from it; what was refused is none of it."""
        return next((end for handle, end in reversed(self._ends_at) if handle.busy), None)

    def _move(self, name: str, command: MoveLinear | MovePath, end: Place | None = None) -> Handle:
        """Give a command that moves all, and note where it ends: what waits for it begins there."""
        if end is None and isinstance(command, MovePath):
            end = command.way.at(command.way.length)
        handle = self._submit(name, command)
        if end is not None:
            self._ends_at.append((handle, end))
        return handle

    def _pace(
        self, name: str, velocity: float, acceleration: float | None, jerk: float | None
    ) -> tuple[float, float, float | None]:
        """Return velocity, acceleration (by default the smallest of the axes) and jerk of a way, checked."""
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
                observed="in a workspace the defaults of its axes tell none",
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
                f"{self.name}.{name}: {what} {told(value)} must be a finite number above 0",
                remedy=f"give the {what} of the path, a magnitude in the axes' unit",
            )
        return magnitude


def _blends(mode: BufferMode | None) -> bool:
    return mode is not None and mode.blends


def _list(values: object) -> str:
    found = items(values)
    return told(values) if found is None else ", ".join(shown(value) for value in found)
