"""How a channel gives one frame to its adapter: through python-can, or directly into the socket of Linux's SocketCAN."""

from __future__ import annotations

import socket
from collections.abc import Sequence
from typing import Protocol

import can

from axisbus.bus.link.raw.batch import FRAME, MOST, SendBatch, available
from axisbus.cia301 import cob

# The flags in an identifier of SocketCAN (linux/can.h).
EXTENDED, REMOTE = 0x8000_0000, 0x4000_0000
_DONT_WAIT = getattr(socket, "MSG_DONTWAIT", 0)


class FrameTransmitter(Protocol):
    """One attempt for one frame; errors are raised as python-can or its driver does.

    ``for_all``: several threads may send at once, and none of them waits.
    """

    for_all: bool

    def send(self, can_id: int, data: bytes) -> None:
        """Give a data frame to the adapter."""

    def send_remote(self, can_id: int, length: int) -> None:
        """Give a remote frame to the adapter, with the data length of the requested frame."""

    def send_all(self, frames: Sequence[tuple[int, bytes]]) -> int:
        """Give data frames to the adapter without waiting; return how many it accepted, 0 if it takes one at a time.

        For one thread.
        """


class PythonCanLine:
    """Any adapter of python-can."""

    for_all = False

    def __init__(self, bus: can.BusABC, timeout: float | None) -> None:
        """``timeout``: see ``adapter.send_timeout``."""
        self._bus = bus
        self._timeout = timeout

    def send(self, can_id: int, data: bytes) -> None:
        """As ``FrameTransmitter.send``."""
        self._give(
            can.Message(arbitration_id=can_id, data=data, is_extended_id=_is_extended(can_id), check=False)
        )

    def send_remote(self, can_id: int, length: int) -> None:
        """As ``FrameTransmitter.send_remote``."""
        extended = _is_extended(can_id)
        self._give(
            can.Message(
                arbitration_id=can_id, is_extended_id=extended, is_remote_frame=True, dlc=length, check=False
            )
        )

    def send_all(self, frames: Sequence[tuple[int, bytes]]) -> int:  # noqa: ARG002
        """As ``FrameTransmitter.send_all``: this adapter takes one frame at a time."""
        return 0

    def _give(self, message: can.Message) -> None:
        self._bus.send(message, self._timeout)


class SocketCanLine:
    """The raw socket of a SocketCAN link: faster than python-can with its checks and waits, and never blocks."""

    for_all = True

    def __init__(self, raw: socket.socket) -> None:
        """``raw`` is an open CAN_RAW socket."""
        self._raw = raw
        self._send = raw.send
        self._batch = SendBatch() if available() else None

    def send(self, can_id: int, data: bytes) -> None:
        """As ``FrameTransmitter.send``."""
        try:
            self._send(FRAME.pack(_on_wire(can_id), len(data), data), _DONT_WAIT)
        except OSError as error:
            raise _failed(error) from error

    def send_remote(self, can_id: int, length: int) -> None:
        """As ``FrameTransmitter.send_remote``."""
        try:
            self._send(FRAME.pack(_on_wire(can_id) | REMOTE, length, b""), _DONT_WAIT)
        except OSError as error:
            raise _failed(error) from error

    def send_all(self, frames: Sequence[tuple[int, bytes]]) -> int:
        """As ``FrameTransmitter.send_all``, in one system call; sending a refused frame again reports the reason."""
        if self._batch is None:
            return 0
        taken = 0
        while taken < len(frames):
            some = [(_on_wire(can_id), data) for can_id, data in frames[taken : taken + MOST]]
            took = self._batch.give(self._raw, some)
            taken += took
            if took < len(some):
                break
        return taken


def _on_wire(can_id: int) -> int:
    return can_id if can_id <= cob.ID_MASK_11 else can_id | EXTENDED


def _failed(error: OSError) -> can.CanOperationError:
    return can.CanOperationError(f"Failed to transmit: {error.strerror}", error.errno)


def line_of(bus: can.BusABC, timeout: float | None) -> FrameTransmitter:
    """Return the fastest transmitter for an open adapter."""
    raw = raw_socket(bus)
    return PythonCanLine(bus, timeout) if raw is None else SocketCanLine(raw)


def raw_socket(bus: can.BusABC) -> socket.socket | None:
    """Return the socket of python-can's own SocketCAN bus; None for any other bus."""
    raw = getattr(bus, "socket", None)
    return raw if isinstance(raw, socket.socket) and type(bus).__name__ == "SocketcanBus" else None


def _is_extended(can_id: int) -> bool:
    return can_id > cob.ID_MASK_11
