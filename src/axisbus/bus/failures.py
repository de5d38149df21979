"""What can be wrong with a channel, as errors that say what was seen and what to do first."""

from __future__ import annotations

import can

from axisbus.errors import AdapterError, BusError

_REOPEN = "check the adapter's plug and whether the interface was taken down, then open the machine again"


def deaf(name: str, error: Exception) -> AdapterError:
    """``recv`` raised: nothing is heard any more."""
    failure = AdapterError(
        f"the CAN adapter {name} stopped receiving",
        observed=f"{type(error).__name__}: {error}",
        remedy=_REOPEN,
    )
    failure.__cause__ = error
    return failure


def link_gone(name: str, error: Exception) -> AdapterError:
    """``send`` raised something that no later attempt can cure."""
    failure = AdapterError(
        f"the CAN adapter {name} failed while sending",
        observed=f"{type(error).__name__}: {error}",
        remedy=_REOPEN,
    )
    failure.__cause__ = error
    return failure


def refused(name: str, message: can.Message, patience: float, error: Exception) -> AdapterError:
    """The queue stayed full for ``patience`` seconds."""
    link = name.removeprefix("socketcan:")
    remedy = "check that another node is on the bus and acknowledges (power, bitrate, termination), and the bus load"
    if link != name:
        remedy += f"; a longer queue helps against bursts: sudo ip link set {link} txqueuelen 1000"
    return AdapterError(
        f"the CAN adapter {name} refused frame {message.arbitration_id:03X}h for {patience * 1000:.0f} ms",
        observed=str(error),
        remedy=remedy,
    )


def stuck(name: str, seconds: float) -> AdapterError:
    """A send of another thread has not returned."""
    return AdapterError(
        f"the CAN adapter {name} is stuck in its driver",
        observed=f"a frame that was given to it {seconds:g} s ago has not been taken",
        remedy="pull the adapter out and plug it in again, update its driver, then open the machine again",
    )


def bus_off(name: str) -> AdapterError:
    """The controller left the bus."""
    link = name.removeprefix("socketcan:")
    restart = f"; then sudo ip link set {link} type can restart" if link != name else ""
    return AdapterError(
        f"the CAN controller of {name} went bus-off: it no longer takes part in the bus",
        observed="its transmit error counter went past 255",
        remedy=f"check bitrate, wiring (CAN-H, CAN-L, ground) and the two 120 Ω terminations{restart}",
    )


def receiver_failed(can_id: int, data: bytes, error: Exception) -> BusError:
    """Who was to get a frame raised; the traceback is that of the cause."""
    failure = BusError(
        f"the receiver of frame {can_id:03X}h failed",
        observed=f"{type(error).__name__}: {error}; data {data.hex(' ') or 'empty'}",
        remedy="a receiver must take any frame; the traceback of the cause says where it broke",
    )
    failure.__cause__ = error
    return failure
