"""An active stream of points: the axes' followers, and their motion along the known part of the stream.

Theory of operation
-------------------
The axes wait at the start barrier until enough points are known. Then they move along the ``StreamTimeline``, like the axes of a
line along their path: a halt, a fault of one axis and an override act in the same manner. If the pace falls because no more points
are known, this is an underrun.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping

from axisbus.errors import AxisbusError, CommandError, StateError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus, Status
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.follow import Follow
from axisbus.motion.point_stream.commands import AddPoints, FollowPoints, OnUnderrun, Span
from axisbus.motion.point_stream.rate import StreamTravel
from axisbus.motion.point_stream.timeline import StreamTimeline

MOST = 4096  # spans that may wait
_KEPT = 2  # spans that are stored behind the axes
_FADE = 0.5  # seconds of the stream within which the axes' start offset is removed
_ENDLESS = 1e9  # seconds: the duration of a stream that has not been ended
_SLOWER = 1e-9  # the smallest decrease that counts as a lower pace


class PatientGate(StartBarrier):
    """A start barrier that stays closed, whoever is present, until ``may_open`` is set."""

    __slots__ = ("may_open",)

    def __init__(self) -> None:
        super().__init__()
        self.may_open = False

    def update(self, coming: int) -> None:
        """As ``StartBarrier.update``."""
        super().update(coming if self.may_open else coming + len(self._here) + 1)


class PointShare:
    """One axis's component of a stream, as the trajectory that it follows."""

    def __init__(
        self, course: StreamTimeline, number: int, begin: float, off: float, duration: float
    ) -> None:
        """``number``: index of the axis in a position vector; ``off``: the axis's offset from the stream at ``begin``."""
        self._course = course
        self._number = number
        self._begin = begin
        self._off = off
        self.duration = duration

    def position(self, s: float) -> float:
        """Return the position at ``s`` seconds of the stream."""
        place = self._course.place(min(s, self._course.length))[self._number]
        gone = s - self._begin
        if gone >= _FADE or not self._off:
            return place
        left = 1.0 - gone / _FADE
        return place + self._off * left * left * (3.0 - 2.0 * left)


class PointStreamMotion:
    """Holds the timeline, the motion along it, and the tickets of added points whose ends are ahead."""

    def __init__(self, command: FollowPoints, axes: Mapping[str, AxisCore], name: str) -> None:
        """``axes``: the axes of the group, by name; ``name``: the command's name for messages."""
        self._axes = {axis: axes[axis] for axis in command.axes}
        self._on_underrun = command.on_underrun
        self._name = name
        self.number = command.stream
        self.gate = PatientGate()
        self.travel = StreamTravel()
        self.planned = False
        self.gives_up: AxisbusError | None = None
        self.follows = {
            axis: Follow(None, core.parameters, self.gate, self.travel) for axis, core in self._axes.items()
        }
        self._course = StreamTimeline()
        self._offs: tuple[float, ...] = ()
        self._added: deque[tuple[float, CommandStatus]] = deque()
        self._ends = self._over = False
        self._begins_at = 0.0  # seconds of the stream
        self._is_resumed = False
        self._starves = False
        self._news = False

    @property
    def names(self) -> tuple[str, ...]:
        """The axes that move along the stream."""
        return tuple(self._axes)

    @property
    def is_at_its_end(self) -> bool:
        """Whether the axes are at the end of the known part."""
        return self.travel.t >= self._course.length

    @property
    def goes_on(self) -> bool:
        """Whether more points may come."""
        return not self._ends

    def again(self, axes: Mapping[str, AxisCore], name: str, *, fed: bool) -> PointStreamMotion:
        """Return a motion that resumes this one where it was interrupted; ``fed``: whether more points are added.

        ``axes``: the axes of the group. Added points may overlap with points that are already known.

        Raises:
            StateError: an axis is no longer at that position; ``name`` is the command's name in the message.
        """
        stream = PointStreamMotion(FollowPoints(self.names, self.number, self._on_underrun), axes, name)
        stream._course, stream._begins_at, stream._is_resumed = self._course, self.travel.t, True
        stream._ends = stream.gate.may_open = not fed
        if self._course.count:
            stream._require_near("is no longer at the position at which the stream was interrupted")
        return stream

    # -- added points --------------------------------------------------------------------------------------------------

    def add(self, command: AddPoints, ticket: CommandStatus) -> None:
        """Append points to the stream.

        Raises:
            StateError: the stream has been ended, points before these are missing, too many wait, or a value is not finite. The
                stream then ends as well.
        """
        wrong = self._wrong(command)
        if wrong is not None:
            self.gives_up = self.gives_up or wrong
            raise wrong
        course = self._course
        for span in command.spans[course.count - command.first :]:
            course.add(span)
        end = course.marks.get(
            command.first + len(command.spans), 0.0
        )  # 0 if it was passed long ago and dropped
        self._added.append((end, ticket))
        self._ends = self._ends or command.ends
        self.gate.may_open = self.gate.may_open or command.begins or self._ends
        if command.ends and self.planned:
            self._follow_to(self._course.length)

    def _wrong(self, command: AddPoints) -> StateError | None:
        course = self._course
        if self._ends:
            return StateError(f"{self._name}: points came after its end")
        if command.first > course.count or (command.first < course.count and not self._is_resumed):
            return StateError(
                f"{self._name}: some of its points did not arrive",
                observed=f"number {command.first} came, {course.count} was expected",
                remedy="begin a new stream at the present position of the axes",
            )
        if course.waiting + len(command.spans) > MOST:
            return StateError(f"{self._name}: more than {MOST} of its points are waiting")
        if not all(_is_sound(span, len(self._axes)) for span in command.spans):
            return StateError(f"{self._name}: a point is not a number")
        return None

    def close(self) -> None:
        """End the stream: abort the tickets of all added points that the axes have not reached."""
        self._over = True
        while self._added:
            self._finish(self._added.popleft()[1], Status.ABORTED)

    def take_news(self) -> bool:
        """Return whether a ticket of added points has ended since the last call."""
        news, self._news = self._news, False
        return news

    # -- in each cycle -----------------------------------------------------------------------------------------------------

    def step(self, period: float, begins: bool, _name: str) -> None:
        """Begin as soon as all axes may begin; afterwards advance by one cycle of ``period`` seconds.

        Raises:
            StateError: an axis is not at the start of the stream.
        """
        if self.planned:
            before = self.travel.speed
            self.travel.advance(period)
            self._look(before)
            self._course.forget(self._course.number(self.travel.t) - _KEPT)
        elif begins:
            self._begin()
        while self._added and self._is_passed(self._added[0][0]):
            self._finish(self._added.popleft()[1], Status.DONE)

    def leads(self) -> bool:
        """Return whether any axis was commanded along the stream since the last call."""
        led = [follow.take_stepped() for follow in self.follows.values()]
        return any(led)

    def _is_passed(self, mark: float) -> bool:
        return self.planned and self.travel.t >= mark

    def _finish(self, ticket: CommandStatus, status: Status) -> None:
        ticket.finish(status)
        self._news = True

    def _begin(self) -> None:
        course = self._course
        if course.count:
            self._require_near("is not at the start of the stream")
        else:  # ended before it had two points
            here = tuple((self._start(axis), 0.0, 0.0, 0.0, 0.0, 0.0) for axis in self._axes)
            course.add(Span(1e-3, 1e3, here))
            self._offs = tuple(0.0 for _ in here)
        self.planned = True
        self._follow_to(course.length if self._ends else _ENDLESS)
        self.travel.begin(course, 1.0, self._begins_at)

    def _follow_to(self, duration: float) -> None:
        """Set the duration of the stream, in seconds, for the axes that still follow it."""
        for number, follow in enumerate(self.follows.values()):
            if follow.clock is self.travel:
                follow.begin(PointShare(self._course, number, self._begins_at, self._offs[number], duration))

    def _start(self, axis: str) -> float:
        core = self._axes[axis]
        place = self.follows[axis].reference(core.image) - core.image.origin
        return core.parameters.units.position.to_units(place)

    def _require_near(self, what: str) -> None:
        """Measure each axis's offset from the start; raise StateError if one is too large (``what``: the message's predicate)."""
        places = self._course.place(self._begins_at)
        self._offs = tuple(self._start(axis) - there for axis, there in zip(self._axes, places, strict=True))
        for (axis, core), off in zip(self._axes.items(), self._offs, strict=True):
            units = core.parameters.units.position
            allowed = abs(units.to_units(core.parameters.place_window))
            if abs(off) > allowed:
                raise StateError(
                    f"{self._name}: {axis} {what}",
                    observed=f"it is {abs(off):.6g} {units.unit} away from there, {allowed:.6g} {units.unit} are allowed",
                    remedy=(
                        f"go there first: group.move_direct(({_listed(places)},)); or begin again at the present position "
                        "of the axes"
                    ),
                )

    def _look(self, before: float) -> None:
        """Detect an underrun: the pace falls because points are missing."""
        travel = self.travel
        wanted = travel.wanted
        if self._ends or travel.braking:
            self._starves = False
            return
        falls = travel.speed < before - _SLOWER and before <= wanted + _SLOWER
        stands = travel.speed == 0.0 and wanted > 0.0 and travel.t >= self._course.length
        self._starves = falls or stands
        if self._starves and self._on_underrun is OnUnderrun.ERROR:
            self.gives_up = self.gives_up or self._underrun()

    def _underrun(self) -> CommandError:
        return CommandError(
            f"{self._name}: underrun, no further point came in time",
            observed=f"at {self.travel.t:.3f} s of the stream; {self._course.length:.3f} s of it are known",
            remedy='give points earlier, with a larger buffer, or end the stream when there are no more; on_underrun = "hold" '
            "waits for more; the axes were braked along the points that there were",
        )


def _listed(place: tuple[float, ...]) -> str:
    return ", ".join(f"{value:.6g}" for value in place)


def _is_sound(span: Span, axes: int) -> bool:
    values = (span.seconds, span.ramp, *(value for curve in span.curves for value in curve))
    shaped = len(span.curves) == axes and all(len(curve) == 6 for curve in span.curves)
    return shaped and all(map(math.isfinite, values)) and span.seconds > 0.0 and span.ramp > 0.0
