"""What the CAN controller of a channel is in: error active, warning, passive, bus-off and back again, as events.

Theory of operation
-------------------
Linux tells every change by an error frame, with its class in the identifier; some other adapters' drivers tell bus-off by
the bus object's ``state`` alone, which is asked for now and then. Both come in here; each change is an event.

Bus-off is left by a restart only, never by one of the frames that came before it. Linux tells a restart (by ``restart-ms`` or by
hand) in a frame of its own, some drivers by the controller's new condition; so each condition but bus-off that is told while
bus-off means a restart. Who learnt of bus-off by that ``state`` learns of its end by that too.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from axisbus.bus.link import errorframe
from axisbus.bus.link.errorframe import CanErrorState, ErrorCounters

HISTORY = 64


@dataclass(frozen=True, slots=True)
class ControllerEvent:
    """A change: ``stamp`` in seconds of the monotonic clock; ``restarted`` when it is the return from bus-off."""

    stamp: float
    channel: str
    condition: CanErrorState
    counters: ErrorCounters | None = None
    restarted: bool = False

    def __str__(self) -> str:
        what = f"is {self.condition.value}"
        if self.restarted:
            what = "has been restarted and takes part in the bus again: look at every node anew"
        return f"the CAN controller of {self.channel} {what}" + (
            f" ({self.counters})" if self.counters else ""
        )


class CanController:
    """Follows one controller; holds state: its condition, the newest error counters, and the last 64 events.

    Belongs to the receive thread; others may read.
    """

    def __init__(self, channel: str) -> None:
        """``channel``: its name, for the events."""
        self.condition = CanErrorState.ACTIVE
        self.counters: ErrorCounters | None = None
        self.events: deque[ControllerEvent] = deque(maxlen=HISTORY)
        self._channel = channel
        self._off_by_state = False

    def error_frame(self, error_class: int, data: bytes, stamp: float) -> ControllerEvent | None:
        """Take an error frame with Linux's class; return the event where it is a change."""
        counters = errorframe.error_counters(error_class, data)
        if counters is not None:
            self.counters = counters
        told = errorframe.condition(error_class, data)
        restart = errorframe.is_restart(error_class)  # also where the bus-off before it went unheard
        if told is None or (told is self.condition and not restart):
            return None
        self._off_by_state = False
        return self._change(told, stamp, restart)

    def state(self, off: bool, stamp: float) -> ControllerEvent | None:
        """Take what the driver's own state says: bus-off or not; return the event where it is a change."""
        if off and self.condition is not CanErrorState.OFF:
            self._off_by_state = True
            return self._change(CanErrorState.OFF, stamp)
        if not off and self._off_by_state:
            self._off_by_state = False
            return self._change(CanErrorState.ACTIVE, stamp)
        return None

    def _change(self, told: CanErrorState, stamp: float, restart: bool = False) -> ControllerEvent:
        restarted = restart or self.condition is CanErrorState.OFF
        if restarted:
            self.counters = None  # a restart clears them
        self.condition = told
        event = ControllerEvent(stamp, self._channel, told, self.counters, restarted)
        self.events.append(event)
        return event
