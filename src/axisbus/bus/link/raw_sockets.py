"""How a channel gives one frame to its adapter: through python-can, or directly into the socket of Linux's SocketCAN."""

from __future__ import annotations

import select
import socket
import struct
import time
from collections.abc import Collection, Sequence
from contextlib import suppress
from typing import Protocol

import can

from axisbus.bus.link.frame_batch import FRAME, MOST, ReceiveBatch, Received, SendBatch, available
from axisbus.cia301 import cob

# The flags in an identifier of SocketCAN (linux/can.h).
EXTENDED, REMOTE = 0x8000_0000, 0x4000_0000
_DONT_WAIT = getattr(socket, "MSG_DONTWAIT", 0)


class FrameTransmitter(Protocol):
    """One attempt for one frame; errors are raised as python-can or its driver does.

    ``thread_safe``: several threads may send at once, and none of them waits.
    """

    thread_safe: bool

    def send(self, can_id: int, data: bytes) -> None:
        """Give a data frame to the adapter."""

    def send_remote(self, can_id: int, length: int) -> None:
        """Give a remote frame to the adapter, with the data length of the requested frame."""

    def send_all(self, frames: Sequence[tuple[int, bytes]]) -> int:
        """Give data frames to the adapter without waiting; return how many it accepted, 0 if it takes one at a time.

        For one thread.
        """


class PythonCanTransmitter:
    """Any adapter of python-can."""

    thread_safe = False

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


class SocketCanTransmitter:
    """The raw socket of a SocketCAN link: faster than python-can with its checks and waits, and never blocks."""

    thread_safe = True

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
            batch = [(_on_wire(can_id), data) for can_id, data in frames[taken : taken + MOST]]
            accepted = self._batch.send_batch(self._raw, batch)
            taken += accepted
            if accepted < len(batch):
                break
        return taken


def _on_wire(can_id: int) -> int:
    return can_id if can_id <= cob.ID_MASK_11 else can_id | EXTENDED


def _failed(error: OSError) -> can.CanOperationError:
    return can.CanOperationError(f"Failed to transmit: {error.strerror}", error.errno)


def transmitter_of(bus: can.BusABC, timeout: float | None) -> FrameTransmitter:
    """Return the fastest transmitter for an open adapter."""
    raw = raw_socket(bus)
    return PythonCanTransmitter(bus, timeout) if raw is None else SocketCanTransmitter(raw)


def raw_socket(bus: can.BusABC) -> socket.socket | None:
    """Return the socket of python-can's own SocketCAN bus; None for any other bus."""
    raw = getattr(bus, "socket", None)
    return raw if isinstance(raw, socket.socket) and type(bus).__name__ == "SocketcanBus" else None


def _is_extended(can_id: int) -> bool:
    return can_id > cob.ID_MASK_11


# ----------------------------------------------------------------------------------------------------------------------
# How a channel's receive thread gets frames: through python-can, or all received frames with one call of Linux's SocketCAN.


_ERROR = 0x2000_0000  # linux/can.h
_ID_29 = 0x1FFF_FFFF
_GONE = select.POLLHUP | select.POLLERR | select.POLLNVAL if hasattr(select, "POLLHUP") else 0


PlainFrame = tuple[int, bytes, float]


"""A data frame with 11 bits of identifier: COB-ID, data, and the adapter's own time (s)."""


class RawFrameSource(Protocol):
    """Source of frames; for one thread."""

    def take(self, seconds: float) -> Sequence[PlainFrame | can.Message]:
        """Return the received frames, waiting up to ``seconds`` for the first; frames that are not ``PlainFrame`` as a message.

        Raises the exceptions of the driver if the channel is gone.
        """


class PythonCanSource:
    """Any adapter of python-can: one frame at a time."""

    def __init__(self, bus: can.BusABC) -> None:
        self._bus = bus

    def take(self, seconds: float) -> Sequence[can.Message]:
        """As ``RawFrameSource.take``."""
        message = self._bus.recv(seconds)
        return () if message is None else (message,)


class SocketCanSource:
    """The raw socket of a SocketCAN link: frames that came together (such as all heartbeats) cost one wake-up."""

    def __init__(self, raw: socket.socket) -> None:
        """``raw`` is an open CAN_RAW socket for classic frames."""
        self._raw, self._batch = raw, ReceiveBatch()
        self._poll = select.poll()
        self._poll.register(raw, select.POLLIN)

    def take(self, seconds: float) -> Sequence[PlainFrame | can.Message]:
        """As ``RawFrameSource.take``.

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


def frame_source_of(bus: can.BusABC) -> RawFrameSource:
    """Return the fastest source for an open adapter's frames."""
    raw = raw_socket(bus)
    classic = getattr(bus, "protocol", None) is can.CanProtocol.CAN_20
    return SocketCanSource(raw) if raw is not None and classic and available() else PythonCanSource(bus)


# -- Frames that the scan reads itself after SYNC: a second socket on the SocketCAN link, for their COB-IDs only -------
#
# Theory of operation
# A receive thread wakes up for each frame, takes the interpreter from another thread, and returns it. For the TPDOs of a dozen
# drives, all within a millisecond, that costs more than the frames themselves. The kernel therefore collects these frames in a
# socket whose filter passes no others, until the scan reads them. The channel's own socket gets a filter that excludes them. The
# kernel stamps the frames with a clock that may be set, in contrast to the monotonic clock. So a stamp is limited to the time
# between the last read and this one.
#
# If a link has no such socket (any adapter but SocketCAN, another system), the receive thread reads these frames like any other.


_FILTER = struct.Struct("=II")
_EXACTLY = EXTENDED | REMOTE | cob.ID_MASK_11  # a data frame with 11 bits of identifier
_CAN_RAW, _CAN_RAW_FILTER = 101, 1  # linux/can/raw.h
_SO_TIMESTAMPNS = 35  # asm-generic/socket.h
_FILTERS = 512  # maximum filters of a socket
_WHOLE = 8  # data bytes of a full frame


CyclicFrame = tuple[int, bytes, float]


class CyclicSocket:
    """The frames of some COB-IDs, which the kernel filters; holds state: the time of the last read. ``drain`` is for one thread."""

    def __init__(self, raw: socket.socket, others: socket.socket | None) -> None:
        """``raw`` is a non-blocking CAN_RAW socket, ``others`` the socket that must exclude these frames."""
        self._raw = raw
        self._others = others
        self._batch = ReceiveBatch()
        self._last_drain = time.monotonic()

    def listen(self, can_ids: Collection[int]) -> bool:
        """Receive exactly these 11-bit COB-IDs here; return whether the kernel accepts the filters.

        Safe at any time: for a moment a frame may arrive at both sockets.
        """
        here = [(can_id, _EXACTLY) for can_id in can_ids]
        elsewhere = all_but(can_ids)
        if max(len(here), len(elsewhere)) > _FILTERS:
            return False
        try:
            self._raw.setsockopt(_CAN_RAW, _CAN_RAW_FILTER, _packed(here))
            if self._others is not None:
                self._others.setsockopt(_CAN_RAW, _CAN_RAW_FILTER, _packed(elsewhere))
        except OSError:
            return False
        return True

    def drain(self) -> list[CyclicFrame]:
        """Return COB-ID, data and monotonic time of reception of each received frame, oldest first; does not block.

        Raises:
            OSError: the link is down or gone.
        """
        now = time.monotonic()
        since, self._last_drain = self._last_drain, now
        ahead = time.time() - now
        taken: list[CyclicFrame] = []
        while True:
            frames = self._batch.take(self._raw)
            for can_id, length, data, seconds, nanoseconds in frames:
                stamp = now
                if seconds:
                    came = seconds + nanoseconds * 1e-9 - ahead
                    if came < now:
                        stamp = came if came > since else since
                taken.append((can_id, data if length == _WHOLE else data[:length], stamp))
            if len(frames) < MOST:
                return taken

    def close(self) -> None:
        """Release the socket."""
        self._raw.close()


def all_but(can_ids: Collection[int]) -> list[tuple[int, int]]:
    """Return filters, as identifier and mask, that pass every frame except data frames of these 11-bit COB-IDs.

    The filters are whole blocks of identifiers, not the kernel's joined inverted filters, which would exclude error frames as well.
    """
    extended, remote = (EXTENDED, EXTENDED), (REMOTE, EXTENDED | REMOTE)
    return [*_blocks(frozenset(can_ids), 0, cob.ID_MASK_11 + 1), extended, remote]


def _blocks(can_ids: Collection[int], first: int, size: int) -> list[tuple[int, int]]:
    """Return filters for the ``size`` (a power of two) identifiers from ``first`` on except ``can_ids``, which all lie there."""
    if not can_ids:
        return [(first, _EXACTLY & ~(size - 1))]
    if len(can_ids) == size:
        return []
    half = size // 2
    low = [can_id for can_id in can_ids if can_id < first + half]
    high = [can_id for can_id in can_ids if can_id >= first + half]
    return _blocks(low, first, half) + _blocks(high, first + half, half)


def _packed(filters: Collection[tuple[int, int]]) -> bytes:
    return b"".join(_FILTER.pack(can_id, mask) for can_id, mask in filters)


def cyclic_socket(bus: can.BusABC, link: str) -> CyclicSocket | None:
    """Open a second socket on a SocketCAN link; None for another interface, or if Linux does not permit it."""
    others = raw_socket(bus)
    if others is None or not available():
        return None
    raw = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
    made = CyclicSocket(raw, others)
    with suppress(OSError):
        raw.setblocking(False)
        raw.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        if made.listen(()):
            raw.bind((link,))
            return made
    made.close()
    return None
