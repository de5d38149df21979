"""Keep the events of a cell in order: sort late events, drop repeated ones, and determine which events are missing.

Theory of operation
-------------------
Each run of a bridge counts its events from 1 without gaps. A fleet that joins later also requests the newest few of the earlier
events. A fleet that was cut off finds the missing numbers (``missing``) and requests them. Events that the bridge no longer stores
are lost; they are counted and reported. So is a missing event if more events than the log stores have come after it.
"""

from __future__ import annotations

from collections import deque

from axisbus.fleet.messages import Event, EventsAnswer, EventsAsk

KEPT = 500  # events of a cell
_JOINED = 50  # the number of earlier events that are requested

NEWEST = EventsAsk(first=1 << 53)  # asks for the range of stored numbers, and for no events


class EventLog:
    """Hold the newest events of one cell, of the present run of its bridge and of earlier runs."""

    def __init__(self) -> None:
        self.lost = 0
        self._before: deque[Event] = deque(maxlen=KEPT)
        self._run = ""
        self._joined = False
        self._sure = False  # whether the newest number is known
        self._events: dict[int, Event] = {}
        self._upto = 0  # every event up to this number is stored, lost, or older than the join
        self._newest = 0

    @property
    def events(self) -> list[Event]:
        """The stored events, oldest first."""
        return [*self._before, *(self._events[number] for number in sorted(self._events))][-KEPT:]

    @property
    def missing(self) -> EventsAsk | None:
        """The request for the missing events; None if no event is missing."""
        if not self._sure:
            return NEWEST if self._run else None
        if self._upto >= self._newest:
            return None
        above = min((number for number in self._events if number > self._upto), default=self._newest + 1)
        return EventsAsk(self._upto + 1, above - 1)

    def begin(self, run: str) -> None:
        """Note that a new run of the bridge has begun, which counts from 1."""
        if run != self._run:
            self._before.extend(self._events[number] for number in sorted(self._events))
            self._run, self._events, self._upto, self._newest = run, {}, 0, 0
            self._joined = self._sure = False

    def doubt(self) -> None:
        """Note that the connection to the cell was interrupted: the range of stored events has to be requested again."""
        self._sure = False

    def take(self, event: Event) -> bool:
        """Store an event of the present run; return whether it is new."""
        if event.n <= self._upto or event.n in self._events:
            return False
        self._events[event.n] = event
        self._newest = max(self._newest, event.n)
        self._settle()
        return True

    def answered(self, ask: EventsAsk, answer: EventsAnswer) -> None:
        """Process the answer to a request; a requested event that is not in it is lost."""
        if answer.bridge != self._run:
            return
        self._sure = True
        if not self._joined:
            self._joined = True
            self._upto = max(self._upto, min(answer.newest, self._first()) - 1 - _JOINED)
        for event in answer.events:
            self.take(event)
        self._newest = max(self._newest, answer.newest)
        if ask is not NEWEST:
            self._give_up(ask, answer)
        self._settle()

    def _first(self) -> int:
        return min(self._events, default=1 << 53)

    def _give_up(self, ask: EventsAsk, answer: EventsAnswer) -> None:
        """Count events as lost that are older than all stored ones, or that were requested and are not in the answer."""
        last = self._newest if ask.last is None else ask.last
        given = max((event.n for event in answer.events), default=last)
        upto = min(last, given)
        if ask.first != self._upto + 1 or upto < ask.first:
            return
        self._pass_over(upto)

    def _pass_over(self, upto: int) -> None:
        """Stop waiting for the missing events up to this number; they are lost, unless they are older than the join."""
        if self._joined:
            self.lost += upto - self._upto - sum(self._upto < number <= upto for number in self._events)
        self._upto = upto

    def _settle(self) -> None:
        """Advance past the events that are stored, and delete all but the newest, even if older ones are still missing."""
        old = sorted(self._events)[:-KEPT]
        if old and old[-1] > self._upto:
            self._pass_over(old[-1])
        for number in old:
            del self._events[number]
        while self._upto + 1 in self._events:
            self._upto += 1
