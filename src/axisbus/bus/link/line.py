"""How a channel gives one frame to its adapter: through python-can, or straight into the socket of Linux's SocketCAN."""

from __future__ import annotations

import socket
import struct
from typing import Protocol

import can

from axisbus.cia301 import cob

# struct can_frame and the flags in its identifier (linux/can.h).
FRAME = struct.Struct("=IB3x8s")
EXTENDED, REMOTE = 0x8000_0000, 0x4000_0000
_DONT_WAIT = getattr(socket, "MSG_DONTWAIT", 0)


class Line(Protocol):
    """One attempt for one frame; whatever goes wrong is raised as python-can does, or its driver.

    ``for_all``: several threads may send at once, and none of them waits.
    """

    for_all: bool

    def send(self, can_id: int, data: bytes) -> None:
        """Give a data frame to the adapter."""

    def send_remote(self, can_id: int, length: int) -> None:
        """Give it a remote frame, with the data length of the frame that it asks for."""


class PythonCanLine:
    """Any adapter that python-can knows."""

    for_all = False

    def __init__(self, bus: can.BusABC, timeout: float | None) -> None:
        """``timeout``: see ``adapter.send_timeout``."""
        self._bus = bus
        self._timeout = timeout

    def send(self, can_id: int, data: bytes) -> None:
        """As ``Line.send``."""
        self._give(
            can.Message(arbitration_id=can_id, data=data, is_extended_id=_is_extended(can_id), check=False)
        )

    def send_remote(self, can_id: int, length: int) -> None:
        """As ``Line.send_remote``."""
        extended = _is_extended(can_id)
        self._give(
            can.Message(
                arbitration_id=can_id, is_extended_id=extended, is_remote_frame=True, dlc=length, check=False
            )
        )

    def _give(self, message: can.Message) -> None:
        self._bus.send(message, self._timeout)


class SocketCanLine:
    """The raw socket of a SocketCAN link: a frame costs a fraction of what python-can's checks and waits do, and never blocks."""

    for_all = True

    def __init__(self, raw: socket.socket) -> None:
        """``raw`` is an open CAN_RAW socket."""
        self._send = raw.send

    def send(self, can_id: int, data: bytes) -> None:
        """As ``Line.send``."""
        wire_id = can_id if can_id <= cob.ID_MASK_11 else can_id | EXTENDED
        try:
            self._send(FRAME.pack(wire_id, len(data), data), _DONT_WAIT)
        except OSError as error:
            raise _failed(error) from error

    def send_remote(self, can_id: int, length: int) -> None:
        """As ``Line.send_remote``."""
        wire_id = can_id if can_id <= cob.ID_MASK_11 else can_id | EXTENDED
        try:
            self._send(FRAME.pack(wire_id | REMOTE, length, b""), _DONT_WAIT)
        except OSError as error:
            raise _failed(error) from error


def _failed(error: OSError) -> can.CanOperationError:
    return can.CanOperationError(f"Failed to transmit: {error.strerror}", error.errno)


def line_of(bus: can.BusABC, timeout: float | None) -> Line:
    """Return the quickest way to an open adapter."""
    raw = raw_socket(bus)
    return PythonCanLine(bus, timeout) if raw is None else SocketCanLine(raw)


def raw_socket(bus: can.BusABC) -> socket.socket | None:
    """Return the socket of python-can's own SocketCAN bus; None where the bus is another."""
    raw = getattr(bus, "socket", None)
    return raw if isinstance(raw, socket.socket) and type(bus).__name__ == "SocketcanBus" else None


def _is_extended(can_id: int) -> bool:
    return can_id > cob.ID_MASK_11
