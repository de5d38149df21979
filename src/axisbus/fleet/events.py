"""The events of a cell in their order: what came twice or late is put in its place, and what is missing can be asked for.

Theory of operation
-------------------
Each run of a bridge counts its events from 1 without gaps. Whoever joins later, or was cut off, finds the numbers that it has not
got (``missing``), asks for them, and says which ones it has asked for (``asked``): what the bridge does not keep any more is lost,
which is counted and told, not passed over.
"""

from __future__ import annotations

from collections import deque

from axisbus.fleet.messages import Event

KEPT = 500  # events of a cell


class EventLog:
    """Holds the newest events of one cell, of the present run of its bridge and of those before."""

    def __init__(self) -> None:
        self.lost = 0
        self._before: deque[Event] = deque(maxlen=KEPT)
        self._run = ""
        self._events: dict[int, Event] = {}
        self._upto = 0  # all up to this one are here, or lost
        self._newest = 0

    @property
    def events(self) -> list[Event]:
        """The events that are here, the oldest first."""
        return [*self._before, *(self._events[number] for number in sorted(self._events))][-KEPT:]

    @property
    def missing(self) -> tuple[int, int] | None:
        """The first and the last number of the first gap, None where there is none."""
        if self._upto >= self._newest:
            return None
        return self._upto + 1, min(number for number in self._events if number > self._upto) - 1

    def begin(self, run: str) -> None:
        """A bridge has begun anew, and counts from 1."""
        if run == self._run:
            return
        self._before.extend(self._events[number] for number in sorted(self._events))
        self._run, self._events, self._upto, self._newest = run, {}, 0, 0

    def take(self, event: Event) -> bool:
        """Take an event of the present run in; return whether it is new."""
        if event.n <= self._upto or event.n in self._events:
            return False
        self._events[event.n] = event
        self._newest = max(self._newest, event.n)
        self._settle()
        return True

    def asked(self, first: int, last: int) -> None:
        """These were asked for, and what came of them was taken in: the rest is lost."""
        begin, end = max(first, self._upto + 1), min(last, self._newest)
        if begin > self._upto + 1 or end < begin:
            return
        self.lost += end - begin + 1 - sum(begin <= number <= end for number in self._events)
        self._upto = end
        self._settle()

    def _settle(self) -> None:
        while self._upto + 1 in self._events:
            self._upto += 1
        for number in sorted(self._events)[:-KEPT]:
            if number <= self._upto:
                del self._events[number]
