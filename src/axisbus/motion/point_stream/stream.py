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
from axisbus.motion.point_stream.commands import AddPoints, FollowPoints, OnUnderrun, StreamSegment
from axisbus.motion.point_stream.curve_fit import at

MAX_WAITING = 4096  # segments that may wait
_STORED_BEHIND = 2  # segments that are stored behind the axes
# seconds of the stream within which the axes' start offset is removed, if it is at least so long
_FADE_TIME = 0.5
_FADE_SHARE = 0.05  # of an axis's limits: the most that the removal of its start offset uses
_AT_END = 1e-9  # seconds of the stream: a shorter rest counts as none
_ENDLESS = 1e9  # seconds: the duration of a stream that has not been ended
_MIN_DECREASE = 1e-9  # the smallest decrease that counts as a lower pace


class StreamStartBarrier(StartBarrier):
    """A start barrier that stays closed, whoever is present, until ``may_open`` is set."""

    __slots__ = ("may_open",)

    def __init__(self) -> None:
        super().__init__()
        self.may_open = False

    def update(self, expected: int) -> None:
        """As ``StartBarrier.update``."""
        super().update(expected if self.may_open else expected + len(self._present) + 1)


class PointShare:
    """One axis's component of a stream, as the trajectory that it follows."""

    def __init__(
        self, timeline: StreamTimeline, number: int, begin: float, off: float, fade: float, duration: float
    ) -> None:
        """``number``: index of the axis in a position vector; ``off``: the axis's offset from the stream at ``begin``.

        ``fade``: seconds of the stream within which the offset is removed.
        """
        self._timeline = timeline
        self._axis_index = number
        self._begin = begin
        self._off = off
        self._fade = fade
        self.duration = duration

    def position(self, s: float) -> float:
        """Return the position at ``s`` seconds of the stream."""
        position = self._timeline.coordinates(min(s, self._timeline.length))[self._axis_index]
        elapsed = s - self._begin
        if elapsed >= self._fade or not self._off:
            return position
        left = 1.0 - elapsed / self._fade
        return position + self._off * left * left * (3.0 - 2.0 * left)


class PointStreamMotion:
    """Holds the timeline, the motion along it, and the tickets of added points whose ends are ahead."""

    def __init__(self, command: FollowPoints, axes: Mapping[str, AxisCore], name: str) -> None:
        """``axes``: the axes of the group, by name; ``name``: the command's name for messages."""
        self._axes = {axis: axes[axis] for axis in command.axes}
        self._on_underrun = command.on_underrun
        self._name = name
        self.number = command.stream
        self.gate = StreamStartBarrier()
        self.travel = StreamTravel()
        self.planned = False
        self.abort_error: AxisbusError | None = None
        self.follows = {
            axis: Follow(None, core.parameters, self.gate, self.travel) for axis, core in self._axes.items()
        }
        self._timeline = StreamTimeline()
        self._offsets: tuple[float, ...] = ()
        self._fade = 0.0  # seconds of the stream within which these offsets are removed
        self._added: deque[tuple[float, CommandStatus]] = deque()
        self._ends = self._over = False
        self._begins_at = 0.0  # seconds of the stream
        self._is_resumed = False
        self._is_starved = False
        self._has_ended = False

    @property
    def names(self) -> tuple[str, ...]:
        """The axes that move along the stream."""
        return tuple(self._axes)

    @property
    def is_at_its_end(self) -> bool:
        """Whether the axes are at the end of the known part."""
        return self.travel.t >= self._timeline.length

    @property
    def expects_points(self) -> bool:
        """Whether more points may come."""
        return not self._ends

    def resumed(self, axes: Mapping[str, AxisCore], name: str, *, fed: bool) -> PointStreamMotion:
        """Return a motion that resumes this one where it was interrupted; ``fed``: whether more points are added.

        ``axes``: the axes of the group. Added points may overlap with points that are already known.

        Raises:
            StateError: an axis is no longer at that position; ``name`` is the command's name in the message.
        """
        stream = PointStreamMotion(FollowPoints(self.names, self.number, self._on_underrun), axes, name)
        stream._timeline, stream._begins_at, stream._is_resumed = self._timeline, self.travel.t, True
        stream._ends = stream.gate.may_open = not fed
        if self._timeline.count:
            stream._require_near("is no longer at the position at which the stream was interrupted")
        return stream

    # -- added points --------------------------------------------------------------------------------------------------

    def add(self, command: AddPoints, ticket: CommandStatus) -> None:
        """Append points to the stream.

        Raises:
            StateError: the stream has been ended, points before these are missing, too many wait, or a value is not finite. The
                stream then ends as well.
        """
        rejection = self._rejection(command)
        if rejection is not None:
            self.abort_error = self.abort_error or rejection
            raise rejection
        timeline = self._timeline
        for segment in command.segments[timeline.count - command.first :]:
            timeline.add(segment)
        end = timeline.marks.get(
            command.first + len(command.segments), 0.0
        )  # 0 if it was passed long ago and dropped
        self._added.append((end, ticket))
        self._ends = self._ends or command.ends
        self.gate.may_open = self.gate.may_open or command.begins or self._ends
        if command.ends and self.planned:
            self._follow_to(self._timeline.length)

    def _rejection(self, command: AddPoints) -> StateError | None:
        timeline = self._timeline
        if self._ends:
            return StateError(f"{self._name}: points came after its end")
        if command.first > timeline.count or (command.first < timeline.count and not self._is_resumed):
            return StateError(
                f"{self._name}: some of its points did not arrive",
                observed=f"number {command.first} came, {timeline.count} was expected",
                remedy="begin a new stream at the present position of the axes",
            )
        if timeline.waiting + len(command.segments) > MAX_WAITING:
            return StateError(f"{self._name}: more than {MAX_WAITING} of its points are waiting")
        if not all(_is_sound(segment, len(self._axes)) for segment in command.segments):
            return StateError(f"{self._name}: a point is not a number")
        return None

    def close(self) -> None:
        """End the stream: abort the tickets of all added points that the axes have not reached."""
        self._over = True
        while self._added:
            self._finish(self._added.popleft()[1], Status.ABORTED)

    def take_ended(self) -> bool:
        """Return whether a ticket of added points has ended since the last call."""
        has_ended, self._has_ended = self._has_ended, False
        return has_ended

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
            self._detect_underrun(before)
            self._timeline.forget(self._timeline.number(self.travel.t) - _STORED_BEHIND)
        elif begins:
            self._begin()
        while self._added and self._is_passed(self._added[0][0]):
            self._finish(self._added.popleft()[1], Status.DONE)

    def take_commanded(self) -> bool:
        """Return whether any axis was commanded along the stream since the last call."""
        commanded = [follow.take_stepped() for follow in self.follows.values()]
        return any(commanded)

    def _is_passed(self, mark: float) -> bool:
        return self.planned and self.travel.t >= mark

    def _finish(self, ticket: CommandStatus, status: Status) -> None:
        ticket.finish(status)
        self._has_ended = True

    def _begin(self) -> None:
        timeline = self._timeline
        if timeline.count:
            self._require_near("is not at the start of the stream")
        else:  # ended before it had two points
            here = tuple((self._start(axis), 0.0, 0.0, 0.0, 0.0, 0.0) for axis in self._axes)
            timeline.add(StreamSegment(1e-3, 1e3, here))
            self._offsets = tuple(0.0 for _ in here)
        self.planned = True
        pace = self._plan_fade()
        self._follow_to(timeline.length if self._ends else _ENDLESS)
        self.travel.begin(timeline, pace, self._begins_at)

    def _plan_fade(self) -> float:
        """Plan to remove the start offsets on the known part, so that none is left at its end; return the pace meanwhile.

        A known part that is too short for this is passed more slowly. If it is already passed, the axes move to its end at once.
        """
        timeline, least = self._timeline, max(map(self._min_fade_time, self._axes, self._offsets))
        if self._ends and timeline.length - self._begins_at <= _AT_END and least:
            timeline.add(
                StreamSegment(2.0 * least, 1e3, tuple((x, 0.0, 0.0, 0.0, 0.0, 0.0) for x in timeline.end))
            )
        self._fade = min(timeline.length - self._begins_at, max(_FADE_TIME, least))
        return 1.0 if self._fade >= least else 0.5 * self._fade / least

    def _min_fade_time(self, axis: str, off: float) -> float:
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
                    self._timeline, number, self._begins_at, self._offsets[number], self._fade, duration
                )
                follow.begin(share)

    def _start(self, axis: str) -> float:
        core = self._axes[axis]
        increments = self.follows[axis].reference(core.image) - core.image.origin
        return core.parameters.units.position.to_units(increments)

    def _require_near(self, what: str) -> None:
        """Measure each axis's offset from the start; raise StateError if one is too large (``what``: the message's predicate)."""
        start = self._timeline.coordinates(self._begins_at)
        self._offsets = tuple(
            self._start(axis) - there for axis, there in zip(self._axes, start, strict=True)
        )
        for (axis, core), off in zip(self._axes.items(), self._offsets, strict=True):
            units = core.parameters.units.position
            allowed = abs(units.to_units(core.parameters.position_tolerance))
            if abs(off) > allowed:
                raise StateError(
                    f"{self._name}: {axis} {what}",
                    observed=f"it is {abs(off):.6g} {units.unit} away from there, {allowed:.6g} {units.unit} are allowed",
                    remedy=(
                        f"go there first: group.move_direct(({_listed(start)},)); or begin again at the present position "
                        "of the axes"
                    ),
                )

    def _detect_underrun(self, before: float) -> None:
        """Detect an underrun: the pace falls because points are missing."""
        travel = self.travel
        wanted = travel.wanted
        if self._ends or travel.braking:
            self._is_starved = False
            return
        falls = travel.speed < before - _MIN_DECREASE and before <= wanted + _MIN_DECREASE
        at_standstill = travel.speed == 0.0 and wanted > 0.0 and travel.t >= self._timeline.length
        self._is_starved = falls or at_standstill
        if self._is_starved and self._on_underrun is OnUnderrun.ERROR:
            self.abort_error = self.abort_error or self._underrun()

    def _underrun(self) -> CommandError:
        return CommandError(
            f"{self._name}: underrun, no further point came in time",
            observed=f"position in the stream: {self.travel.t:.3f} s; the received points end at {self._timeline.length:.3f} s",
            remedy='give points earlier, with a larger buffer, or end the stream when there are no more; on_underrun = "hold" '
            "waits for more; the axes were braked along the known points",
        )


def _listed(coordinates: tuple[float, ...]) -> str:
    return ", ".join(f"{value:.6g}" for value in coordinates)


def _is_sound(segment: StreamSegment, axes: int) -> bool:
    values = (segment.seconds, segment.ramp, *(value for curve in segment.curves for value in curve))
    shaped = len(segment.curves) == axes and all(len(curve) == 6 for curve in segment.curves)
    return shaped and all(map(math.isfinite, values)) and segment.seconds > 0.0 and segment.ramp > 0.0


# ----------------------------------------------------------------------------------------------------------------------
# Move along a stream: as close to the pace of its points as its segments allow, computed exactly at each boundary of two segments.
#
# Theory of operation
# Within a segment, the square of the highest pace is a linear function of the distance to the segment's end (v² = leave² + 2 ramp *
# distance). The pace rises at the segment's ramp to the requested pace, stays there, and falls along that line or to the requested
# pace. So a cycle consists of a few phases of constant change. Each ends where the next begins, at a segment boundary, or with the
# cycle. Segments may be shorter than a cycle, and their ramps differ by powers of ten. Therefore no phase crosses a segment
# boundary, unlike in ``PathSpeed``.


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

    def as_text(self, t: float) -> str:
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
            left = self._advance_in_zone(left)
            if left <= 0.0:
                break
        self.t = self._ahead

    def _advance_in_zone(self, period: float) -> float:
        """Advance by one phase of at most ``period`` seconds; return the time that remains."""
        path, v = self._path, self.speed
        left = path.marks[self._zone + 1] - self._ahead
        if left <= _SAME:
            return period if self._enter_next_segment() else 0.0
        phase = self._phase(path.ramps[self._zone], path.max_exit_speeds[self._zone], left)
        if not v and not phase.end:
            return 0.0
        seconds = min(period, phase.seconds)
        after = phase.end if seconds == phase.seconds else max(v + phase.rate * seconds, 0.0)
        if 0.5 * (v + after) * seconds >= left - _SAME:
            after = math.sqrt(max(v * v + 2.0 * phase.rate * left, 0.0))
            seconds = min(seconds, 2.0 * left / (v + after))
            self._ahead, self.speed = path.marks[self._zone + 1], after
            self._enter_next_segment()
        else:
            self._ahead, self.speed = self._ahead + 0.5 * (v + after) * seconds, after
        return period - seconds

    def _phase(self, ramp: float, exit_speed: float, left: float) -> _Phase:
        """Return the next phase of the pace, with ``left`` seconds of the segment remaining."""
        v, wanted = self.speed, self.wanted
        reserve = (
            exit_speed * exit_speed + 2.0 * ramp * left - v * v
        )  # below 0: faster than the known points allow
        if v > wanted:
            return _Phase(-ramp, (v - wanted) / ramp, wanted)
        # A distance of ``_SAME`` is below the resolution of a time of the stream.
        if reserve <= _SAME * max(1.0, ramp):
            return (
                _Phase(-ramp, max(v - exit_speed, 0.0) / ramp, exit_speed)
                if v > exit_speed
                else _Phase(0.0, math.inf, v)
            )
        if v == wanted:
            return _Phase(0.0, reserve / (2.0 * ramp * v) if v else math.inf, v)
        top = math.sqrt(v * v + 0.5 * reserve)  # intersection of acceleration and deceleration
        end = min(top, wanted)
        return _Phase(ramp, (end - v) / ramp, end)

    def _enter_next_segment(self) -> bool:
        """Enter the next segment; return False at the end of the known part, where the motion rests."""
        path, number = self._path, self._zone
        self.speed = min(self.speed, path.max_exit_speeds[number])
        if path.is_last(number):
            self.speed = 0.0
            return False
        self._zone = number + 1
        return True


# ----------------------------------------------------------------------------------------------------------------------
# The known segments of a stream, as a path to move along: the position is a time of the stream, the speed is the pace.
#
# Theory of operation
# A pace of 1 is that of the points. The known part ends, so the pace at the end of each segment is limited: with the ramps of the
# following segments, the axes can come to rest at the end of the last segment. Each added segment updates these limits, from the
# end backwards, as far as they change. So the axes are always ready to come to rest at their last point, and brake only if no more
# points come in time. Neither an underrun nor a point that is delayed on its way to the core needs a reaction.


class StreamTimeline:
    """Holds the segments by number (from 0), starting a little behind the axes."""

    def __init__(self) -> None:
        self.ramps: dict[int, float] = {}
        self.max_speeds: dict[int, float] = {}
        self.max_exit_speeds: dict[int, float] = {}
        self.marks: dict[int, float] = {0: 0.0}
        self._spans: dict[int, StreamSegment] = {}
        self._oldest = self.count = 0
        self._coordinates: tuple[float, ...] = ()
        self._at = math.nan

    @property
    def length(self) -> float:
        """Known duration of the stream in seconds."""
        return self.marks[self.count]

    @property
    def end(self) -> tuple[float, ...]:
        """The axis positions at the end of the known part."""
        return self.coordinates(self.length)

    @property
    def waiting(self) -> int:
        """The number of stored segments."""
        return self.count - self._oldest

    def is_last(self, number: int) -> bool:
        """Whether a segment is the last known one."""
        return number + 1 >= self.count

    def number(self, s: float) -> int:
        """Return the number of the segment that contains ``s``; at a boundary, the second segment."""
        number = self._oldest
        while not self.is_last(number) and self.marks[number + 1] <= s:
            number += 1
        return number

    def add(self, segment: StreamSegment) -> None:
        """Append a segment."""
        number = self.count
        self._spans[number], self.ramps[number], self.max_speeds[number] = segment, segment.ramp, 1.0
        self.marks[number + 1] = self.marks[number] + segment.seconds
        self.max_exit_speeds[number] = 0.0
        self.count = number + 1
        while number > self._oldest:
            gain = 2.0 * self.ramps[number] * (self.marks[number + 1] - self.marks[number])
            exit_speed = min(math.sqrt(self.max_exit_speeds[number] ** 2 + gain), 1.0)
            number -= 1
            if self.max_exit_speeds[number] == exit_speed:
                return
            self.max_exit_speeds[number] = exit_speed

    def forget(self, number: int) -> None:
        """Drop the segments before ``number``."""
        while self._oldest < min(number, self.count - 1):
            for row in (self._spans, self.ramps, self.max_speeds, self.max_exit_speeds, self.marks):
                del row[self._oldest]
            self._oldest += 1

    def coordinates(self, s: float) -> tuple[float, ...]:
        """Return the axis positions at ``s``; cached, because all axes ask for the same ``s`` within a cycle."""
        if s != self._at:
            number = self.number(s)
            segment = self._spans[number]
            t = min(max(s - self.marks[number], 0.0), segment.seconds)
            self._coordinates, self._at = tuple([at(curve, t) for curve in segment.curves]), s
        return self._coordinates
