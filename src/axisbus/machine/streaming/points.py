"""A stream of points that a program gives at its own pace, and that its axes follow.

Theory of operation
-------------------
This module makes splines from the points (``motion.point_stream.curve_fit``). It sends each spline to the core as soon as it is
known, as a command of its own. That command ends when the axes reach the end of the spline, so the program knows how much of the
stream is ahead of the axes. The core begins when this module reports that enough is ahead. It moves the axes along the splines
that it has, and brings them to rest at the end of these whatever happens to the program.
"""

from __future__ import annotations

import secrets
import threading
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from types import TracebackType
from typing import NamedTuple, Self

from axisbus.errors import ArgumentError, AxisbusError, LimitError, Replaced, StateError
from axisbus.machine.axis import Axis
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.handle import Handle, end_with, timeout_seconds
from axisbus.machine.streaming.options import StreamOptions, require_apart
from axisbus.machine.user_kinematics.kinematics import UserKinematicsAdapter, prefixed
from axisbus.machine.user_kinematics.point_solver import (
    UserKinematicsSolver,
    WorkspaceCurveFit,
    WorkspaceSolver,
    point_error,
)
from axisbus.motion.command_status import Status
from axisbus.motion.group.commands import GroupContinue
from axisbus.motion.group.kinematics import Kinematics
from axisbus.motion.group.segments import Coordinates
from axisbus.motion.numbers import number, short_repr
from axisbus.motion.point_stream.commands import AddPoints, FollowPoints, StreamSegment
from axisbus.motion.point_stream.curve_fit import CurveFit, IncrementalFit, StreamPoint
from axisbus.session import Target
from axisbus.wording import counted

_MOST = 2048  # maximum number of segments ahead: the core holds twice as many


class _Sent(NamedTuple):
    """Segments as they were sent to the core: the number of the first, and the seconds of the stream up to their end."""

    first: int
    segments: tuple[StreamSegment, ...]
    known: float
    begins: bool
    ends: bool


class PointStream:
    """Points that the axes of a group follow, for a ``with`` block; made by ``Group.stream``. Any thread may push.

    ``handle`` is that of the stream: done when the axes rest at the last point. If a halt, a stop or an error ends the stream
    before, the handle ends with it.
    """

    handle: Handle

    def __init__(
        self,
        axes: Mapping[str, Axis],
        commanding: CommandDispatcher,
        key: Target,
        text: str,
        options: StreamOptions,
        halt: Callable[[], Handle],
        kinematics: Kinematics | UserKinematicsAdapter | None = None,
    ) -> None:
        """``key``: the core's key of the group; ``halt`` halts it. ``kinematics``: points are positions in its workspace.

        Raises:
            StaleError: the position of an axis is unknown. ArgumentError, LimitError: exceptions of the user's own kinematics.
        """
        self._axes, self._commanding, self._key, self._text = dict(axes), commanding, key, text
        self._options, self._halt = options, halt
        self._scan = next(iter(axes.values())).scan_period
        self._number = secrets.randbits(48)
        self._lock = threading.RLock()
        self._solver = _solver_of(axes, kinematics)
        self._fit = _fit_of(axes, text, self._solver)
        self._names = _names_of(axes, text, self._solver)
        self._begin: float | None = None  # the time of the first point
        self._shifts = tuple(0.0 for _ in axes)  # for endless axes: whole turns before the first point
        self._sent = self._done = 0  # segments
        self._parts: deque[_Sent] = deque()  # the parts whose end the axes have not reached
        self._known = self._passed = self._braking = 0.0
        self._ended = False
        self._failure: AxisbusError | None = None
        command = FollowPoints(tuple(axes), self._number, options.on_underrun)
        self.handle = commanding.submit(key, command, text)

    def __repr__(self) -> str:
        return f"<PointStream {self._text}: {counted(self.count, 'point')}, {self.handle.status.value}>"

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """End the stream, and wait until the axes rest at its last point; raise the error if one has ended the stream before.

        After an exception in the block, or if the stream was interrupted, halt the axes and wait until they are at standstill. If
        the halt fails, the exception gets a note. Axes that another command has taken over are not halted.
        """
        if error is not None:
            self._halt_after(error)
            return
        try:
            self.finish().wait()
        except AxisbusError as failure:
            self._halt_after(failure)
            raise

    def _halt_after(self, error: BaseException) -> None:
        with self._lock:
            self._ended = True
            ended = self.handle.exception()
            if self.handle.done or isinstance(ended, Replaced):
                return
            halted = self._halt()
        end_with(halted, error)
        self.handle.exception()  # mark the end as read: the exception of the block says more

    # -- points ------------------------------------------------------------------------------------------------------------

    def push(self, point: Sequence[float], timeout: float = 10.0) -> None:
        """Add the next point: a position for each axis in the group's order, after its time (s) if there is no ``period``.

        Positions of an endless axis are not wrapped at the modulo. With kinematics a point is a position in the workspace, in its
        units.

        The first point is the present position of the axes. Blocks while the buffer is full, at most ``timeout`` seconds.

        Raises:
            LimitError: an axis cannot reach it within its limits. ArgumentError: it is no point, or its time is not later than the
            last. The point is then discarded, and the stream continues with the next one.
            TimeoutError: the buffer is still full; the point is discarded.
            StateError: the stream has been ended. AxisbusError: the error that ended it.
        """
        wait, limit = self._commanding.session.waiter.wait, timeout_seconds(f"{self._text}, push", timeout)
        while not self.try_push(point):
            if not wait(lambda: self._has_room or not self.handle.busy, limit):
                raise TimeoutError(
                    f"{self._text}: no room for point {self.count + 1} after {timeout:g} s; {self.buffered_seconds:.3f} s "
                    "are buffered"
                )

    def try_push(self, point: Sequence[float]) -> bool:
        """As ``push``, but never block: return False if the buffer is full; the point is then discarded."""
        with self._lock:
            self._require_open()
            stream_point = self._point(point)
            if not self._has_room:
                return False
            segments = _tuple(self._fit.take(stream_point))
            if segments:
                self._send(segments)
            return True

    def finish(self) -> Handle:
        """Bring the axes to rest at the last point; return the stream's handle. Does not block; harmless when repeated."""
        with self._lock:
            if not self._ended and self.handle.busy:
                segments = _tuple(self._fit.end())
                self._ended = True
                self._send(segments)
        return self.handle

    def resume(self) -> Handle:
        """Continue along the pushed points from the position where the axes were braked; return the new handle.

        After a halt, a stop that was released, an error that was reset, or an underrun. Points pushed during the interruption were
        refused and are not part of the stream. From now on points may be pushed again, continuing from the last accepted one. As at
        the start, the axes begin when ``buffer`` is ahead, or when the stream is ended. Every axis must still be at the position of
        the interruption, within ``position_window``; otherwise the handle ends with a StateError and nothing moves. Does not block.

        Raises:
            StateError: the stream is active, or has reached its end.
        """
        with self._lock:
            if self.handle.busy or self.handle.done:
                why = "is under way" if self.handle.busy else "has come to its end"
                raise StateError(f"{self._text}: the stream {why}, so there is nothing to continue")
            self.handle.exception()  # mark the end of the old handle as read
            self._failure = None
            command = GroupContinue(tuple(self._axes), self._number)
            self.handle = self._commanding.submit(self._key, command, f"{self._text}, resume")
            parts, self._parts = self._parts, deque()
            for part in parts:
                self._give(part._replace(begins=self._ended or not self._has_room))
        return self.handle

    @property
    def buffered_seconds(self) -> float:
        """Seconds of the stream ahead of the axes; the segment to the last point is unknown until the next point comes."""
        return max(0.0, self._known - self._passed)

    @property
    def count(self) -> int:
        """The number of accepted points."""
        return self._fit.count

    @property
    def _has_room(self) -> bool:
        waiting = self._sent - self._done
        return waiting < _MOST and self.buffered_seconds < self._options.buffer + self._braking

    # -- helpers -----------------------------------------------------------------------------------------------------------

    def _require_open(self) -> None:
        error = self.handle.exception() or self._failure
        if error is not None:
            raise error
        if self._ended or not self.handle.busy:
            raise StateError(
                f"{self._text}: the stream has ended, so it accepts no more points",
                remedy="begin a new one at the present position of the axes",
            )

    def _point(self, values: Sequence[float]) -> StreamPoint:
        text = f"{self._text}: point {self.count + 1}"
        timed = self._options.period is None
        names = ["its time", *self._names] if timed else self._names
        try:
            given = [number(value) for value in values]
        except TypeError:
            given = []
        if len(given) != len(names) or None in given:
            raise ArgumentError(
                f"{text} is invalid: {short_repr(values)}",
                observed=f"a point is {counted(len(names), 'finite number')}",
                remedy=f"give one for each of {', '.join(names)}, in this order; this point was rejected",
            )
        numbers = [value for value in given if value is not None]
        coordinates = tuple(numbers[1:] if timed else numbers)
        t = self._time(numbers[0] if timed else None, text)
        call = f"push (point {self.count + 1})"
        return StreamPoint(t, self._checked(coordinates, call, text))

    def _checked(self, coordinates: Coordinates, call: str, text: str) -> Coordinates:
        """Return a point, continued from the present turn of endless axes. The first must be the present position of the axes."""
        axes = list(self._axes.values())
        if self._solver is not None:
            for axis in axes:
                axis._require_homed(call)
            if not self.count:
                for axis, value in zip(axes, self._joints(self._solver, coordinates, text), strict=True):
                    axis._require_at_start(text, value)
            return coordinates
        for axis, value in zip(axes, coordinates, strict=True):
            if axis.modulo is None:
                axis._absolute_position(call, value)
            else:
                axis._require_homed(call)
        if not self.count:
            self._shifts = tuple(_turns(axis, value) for axis, value in zip(axes, coordinates, strict=True))
            for axis, value, shift in zip(axes, coordinates, self._shifts, strict=True):
                axis._require_at_start(text, value + shift)
        return tuple(value + shift for value, shift in zip(coordinates, self._shifts, strict=True))

    def _joints(self, solver: WorkspaceSolver, coordinates: Coordinates, text: str) -> Coordinates:
        try:
            return solver.inverse(coordinates, _commanded_positions(self._axes))
        except AxisbusError as error:
            raise point_error(text, error) from error
        except ValueError as error:
            raise LimitError(
                f"{text} is out of reach",
                observed=str(error),
                remedy="begin the stream at the present position of the axes",
            ) from None

    def _time(self, given: float | None, text: str) -> float:
        """Return the time of a point, relative to the first point."""
        last = self._fit.last
        if last is None:
            self._begin = given
            return 0.0
        if given is None:
            assert self._options.period is not None
            return self.count * self._options.period
        assert self._begin is not None
        t = given - self._begin
        if t <= last.t:
            raise ArgumentError(
                f"{text} is not later than the last",
                observed=f"its time is {given:.6g} s; the time of the last point is {last.t + self._begin:.6g} s",
                remedy="give points in the order of their times; this point was rejected",
            )
        require_apart(t - last.t, self._scan, text, "the time after the last")
        return t

    def _send(self, segments: tuple[StreamSegment, ...]) -> None:
        """Send segments to the core."""
        first, self._sent = self._sent, self._sent + len(segments)
        self._known += sum(segment.seconds for segment in segments)
        self._braking = max([self._braking, *(1.0 / segment.ramp for segment in segments)])
        self._give(_Sent(first, segments, self._known, self._ended or not self._has_room, self._ended))

    def _give(self, sent: _Sent) -> None:
        """Send segments to the core, possibly a second time, and note when the axes have reached their end."""
        self._parts.append(sent)
        command = AddPoints(
            tuple(self._axes), self._number, sent.first, sent.segments, begins=sent.begins, ends=sent.ends
        )
        part = self._commanding.submit(self._key, command, f"{self._text}, points up to {self.count}")
        part.add_done_callback(lambda: self._on_part_ended(part, sent))

    def _on_part_ended(self, part: Handle, sent: _Sent) -> None:
        if part.status is Status.DONE:
            self._passed, self._done = sent.known, sent.first + len(sent.segments)
            while self._parts and self._parts[0].known <= sent.known and not self._parts[0].ends:
                self._parts.popleft()
        elif part.status is Status.ERROR:
            self._failure = self._failure or part.exception()


def _solver_of(
    axes: Mapping[str, Axis], kinematics: Kinematics | UserKinematicsAdapter | None
) -> WorkspaceSolver | None:
    if kinematics is None or isinstance(kinematics, UserKinematicsAdapter):
        return kinematics
    return UserKinematicsSolver(kinematics, [axis.increment for axis in axes.values()])


def _fit_of(
    axes: Mapping[str, Axis], text: str, solver: WorkspaceSolver | None
) -> IncrementalFit[StreamSegment] | IncrementalFit[tuple[StreamSegment, ...]]:
    allowed = {name: axis._stream_limits() for name, axis in axes.items()}
    if solver is None:
        return CurveFit(allowed, text)
    return WorkspaceCurveFit(solver, allowed, lambda: _commanded_positions(axes), text)


def _names_of(axes: Mapping[str, Axis], text: str, solver: WorkspaceSolver | None) -> list[str]:
    """Return the names of a point's numbers. The user's own kinematics may have fewer coordinates than axes."""
    if not isinstance(solver, UserKinematicsAdapter):
        return list(axes)
    try:
        return [
            f"coordinate {number + 1}" for number, _ in enumerate(solver.forward(_commanded_positions(axes)))
        ]
    except AxisbusError as error:
        raise prefixed(text, error) from error


def _commanded_positions(axes: Mapping[str, Axis]) -> Coordinates:
    """Return the commanded positions of the axes."""
    return tuple(axis.commanded_position for axis in axes.values())


def _tuple(stream_point: StreamSegment | tuple[StreamSegment, ...] | None) -> tuple[StreamSegment, ...]:
    return (
        ()
        if stream_point is None
        else (stream_point,)
        if isinstance(stream_point, StreamSegment)
        else stream_point
    )


def _turns(axis: Axis, position: float) -> float:
    """Return the whole turns, in the axis's unit, by which an endless axis is ahead of ``position``; 0 for other axes."""
    return (
        0.0
        if axis.modulo is None
        else axis.modulo * round((axis.commanded_position - position) / axis.modulo)
    )
