"""How a channel's receive thread gets frames: through python-can, or all received frames with one call of Linux's SocketCAN."""

from __future__ import annotations

import select
import socket
from collections.abc import Sequence
from typing import Protocol

import can

from axisbus.bus.link.raw.batch import ReceiveBatch, Received, available
from axisbus.bus.link.raw.transmitter import EXTENDED, REMOTE, raw_socket
from axisbus.cia301 import cob

_ERROR = 0x2000_0000  # linux/can.h
_ID_29 = 0x1FFF_FFFF
_GONE = select.POLLHUP | select.POLLERR | select.POLLNVAL if hasattr(select, "POLLHUP") else 0

Plain = tuple[int, bytes, float]
"""A data frame with 11 bits of identifier: COB-ID, data, and the adapter's own time (s)."""


class Intake(Protocol):
    """Source of frames; for one thread."""

    def take(self, seconds: float) -> Sequence[Plain | can.Message]:
        """Return the received frames, waiting up to ``seconds`` for the first; frames that are not ``Plain`` as a message.

        Raises the exceptions of the driver if the channel is gone.
        """


class PythonCanIntake:
    """Any adapter of python-can: one frame at a time."""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus

    def take(self, seconds: float) -> Sequence[can.Message]:
        """As ``Intake.take``."""
        message = self._bus.recv(seconds)
        return () if message is None else (message,)


class SocketCanIntake:
    """The raw socket of a SocketCAN link: frames that came together (such as all heartbeats) cost one wake-up."""

    def __init__(self, raw: socket.socket) -> None:
        """``raw`` is an open CAN_RAW socket for classic frames."""
        self._raw, self._batch = raw, ReceiveBatch()
        self._poll = select.poll()
        self._poll.register(raw, select.POLLIN)

    def take(self, seconds: float) -> Sequence[Plain | can.Message]:
        """As ``Intake.take``.

        Raises:
            OSError: the link is down or gone.
        """
        found = self._poll.poll(seconds * 1000.0)
        if not found:
            return ()
        frames = self._batch.take(self._raw)  # raises if the link has failed, too
        if not frames and found[0][1] & _GONE:
            raise ConnectionResetError("no program is at the other end")
        return [
            (frame[0], frame[2][: frame[1]], frame[3] + frame[4] * 1e-9)
            if frame[0] <= cob.ID_MASK_11
            else _message(frame)
            for frame in frames
        ]


def _message(frame: Received) -> can.Message:
    wire_id, length, data, seconds, nanoseconds = frame
    return can.Message(
        timestamp=seconds + nanoseconds * 1e-9,
        arbitration_id=wire_id & _ID_29,
        is_extended_id=bool(wire_id & EXTENDED),
        is_remote_frame=bool(wire_id & REMOTE),
        is_error_frame=bool(wire_id & _ERROR),
        dlc=length,
        data=b"" if wire_id & REMOTE else data[:length],
    )


def intake_of(bus: can.BusABC) -> Intake:
    """Return the fastest source for an open adapter's frames."""
    raw = raw_socket(bus)
    classic = getattr(bus, "protocol", None) is can.CanProtocol.CAN_20
    return SocketCanIntake(raw) if raw is not None and classic and available() else PythonCanIntake(bus)
