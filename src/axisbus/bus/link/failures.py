"""Failures of a channel as errors with the observation and the first remedy."""

from __future__ import annotations

import errno

from axisbus.bus.link import socketcan
from axisbus.bus.link.controller import WHAT_TO_CHECK, ErrorCounters
from axisbus.cpu_starvation import REMEDY
from axisbus.errors import AdapterError, BusError, BusOff, StateError, TransmitQueueFull

_RECONNECT = "reconnect (axisbus boot CELL --reconnect; in a program: machine.reconnect())"
_REOPEN = f"check the adapter's plug and whether the interface was taken down, then {_RECONNECT}, or open the machine again"


# Error codes of Linux, and Kvaser's canERR_TXBUFOFL; for other drivers the text decides.
_FULL = frozenset({errno.ENOBUFS, errno.EAGAIN, -13})
_FULL_WORDS = ("full", "buffer", "overflow", "timeout", "timed out")
_SERIAL_TIMEOUT = "SerialTimeoutException"  # of pyserial, which may not be installed


def receive_failed(name: str, error: Exception) -> AdapterError:
    """Return the error for an exception of ``recv``: nothing is received any more.

    Some drivers (PCAN's) report bus-off in this way, and work again when re-opened.
    """
    off = any(words in str(error).lower() for words in ("bus-off", "bus off", "busoff"))
    failure = AdapterError(
        f"the CAN adapter {name} stopped receiving" + (": its controller went bus-off" if off else ""),
        observed=f"{type(error).__name__}: {error}",
        remedy=f"check {WHAT_TO_CHECK}; then {_RECONNECT}, or open the machine again" if off else _REOPEN,
    )
    failure.__cause__ = error
    return failure


def link_gone(name: str, error: Exception) -> AdapterError:
    """Return the error for an exception of ``send`` that no later attempt can cure."""
    failure = AdapterError(
        f"the CAN adapter {name} failed while sending",
        observed=f"{type(error).__name__}: {error}",
        remedy=_REOPEN,
    )
    failure.__cause__ = error
    return failure


def refused(name: str, can_id: int, patience: float, error: Exception) -> TransmitQueueFull:
    """Return the error for an adapter that accepted no frame for ``patience`` seconds."""
    link = name.removeprefix("socketcan:")
    remedy = "check that another node is on the bus and acknowledges (power, bitrate, termination), and the bus load"
    if link != name:
        remedy += f"; a longer queue helps against bursts: sudo ip link set {link} txqueuelen 1000"
    why = ": its transmit queue is full" if is_full(error) else ""
    return TransmitQueueFull(
        f"the CAN adapter {name} refused frame {can_id:03X}h for {patience * 1000:.0f} ms{why}",
        observed=str(error),
        remedy=remedy,
    )


def is_full(error: Exception) -> bool:
    """Whether a driver refused a frame because its queue is full, by its error code or its text."""
    if isinstance(error, TimeoutError | BlockingIOError) or type(error).__name__ == _SERIAL_TIMEOUT:
        return True
    words = str(error).lower()
    return getattr(error, "error_code", None) in _FULL or any(word in words for word in _FULL_WORDS)


def stuck(name: str, seconds: float) -> AdapterError:
    """Return the error for a send of another thread that has not returned."""
    return AdapterError(
        f"the CAN adapter {name} is stuck in its driver",
        observed=f"it has not accepted a frame for {seconds:g} s",
        remedy="pull the adapter out and plug it in again, update its driver, then open the machine again",
    )


def inherited(name: str) -> AdapterError:
    """Return the error for a copy of the channel in a forked child."""
    return AdapterError(
        f"the CAN channel {name} belongs to the process that opened it",
        observed="this process was forked from that one; if both used the adapter, two masters would be on the bus",
        remedy="use it in the process that opened it; start worker processes before that, or with the start method 'spawn'",
    )


def starved(name: str, seconds: float) -> AdapterError:
    """Return the error for a send of another thread that has not returned while neither thread got processor time."""
    return AdapterError(
        f"this program hardly ran for {seconds:.2g} s: a frame could not be given to the CAN adapter {name}",
        observed="the thread that sent the previous frame did not run; the adapter is possibly not the cause",
        remedy=f"{REMEDY}; then open the machine again",
    )


def bus_off(name: str, counters: ErrorCounters | None = None) -> BusOff:
    """Return the error for a controller that is bus-off."""
    return BusOff(
        f"the CAN controller of {name} went bus-off: it no longer takes part in the bus",
        observed="its transmit error counter rose above 255"
        + (f"; its last counters before: {counters}" if counters else ""),
        remedy=f"check {WHAT_TO_CHECK}; then {_restart(name)}",
    )


def reopened(name: str) -> BusOff:
    """Return the error with which the nodes count as lost after their adapter was opened again."""
    return BusOff(
        f"the CAN adapter {name} was lost, and has been opened again",
        observed="what the nodes did meanwhile is not known",
        remedy="boot each node",
    )


def not_reopened(name: str, why: str) -> StateError:
    """Return the error of a channel that cannot, or need not, be opened again."""
    return StateError(f"the CAN adapter {name} is not opened again: {why}")


def _restart(name: str) -> str:
    """Return the text on how the controller is restarted: by Linux automatically or on command, by other drivers on opening."""
    link = name.removeprefix("socketcan:")
    if link == name:
        return (
            f"{_RECONNECT}, which resets the adapter; or close the machine and open it again (some drivers restart it "
            "automatically)"
        )
    return (
        f"restart the controller: {socketcan.restart_command(link)} (Linux does so automatically if the link has "
        "restart-ms)"
    )


def receiver_failed(can_id: int, data: bytes, error: Exception) -> BusError:
    """Return the error for an exception of a frame's receiver; the traceback is that of the cause."""
    failure = BusError(
        f"the receiver of frame {can_id:03X}h failed",
        observed=f"{type(error).__name__}: {error}; data {data.hex(' ') or 'empty'}",
        remedy="a receiver must accept every frame; the traceback of the cause shows where it failed",
    )
    failure.__cause__ = error
    return failure
