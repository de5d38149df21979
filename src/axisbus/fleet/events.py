"""The events of a cell in their order: what came twice or late is put in its place, and what is missing is asked for.

Theory of operation
-------------------
Each run of a bridge counts its events from 1 without gaps. Whoever joins later takes the newest few of those before (``join``).
Whoever was cut off finds the numbers that it has not got (``missing``) and asks for them; what the bridge does not keep any more
is lost, which is counted and told, not passed over.
"""

from __future__ import annotations

from collections import deque

from axisbus.fleet.messages import Event, EventsAnswer, EventsAsk

KEPT = 500  # events of a cell
_JOINED = 50  # of those before this program came

NEWEST = EventsAsk(first=1 << 53)  # asks which there are, and for none of them


class EventLog:
    """Holds the newest events of one cell, of the present run of its bridge and of those before."""

    def __init__(self) -> None:
        self.lost = 0
        self._before: deque[Event] = deque(maxlen=KEPT)
        self._run = ""
        self._joined = False
        self._sure = False  # whether nothing can have come that is not known of
        self._events: dict[int, Event] = {}
        self._upto = 0  # all up to this one are here, or lost, or of before
        self._newest = 0

    @property
    def events(self) -> list[Event]:
        """The events that are here, the oldest first."""
        return [*self._before, *(self._events[number] for number in sorted(self._events))][-KEPT:]

    @property
    def missing(self) -> EventsAsk | None:
        """What is to be asked for; None where nothing is missing."""
        if not self._sure:
            return NEWEST if self._run else None
        if self._upto >= self._newest:
            return None
        above = min((number for number in self._events if number > self._upto), default=self._newest + 1)
        return EventsAsk(self._upto + 1, above - 1)

    def begin(self, run: str) -> None:
        """A bridge has begun anew, and counts from 1."""
        if run != self._run:
            self._before.extend(self._events[number] for number in sorted(self._events))
            self._run, self._events, self._upto, self._newest = run, {}, 0, 0
            self._joined = self._sure = False

    def doubt(self) -> None:
        """The way to the cell was cut: it is asked which events there are."""
        self._sure = False

    def take(self, event: Event) -> bool:
        """Take an event of the present run in; return whether it is new."""
        if event.n <= self._upto or event.n in self._events:
            return False
        self._events[event.n] = event
        self._newest = max(self._newest, event.n)
        self._settle()
        return True

    def answered(self, ask: EventsAsk, answer: EventsAnswer) -> None:
        """Take in what came of having asked; what was asked for and is not there is lost."""
        if answer.bridge != self._run:
            return
        self._sure = True
        if not self._joined:
            self._joined = True
            self._upto = max(0, min(answer.newest, self._first()) - 1 - _JOINED)
        for event in answer.events:
            self.take(event)
        self._newest = max(self._newest, answer.newest)
        if ask is not NEWEST:
            self._give_up(ask, answer)
        self._settle()

    def _first(self) -> int:
        return min(self._events, default=1 << 53)

    def _give_up(self, ask: EventsAsk, answer: EventsAnswer) -> None:
        """Count as lost what is older than all that are kept, or was asked for and is not in the answer."""
        last = self._newest if ask.last is None else ask.last
        given = max((event.n for event in answer.events), default=last)
        upto = min(last, given)
        if ask.first != self._upto + 1 or upto < ask.first:
            return
        self.lost += upto - self._upto - sum(self._upto < number <= upto for number in self._events)
        self._upto = upto

    def _settle(self) -> None:
        while self._upto + 1 in self._events:
            self._upto += 1
        for number in sorted(self._events)[:-KEPT]:
            if number <= self._upto:
                del self._events[number]
