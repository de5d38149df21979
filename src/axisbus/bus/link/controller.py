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
from enum import Enum
from typing import NamedTuple

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
        counters = error_counters(error_class, data)
        if counters is not None:
            self.counters = counters
        reported = condition(error_class, data)
        restart = is_restart(error_class)  # also if the bus-off before it was not received
        if reported is None or (reported is self.condition and not restart):
            return None
        self._off_by_state = False
        return self._change(reported, stamp, restart)

    def state(self, off: bool, stamp: float) -> ControllerEvent | None:
        """Evaluate the driver's own state: bus-off or not; return the event if the state has changed."""
        if off and self.condition is not CanErrorState.OFF:
            self._off_by_state = True
            return self._change(CanErrorState.OFF, stamp)
        if not off and self._off_by_state:
            self._off_by_state = False
            return self._change(CanErrorState.ACTIVE, stamp)
        return None

    def reopened(self, stamp: float) -> ControllerEvent:
        """Note that the adapter was opened again; return the event."""
        self._off_by_state = False
        return self._change(CanErrorState.ACTIVE, stamp, restart=True)

    def _change(self, reported: CanErrorState, stamp: float, restart: bool = False) -> ControllerEvent:
        restarted = restart or self.condition is CanErrorState.OFF
        if restarted:
            self.counters = None  # a restart clears them
        self.condition = reported
        event = ControllerEvent(stamp, self._channel, reported, self.counters, restarted)
        self.events.append(event)
        return event


# -- Meaning of an error frame of the CAN controller (classes of Linux's can/error.h, which python-can passes on) ------


# Interfaces whose error frames have Linux's class as identifier; others use the identifier differently.
LINUX_CLASSES = frozenset({"socketcan", "gs_usb"})


WHAT_TO_CHECK = "bit rate, wiring (CAN-H, CAN-L, ground) and the two 120 Ω terminations"


_BUS_OFF = 0x40
_CONTROLLER = 0x04
_RESTARTED = 0x100
_COUNTERS = 0x200  # by this, the kernel (since 6.0) indicates that data bytes 6 and 7 hold them
_STATUS, _SENDING, _RECEIVING = 1, 6, 7  # data bytes


_CLASSES = (
    (_BUS_OFF, "bus-off"),
    (0x20, "no acknowledge: no other node receives at this bitrate"),
    (0x01, "transmit time-out"),
    (0x02, "lost arbitration"),
    (0x08, "protocol violation: another bitrate on the bus, or bad wiring"),
    (0x10, "transceiver: a line is broken or shorted"),
    (0x80, "bus error"),
    (_RESTARTED, "controller restarted"),
)


# Data byte 1 of the class "controller".
_CONTROLLER_BITS = (
    (0x01, "receive buffer overflow"),
    (0x02, "transmit buffer overflow"),
    (0x04, "receive errors (warning)"),
    (0x08, "transmit errors (warning)"),
    (0x10, "receive errors (passive)"),
    (0x20, "transmit errors (passive)"),
    (0x40, "back to error active"),
)


class CanErrorState(Enum):
    """States of a controller by its error counters (ISO 11898-1; a warning is error active with a counter from 96 on)."""

    ACTIVE = "error active"
    WARNING = "error warning"
    PASSIVE = "error passive"
    OFF = "bus-off"


# Bits of data byte 1, the worst first: a frame may hold several.
_CONDITIONS = (
    (0x30, CanErrorState.PASSIVE),
    (0x0C, CanErrorState.WARNING),
    (0x40, CanErrorState.ACTIVE),
)


class ErrorCounters(NamedTuple):
    """The controller's error counters; above 255 transmit errors it is bus-off, which a byte does not hold."""

    transmit: int
    receive: int

    def __str__(self) -> str:
        return f"transmit errors {self.transmit}, receive errors {self.receive}"


def condition(error_class: int, data: bytes) -> CanErrorState | None:
    """Return the controller's state by the frame; None if the frame reports something else."""
    if error_class & _BUS_OFF:
        return CanErrorState.OFF
    if error_class & _CONTROLLER and len(data) > _STATUS:
        found = next((worst for bits, worst in _CONDITIONS if data[_STATUS] & bits), None)
        if found is not None:
            return found
    return CanErrorState.ACTIVE if error_class & _RESTARTED else None


def is_restart(error_class: int) -> bool:
    """Whether the frame reports a restart of the controller, which therefore was bus-off."""
    return bool(error_class & _RESTARTED)


def error_counters(error_class: int, data: bytes) -> ErrorCounters | None:
    """Return the error counters in the frame; None if it has none (older kernels do not indicate this, and leave them 0)."""
    if len(data) <= _RECEIVING or not error_class & (_COUNTERS | _CONTROLLER):
        return None
    found = ErrorCounters(data[_SENDING], data[_RECEIVING])
    return found if error_class & _COUNTERS or any(found) else None


def kind(error_class: int, data: bytes) -> str:
    """Return the frame's meaning as text without numbers; ``error frame`` for adapters that report no class."""
    texts = [text for bit, text in _CLASSES if error_class & bit]
    if error_class & _CONTROLLER and len(data) > _STATUS:
        texts += [text for bit, text in _CONTROLLER_BITS if data[_STATUS] & bit]
    return ", ".join(texts) or "error frame"


def describe(error_class: int, data: bytes) -> str:
    """Return the frame's meaning as text, with the error counters if it has them."""
    counters = error_counters(error_class, data)
    return kind(error_class, data) + (f" ({counters})" if counters is not None else "")
