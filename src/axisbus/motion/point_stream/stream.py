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
from typing import NamedTuple

from axisbus.errors import AxisbusError, CommandError, StateError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus, Status
from axisbus.motion.group.path_speed import PathSpeed
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.follow import Follow
from axisbus.motion.point_stream.commands import AddPoints, FollowPoints, OnUnderrun, Span
from axisbus.motion.point_stream.curve_fit import at

MOST = 4096  # spans that may wait
_KEPT = 2  # spans that are stored behind the axes
_FADE = 0.5  # seconds of the stream within which the axes' start offset is removed, if it is at least so long
_FADE_SHARE = 0.05  # of an axis's limits: the most that the removal of its start offset uses
_AT_END = 1e-9  # seconds of the stream: a shorter rest counts as none
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
        self, course: StreamTimeline, number: int, begin: float, off: float, fade: float, duration: float
    ) -> None:
        """``number``: index of the axis in a position vector; ``off``: the axis's offset from the stream at ``begin``.

        ``fade``: seconds of the stream within which the offset is removed.
        """
        self._course = course
        self._number = number
        self._begin = begin
        self._off = off
        self._fade = fade
        self.duration = duration

    def position(self, s: float) -> float:
        """Return the position at ``s`` seconds of the stream."""
        place = self._course.place(min(s, self._course.length))[self._number]
        gone = s - self._begin
        if gone >= self._fade or not self._off:
            return place
        left = 1.0 - gone / self._fade
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
        self._fade = 0.0  # seconds of the stream within which these offsets are removed
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
            if self.travel.t >= self._begins_at + self._fade:
                self.travel.velocity = 1.0
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
        pace = self._plan_fade()
        self._follow_to(course.length if self._ends else _ENDLESS)
        self.travel.begin(course, pace, self._begins_at)

    def _plan_fade(self) -> float:
        """Plan to remove the start offsets on the known part, so that none is left at its end; return the pace meanwhile.

        A known part that is too short for this is passed more slowly. If it is already passed, the axes move to its end at once.
        """
        course, least = self._course, max(map(self._shortest_fade, self._axes, self._offs))
        if self._ends and course.length - self._begins_at <= _AT_END and least:
            course.add(Span(2.0 * least, 1e3, tuple((x, 0.0, 0.0, 0.0, 0.0, 0.0) for x in course.end)))
        self._fade = min(course.length - self._begins_at, max(_FADE, least))
        return 1.0 if self._fade >= least else 0.5 * self._fade / least

    def _shortest_fade(self, axis: str, off: float) -> float:
        """Return the shortest time in seconds for the removal of an axis's start offset (unit)."""
        parameters = self._axes[axis].parameters
        hardest = parameters.limits.acceleration or parameters.path_deceleration
        seconds = math.sqrt(6.0 * abs(off) / (_FADE_SHARE * hardest)) if hardest else 0.0
        fastest = parameters.limits.velocity
        return max(seconds, 1.5 * abs(off) / (_FADE_SHARE * fastest)) if fastest else seconds

    def _follow_to(self, duration: float) -> None:
        """Set the duration of the stream, in seconds, for the axes that still follow it."""
        for number, follow in enumerate(self.follows.values()):
            if follow.clock is self.travel:
                share = PointShare(
                    self._course, number, self._begins_at, self._offs[number], self._fade, duration
                )
                follow.begin(share)

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
            observed=f"position in the stream: {self.travel.t:.3f} s; the received points end at {self._course.length:.3f} s",
            remedy='give points earlier, with a larger buffer, or end the stream when there are no more; on_underrun = "hold" '
            "waits for more; the axes were braked along the known points",
        )


def _listed(place: tuple[float, ...]) -> str:
    return ", ".join(f"{value:.6g}" for value in place)


def _is_sound(span: Span, axes: int) -> bool:
    values = (span.seconds, span.ramp, *(value for curve in span.curves for value in curve))
    shaped = len(span.curves) == axes and all(len(curve) == 6 for curve in span.curves)
    return shaped and all(map(math.isfinite, values)) and span.seconds > 0.0 and span.ramp > 0.0


# ----------------------------------------------------------------------------------------------------------------------
# Move along a stream: as close to the pace of its points as its spans allow, computed exactly at each boundary of two spans.
#
# Theory of operation
# Within a span, the square of the highest pace is a linear function of the distance to the span's end (v² = leave² + 2 ramp *
# distance). The pace rises at the span's ramp to the requested pace, stays there, and falls along that line or to the requested
# pace. So a cycle consists of a few phases of constant change. Each ends where the next begins, at a span boundary, or with the
# cycle. Spans may be shorter than a cycle, and their ramps differ by powers of ten. Therefore no phase crosses a span boundary,
# unlike in ``PathSpeed``.


_PHASES = 256  # per cycle at most; the phases of eight points take a tenth of a cycle
_SAME = 1e-12


class _Phase(NamedTuple):
    """The change of pace (per s), the longest duration (s), and the pace at its end."""

    rate: float
    seconds: float
    end: float


class StreamTravel(PathSpeed):
    """Motion along a stream: its position is a time of the stream, its speed is the pace."""

    __slots__ = ()

    def told(self, t: float) -> str:
        """Return a time of the stream as text for messages."""
        return f"{t:.3f} s of the stream"

    @property
    def wanted(self) -> float:
        """The requested pace: 1, less with an override, 0 during a halt."""
        return 0.0 if self.braking else min(self.velocity * self.factor, 1.0)

    def advance(self, period: float) -> None:
        """Advance by one cycle of ``period`` seconds."""
        left = period
        for _ in range(_PHASES):
            left = self._go(left)
            if left <= 0.0:
                break
        self.t = self._ahead

    def _go(self, period: float) -> float:
        """Advance by one phase of at most ``period`` seconds; return the time that remains."""
        way, v = self._way, self.speed
        left = way.marks[self._number + 1] - self._ahead
        if left <= _SAME:
            return period if self._pass_joint() else 0.0
        phase = self._phase(way.ramps[self._number], way.leaves[self._number], left)
        if not v and not phase.end:
            return 0.0
        seconds = min(period, phase.seconds)
        after = phase.end if seconds == phase.seconds else max(v + phase.rate * seconds, 0.0)
        if 0.5 * (v + after) * seconds >= left - _SAME:
            after = math.sqrt(max(v * v + 2.0 * phase.rate * left, 0.0))
            seconds = min(seconds, 2.0 * left / (v + after))
            self._ahead, self.speed = way.marks[self._number + 1], after
            self._pass_joint()
        else:
            self._ahead, self.speed = self._ahead + 0.5 * (v + after) * seconds, after
        return period - seconds

    def _phase(self, ramp: float, leave: float, left: float) -> _Phase:
        """Return the next phase of the pace, with ``left`` seconds of the span remaining."""
        v, wanted = self.speed, self.wanted
        room = leave * leave + 2.0 * ramp * left - v * v  # below 0: faster than the known points allow
        if v > wanted:
            return _Phase(-ramp, (v - wanted) / ramp, wanted)
        # A distance of ``_SAME`` is below the resolution of a time of the stream.
        if room <= _SAME * max(1.0, ramp):
            return _Phase(-ramp, max(v - leave, 0.0) / ramp, leave) if v > leave else _Phase(0.0, math.inf, v)
        if v == wanted:
            return _Phase(0.0, room / (2.0 * ramp * v) if v else math.inf, v)
        top = math.sqrt(v * v + 0.5 * room)  # intersection of acceleration and deceleration
        end = min(top, wanted)
        return _Phase(ramp, (end - v) / ramp, end)

    def _pass_joint(self) -> bool:
        """Enter the next span; return False at the end of the known part, where the motion rests."""
        way, number = self._way, self._number
        self.speed = min(self.speed, way.leaves[number])
        if way.is_last(number):
            self.speed = 0.0
            return False
        self._number = number + 1
        return True


# ----------------------------------------------------------------------------------------------------------------------
# The known spans of a stream, as a path to move along: the position is a time of the stream, the speed is the pace.
#
# Theory of operation
# A pace of 1 is that of the points. The known part ends, so the pace at the end of each span is limited: with the ramps of the
# following spans, the axes can come to rest at the end of the last span. Each added span updates these limits, from the end
# backwards, as far as they change. So the axes are always ready to come to rest at their last point, and brake only if no more
# points come in time. Neither an underrun nor a point that is delayed on its way to the core needs a reaction.


class StreamTimeline:
    """Holds the spans by number (from 0), starting a little behind the axes."""

    def __init__(self) -> None:
        self.ramps: dict[int, float] = {}
        self.tops: dict[int, float] = {}
        self.leaves: dict[int, float] = {}
        self.marks: dict[int, float] = {0: 0.0}
        self._spans: dict[int, Span] = {}
        self._oldest = self.count = 0
        self._place: tuple[float, ...] = ()
        self._at = math.nan

    @property
    def length(self) -> float:
        """Known duration of the stream in seconds."""
        return self.marks[self.count]

    @property
    def end(self) -> tuple[float, ...]:
        """The axis positions at the end of the known part."""
        return self.place(self.length)

    @property
    def waiting(self) -> int:
        """The number of stored spans."""
        return self.count - self._oldest

    def is_last(self, number: int) -> bool:
        """Whether a span is the last known one."""
        return number + 1 >= self.count

    def number(self, s: float) -> int:
        """Return the number of the span that contains ``s``; at a boundary, the second span."""
        number = self._oldest
        while not self.is_last(number) and self.marks[number + 1] <= s:
            number += 1
        return number

    def add(self, span: Span) -> None:
        """Append a span."""
        number = self.count
        self._spans[number], self.ramps[number], self.tops[number] = span, span.ramp, 1.0
        self.marks[number + 1] = self.marks[number] + span.seconds
        self.leaves[number] = 0.0
        self.count = number + 1
        while number > self._oldest:
            gain = 2.0 * self.ramps[number] * (self.marks[number + 1] - self.marks[number])
            leave = min(math.sqrt(self.leaves[number] ** 2 + gain), 1.0)
            number -= 1
            if self.leaves[number] == leave:
                return
            self.leaves[number] = leave

    def forget(self, number: int) -> None:
        """Drop the spans before ``number``."""
        while self._oldest < min(number, self.count - 1):
            for row in (self._spans, self.ramps, self.tops, self.leaves, self.marks):
                del row[self._oldest]
            self._oldest += 1

    def place(self, s: float) -> tuple[float, ...]:
        """Return the axis positions at ``s``; cached, because all axes ask for the same ``s`` within a cycle."""
        if s != self._at:
            number = self.number(s)
            span = self._spans[number]
            t = min(max(s - self.marks[number], 0.0), span.seconds)
            self._place, self._at = tuple([at(curve, t) for curve in span.curves]), s
        return self._place
