"""Number events, and store the last ones for clients that have missed some."""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from typing import Literal

from axisbus.fleet.messages import Event, EventsAnswer, EventsAsk
from axisbus.gateway.machine_events import Severity

KEPT = 1024
AT_ONCE = 256  # in one answer
Kind = Literal["machine", "node", "emcy", "incident", "bus", "command", "lease"]


@dataclass(frozen=True, slots=True)
class Happened:
    """An event before it has a number; the fields are those of ``messages.Event``."""

    kind: Kind
    text: str
    about: str = ""
    severity: Severity = "info"
    cause: str = ""
    remedy: str = ""


class BridgeEventLog:
    """Hold the last events of one run of a bridge. ``enter`` is for one thread at a time, the rest for any."""

    def __init__(self, bridge: str) -> None:
        self._bridge = bridge
        self._kept: deque[Event] = deque(maxlen=KEPT)
        self._count = 0

    def enter(self, happened: Happened, clock: float) -> Event:
        """Store an event with the next number and return it; ``clock`` in s since 1970."""
        self._count += 1
        event = Event(
            self._count,
            self._bridge,
            clock,
            happened.kind,
            happened.text,
            happened.about,
            happened.severity,
            happened.cause,
            happened.remedy,
        )
        self._kept.append(event)
        return event

    def answer(self, ask: EventsAsk) -> EventsAnswer:
        """Return the requested events that are stored; oldest first, and no more than ``AT_ONCE``."""
        kept = tuple(self._kept)
        if not kept:
            return EventsAnswer(self._bridge)
        last = kept[-1].n if ask.last is None else ask.last
        asked = tuple(event for event in kept if ask.first <= event.n <= last)
        return EventsAnswer(self._bridge, kept[0].n, kept[-1].n, asked[:AT_ONCE])
