"""State of a channel's CAN controller as events: error active, warning, passive, bus-off and back again.

Theory of operation
-------------------
Linux reports every change by an error frame, with its class in the identifier. Drivers of some other adapters report bus-off only
by the bus object's ``state``, which the channel polls. This module handles both; each change is an event.

Only a restart ends bus-off, never one of the frames that came before it. Linux reports a restart (by ``restart-ms`` or by hand) in
a frame of its own, some drivers by the controller's new condition. So each other condition reported during bus-off means a restart.
A bus-off that was detected by ``state`` also ends by ``state``.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from axisbus.bus.link import errorframe
from axisbus.bus.link.errorframe import CanErrorState, ErrorCounters

HISTORY = 64


@dataclass(frozen=True, slots=True)
class ControllerEvent:
    """A change of state; ``stamp`` in seconds of the monotonic clock; ``restarted``: return from bus-off."""

    stamp: float
    channel: str
    condition: CanErrorState
    counters: ErrorCounters | None = None
    restarted: bool = False

    def __str__(self) -> str:
        what = f"is {self.condition.value}"
        if self.restarted:
            what = "has been restarted and takes part in the bus again: check every node again"
        return f"the CAN controller of {self.channel} {what}" + (
            f" ({self.counters})" if self.counters else ""
        )


class CanController:
    """Follows one controller; holds state: its condition, the newest error counters, and the last 64 events.

    Only the receive thread may write; other threads may read.
    """

    def __init__(self, channel: str) -> None:
        """``channel``: its name, for the events."""
        self.condition = CanErrorState.ACTIVE
        self.counters: ErrorCounters | None = None
        self.events: deque[ControllerEvent] = deque(maxlen=HISTORY)
        self._channel = channel
        self._off_by_state = False

    def error_frame(self, error_class: int, data: bytes, stamp: float) -> ControllerEvent | None:
        """Evaluate an error frame with Linux's class; return the event if the state has changed."""
        counters = errorframe.error_counters(error_class, data)
        if counters is not None:
            self.counters = counters
        told = errorframe.condition(error_class, data)
        restart = errorframe.is_restart(error_class)  # also if the bus-off before it was not received
        if told is None or (told is self.condition and not restart):
            return None
        self._off_by_state = False
        return self._change(told, stamp, restart)

    def state(self, off: bool, stamp: float) -> ControllerEvent | None:
        """Evaluate the driver's own state: bus-off or not; return the event if the state has changed."""
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
