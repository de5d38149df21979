"""Frames that the scan reads itself after SYNC: a second socket on the SocketCAN link, for their COB-IDs only.

Theory of operation
-------------------
A receive thread wakes up for each frame, takes the interpreter from another thread, and returns it. For the TPDOs of a dozen
drives, all within a millisecond, that costs more than the frames themselves. The kernel therefore collects these frames in a socket
whose filter passes no others, until the scan reads them. The channel's own socket gets a filter that excludes them. The kernel
stamps the frames with a clock that may be set, in contrast to the monotonic clock. So a stamp is limited to the time between the
last read and this one.

If a link has no such socket (any adapter but SocketCAN, another system), the receive thread reads these frames like any other.
"""

from __future__ import annotations

import socket
import struct
import time
from collections.abc import Collection
from contextlib import suppress

import can

from axisbus.bus.link.raw.batch import MOST, ReceiveBatch, available
from axisbus.bus.link.raw.transmitter import EXTENDED, REMOTE, raw_socket
from axisbus.cia301 import cob

_FILTER = struct.Struct("=II")
_EXACTLY = EXTENDED | REMOTE | cob.ID_MASK_11  # a data frame with 11 bits of identifier
_CAN_RAW, _CAN_RAW_FILTER = 101, 1  # linux/can/raw.h
_SO_TIMESTAMPNS = 35  # asm-generic/socket.h
_FILTERS = 512  # maximum filters of a socket
_WHOLE = 8  # data bytes of a full frame

Taken = tuple[int, bytes, float]


class CyclicSocket:
    """The frames of some COB-IDs, which the kernel filters; holds state: the time of the last read. ``drain`` is for one thread."""

    def __init__(self, raw: socket.socket, others: socket.socket | None) -> None:
        """``raw`` is a non-blocking CAN_RAW socket, ``others`` the socket that must exclude these frames."""
        self._raw = raw
        self._others = others
        self._batch = ReceiveBatch()
        self._looked = time.monotonic()

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

    def drain(self) -> list[Taken]:
        """Return COB-ID, data and monotonic time of reception of each received frame, oldest first; does not block.

        Raises:
            OSError: the link is down or gone.
        """
        now = time.monotonic()
        since, self._looked = self._looked, now
        ahead = time.time() - now
        taken: list[Taken] = []
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
