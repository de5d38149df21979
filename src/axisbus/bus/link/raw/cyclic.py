"""Frames that the scan reads itself, when it has sent SYNC: a second socket on the SocketCAN link, for their COB-IDs alone.

Theory of operation
-------------------
A receive thread is woken for each frame, takes the interpreter from whoever has it, and gives it back: for the TPDOs of a dozen
drives, all within a millisecond, that costs more than the frames themselves. These the kernel keeps, in a socket whose filter lets
nothing else through, until the scan asks for them; the channel's own socket gets a filter that leaves them out. When they came, the
kernel tells by a clock that may be set, which the monotonic one may not: so no stamp lies before the last look, or after this one.

Where a link has no such socket (any adapter but SocketCAN, another system), the receive thread brings these frames as any other.
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
_FILTERS = 512  # filters of a socket
_WHOLE = 8  # data bytes of a frame that is full

Taken = tuple[int, bytes, float]


class CyclicSocket:
    """The frames of some COB-IDs, which the kernel knows; holds state: when it looked last. ``drain`` is for one thread."""

    def __init__(self, raw: socket.socket, others: socket.socket | None) -> None:
        """``raw`` is a CAN_RAW socket that does not block, ``others`` the one that is to leave these frames out."""
        self._raw = raw
        self._others = others
        self._batch = ReceiveBatch()
        self._looked = time.monotonic()

    def listen(self, can_ids: Collection[int]) -> bool:
        """Let exactly these COB-IDs come here, each of 11 bits; return whether the kernel does so.

        Safe at any time: for a moment a frame may come both ways.
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
        """Return COB-ID, data and monotonic time of reception of each frame that has come, oldest first; does not block.

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
    """Return filters, as identifier and mask, that let every frame through but data frames of these COB-IDs of 11 bits.

    Whole blocks of identifiers, and not the kernel's inverted filters joined: those would keep error frames away as well.
    """
    extended, remote = (EXTENDED, EXTENDED), (REMOTE, EXTENDED | REMOTE)
    return [*_blocks(frozenset(can_ids), 0, cob.ID_MASK_11 + 1), extended, remote]


def _blocks(can_ids: Collection[int], first: int, size: int) -> list[tuple[int, int]]:
    """Return the filters of the ``size`` (a power of two) identifiers from ``first`` on, less ``can_ids``, which all lie there."""
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
    """Open a second socket on a SocketCAN link; None where this is none, or Linux does not let us."""
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
