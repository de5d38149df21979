"""State of one cell, derived from the messages received and their local arrival times; this module reads no clock.

Theory of operation
-------------------
A state arrives with its age, and ages here. The clocks of the two computers are not compared, so the delay of a message is known
except for their difference: its excess over the delay of the promptest messages counts as age. Otherwise states that a congested
network, or a client without processor time, delivers late but regularly would be shown as fresh. A constant delay is not seen.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import NamedTuple

from axisbus.client_support.dead_man import MessageLag
from axisbus.fleet.messages import (
    PROTOCOL,
    AxisInfo,
    AxisStateMessage,
    CellInfo,
    Event,
    EventsAnswer,
    EventsAsk,
)
from axisbus.version import __version__

FRESH = 1.0  # seconds: an older state counts as unknown
UNKNOWN = "unknown"  # the state of an axis whose state the cell does not know
AXES = 256  # the most axes that a cell may have
_MAX_ENDED_RUNS = 100  # the number of ended runs that are remembered
_MISSED = 2.0  # seconds after which the token of a killed bridge is certainly gone


class LastAxisState(NamedTuple):
    """The last reported state of an axis. ``age``: its age now in seconds, None if unknown; ``fresh``: whether it is valid."""

    state: AxisStateMessage
    age: float | None
    fresh: bool


@dataclass(frozen=True, slots=True)
class _ReceivedState:
    state: AxisStateMessage
    at: float
    late: float  # seconds by which its message took longer than the promptest ones


class CellWatch:
    """One cell as its messages report it. All times are seconds of the local monotonic clock, given by the caller.

    When a new run of a bridge replaces a run, the old run is over and its later messages are ignored. If two bridges are
    present, the first one that was heard counts. If both stay for longer than the token of a killed bridge can last, two
    bridges use one name.
    """

    def __init__(self, name: str, now: float) -> None:
        self.name = name
        self.alive = False
        self.since = now  # when the cell last appeared or disappeared
        self.info: CellInfo | None = None
        self.informed = False  # whether ``info`` describes the machine that runs now
        self.run = ""  # the run of the bridge whose messages count
        self.log = EventLog()
        self.clock_difference: float | None = None
        self._lag = MessageLag()
        self._states: dict[str, _ReceivedState] = {}
        self._ended_runs: dict[str, None] = {}  # runs that are over, oldest first
        self._bridges: dict[str, float] = {}  # the bridges that are present, and since when

    # -- messages ------------------------------------------------------------------------------------------------------

    def token(self, present: bool, now: float) -> None:
        """Note that the cell's liveliness token has appeared or disappeared."""
        if present != self.alive:
            self.alive, self.since = present, now
            self._lag = (
                MessageLag()
            )  # its messages may take another route now, and its clock may have stopped
            self.informed = False  # it may be another machine, with a changed cell file
            self.log.require_check()

    def presence(self, bridge: str, present: bool, now: float) -> None:
        """Note that a bridge with this name has appeared or disappeared."""
        if not present:
            self._bridges.pop(bridge, None)
        else:
            self._bridges.setdefault(bridge, now)

    def store_info(self, info: CellInfo, wall: float) -> bool:
        """Store the description of the cell; return False, and store nothing, if it comes from a run that is over."""
        if not self._of_present_run(info.bridge):
            return False
        self.info, self.informed = info, True
        self.clock_difference = info.clock - wall
        return True

    def store_state(self, axis: str, state: AxisStateMessage, now: float, wall: float) -> bool:
        """Store the state of an axis; return whether it is newer than the stored one."""
        if not self._of_present_run(state.bridge):
            return False
        received = self._states.get(axis)
        overtaken = received is not None and state.n <= received.state.n
        if overtaken or (received is None and len(self._states) >= AXES):
            return False
        self._states[axis] = _ReceivedState(state, now, self._lateness(state.sent, now))
        self.clock_difference = state.clock - wall
        return True

    def _lateness(self, sent: float | None, now: float) -> float:
        """Return by how many seconds a message is late; 0 for a bridge that does not say when it was sent."""
        if sent is None:
            return 0.0
        self._lag = self._lag.updated(sent, now)
        return self._lag.lateness(sent, now)

    def store_event(self, event: Event) -> bool:
        """Store an event; return whether it is new."""
        return self._of_present_run(event.bridge) and self.log.add(event)

    def _of_present_run(self, run: str) -> bool:
        """Return whether a message belongs to the present run of the bridge; a message of a new run can begin that run."""
        if run == self.run:
            return True
        if self.run in self._bridges or (run in self._ended_runs and run not in self._bridges):
            return False  # of a second bridge, or of a run that has ended
        if self.run:
            self._ended_runs[self.run] = None
        while len(self._ended_runs) > _MAX_ENDED_RUNS:
            del self._ended_runs[next(iter(self._ended_runs))]
        self.run = run
        self._states.clear()
        self._lag = MessageLag()
        self.info, self.informed = None, False
        self.log.begin(run)
        return True

    @property
    def settled(self) -> bool:
        """Whether the cell has reported its description, the state of each axis, and its events."""
        return self.informed and self.log.missing is None and not self.unreported

    @property
    def unreported(self) -> tuple[str, ...]:
        """The axes that have reported no state in this run of the bridge."""
        return tuple(axis for axis in self.axes if axis not in self._states)

    # -- known state ---------------------------------------------------------------------------------------------------

    @property
    def axes(self) -> tuple[str, ...]:
        """The names of the axes; in the order of the cell file if that is known."""
        names = tuple(axis.name for axis in self.info.axes) if self.info is not None else ()
        return names or tuple(sorted(self._states))

    def axis_info(self, axis: str) -> AxisInfo | None:
        """Return the description of an axis in its cell file; None if it is not known."""
        axes = () if self.info is None else self.info.axes
        return next((each for each in axes if each.name == axis), None)

    def last_state(self, axis: str, now: float) -> LastAxisState | None:
        """Return the last state that an axis reported, None if it reported none in this run of its bridge."""
        received = self._states.get(axis)
        if received is None:
            return None
        age = None if received.state.age is None else received.state.age + received.late + (now - received.at)
        known = age is not None and age <= FRESH and received.state.state != UNKNOWN
        return LastAxisState(received.state, age, self.alive and known)

    def has_second_bridge(self, now: float) -> bool:
        """Whether two bridges have used this name for longer than the token of a killed bridge can last."""
        return len(self._bridges) > 1 and now - max(self._bridges.values()) > _MISSED

    @property
    def bridged(self) -> bool:
        """Whether a bridge is present, even one that still waits for its machine."""
        return self.alive or bool(self._bridges)

    @property
    def differs(self) -> str:
        """How the cell's version of axisbus differs from the local one, as text for people; empty if it does not differ."""
        if self.info is None:
            return ""
        if self.info.protocol != PROTOCOL:
            return (
                f"axisbus {self.info.axisbus} speaks protocol {self.info.protocol}, "
                f"this one ({__version__}) protocol {PROTOCOL}"
            )
        return (
            f"axisbus {self.info.axisbus}, this one is {__version__}"
            if self.info.axisbus != __version__
            else ""
        )


# -- Keep the events of a cell in order: sort late events, drop repeated ones, and determine which events are missing ----
#
# Theory of operation
# Each run of a bridge counts its events from 1 without gaps. A fleet that joins later also requests the newest few of the earlier
# events. A fleet that was cut off finds the missing numbers (``missing``) and requests them. Events that the bridge no longer
# stores are lost; they are counted and reported. So is a missing event if more events than the log stores have come after it.


MAX_EVENTS = 500  # events of a cell
_JOINED = 50  # the number of earlier events that are requested


NEWEST = EventsAsk(first=1 << 53)  # asks for the range of stored numbers, and for no events


class EventLog:
    """Hold the newest events of one cell, of the present run of its bridge and of earlier runs."""

    def __init__(self) -> None:
        self.lost = 0
        self._earlier: deque[Event] = deque(maxlen=MAX_EVENTS)
        self._run = ""
        self._joined = False
        self._newest_known = False  # whether the newest number is known
        self._events: dict[int, Event] = {}
        self._complete_to = 0  # every event up to this number is stored, lost, or older than the join
        self._newest = 0

    @property
    def events(self) -> list[Event]:
        """The stored events, oldest first."""
        return [*self._earlier, *(self._events[number] for number in sorted(self._events))][-MAX_EVENTS:]

    @property
    def missing(self) -> EventsAsk | None:
        """The request for the missing events; None if no event is missing."""
        if not self._newest_known:
            return NEWEST if self._run else None
        if self._complete_to >= self._newest:
            return None
        above = min(
            (number for number in self._events if number > self._complete_to), default=self._newest + 1
        )
        return EventsAsk(self._complete_to + 1, above - 1)

    def begin(self, run: str) -> None:
        """Record that a new run of the bridge has begun, which counts from 1."""
        if run != self._run:
            self._earlier.extend(self._events[number] for number in sorted(self._events))
            self._run, self._events, self._complete_to, self._newest = run, {}, 0, 0
            self._joined = self._newest_known = False

    def require_check(self) -> None:
        """Note that the connection to the cell was interrupted: the range of stored events has to be requested again."""
        self._newest_known = False

    def add(self, event: Event) -> bool:
        """Store an event of the present run; return whether it is new."""
        if event.n <= self._complete_to or event.n in self._events:
            return False
        self._events[event.n] = event
        self._newest = max(self._newest, event.n)
        self._settle()
        return True

    def answered(self, request: EventsAsk, answer: EventsAnswer) -> None:
        """Process the answer to a request; a requested event that is not in it is lost."""
        if answer.bridge != self._run:
            return
        self._newest_known = True
        if not self._joined:
            self._joined = True
            self._complete_to = max(self._complete_to, min(answer.newest, self._first()) - 1 - _JOINED)
        for event in answer.events:
            self.add(event)
        self._newest = max(self._newest, answer.newest)
        if request is not NEWEST:
            self._count_lost(request, answer)
        self._settle()

    def _first(self) -> int:
        return min(self._events, default=1 << 53)

    def _count_lost(self, request: EventsAsk, answer: EventsAnswer) -> None:
        """Count events as lost that are older than all stored ones, or that were requested and are not in the answer."""
        last = self._newest if request.last is None else request.last
        given = max((event.n for event in answer.events), default=last)
        end = min(last, given)
        if request.first != self._complete_to + 1 or end < request.first:
            return
        self._skip_missing(end)

    def _skip_missing(self, end: int) -> None:
        """Stop waiting for the missing events up to this number; they are lost, unless they are older than the join."""
        if self._joined:
            self.lost += (
                end - self._complete_to - sum(self._complete_to < number <= end for number in self._events)
            )
        self._complete_to = end

    def _settle(self) -> None:
        """Advance past the events that are stored, and delete all but the newest, even if older ones are still missing."""
        old = sorted(self._events)[:-MAX_EVENTS]
        if old and old[-1] > self._complete_to:
            self._skip_missing(old[-1])
        for number in old:
            del self._events[number]
        while self._complete_to + 1 in self._events:
            self._complete_to += 1
