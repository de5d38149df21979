"""Counters of a core in shared memory after the images: lateness of the cycles and bus traffic. Readers need no request.

Theory of operation
-------------------
``Lateness`` counts in place: a reader gets each number as it is at that moment. The bus traffic is written after each cycle,
between two copies of its time; if these differ, a reader reads again.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Callable

from axisbus.cia301.frame import BusTraffic
from axisbus.core.lateness import COUNTS, Lateness
from axisbus.ipc import io_image
from axisbus.session import LatenessReport

_CARRIED = struct.Struct("<dQQd")
_TRIES = 100
SIZE = 8 * COUNTS + _CARRIED.size


def offset(axes: int, points: int) -> int:
    """Return its start in the memory of a machine with these numbers of axes, and of inputs and outputs."""
    return io_image.offset(axes) + io_image.size_of(points)


class SharedCounters:
    """The counters in ``memory``, for one writer and for any reader of any process."""

    def __init__(self, memory: mmap.mmap, axes: int, points: int) -> None:
        """``axes``: number of axes of the machine; ``points``: number of inputs and outputs."""
        at = offset(axes, points)
        self._memory = memory
        self._at = at + 8 * COUNTS
        self._lateness = Lateness(memoryview(memory)[at : self._at].cast("d"))

    def take(self, lateness: Lateness) -> None:
        """Let a scan count here from now on; for the thread of the scan, or before it runs."""
        lateness.share(self._lateness)

    def writer(self, carried: Callable[[], BusTraffic | None]) -> Callable[..., None]:
        """Return a function that stores, after each cycle, the bus traffic."""
        pack, memory, at = _CARRIED.pack_into, self._memory, self._at

        def write(*_: object) -> None:
            now = carried()
            if now is not None:
                pack(memory, at, now.time, now.frames, now.octets, now.time)

        return write

    @property
    def lateness(self) -> LatenessReport:
        """The lateness of the cycles until now."""
        return self._lateness.report()

    @property
    def carried(self) -> BusTraffic | None:
        """The bus traffic after the last cycle; None before the first."""
        for _ in range(_TRIES):
            time, frames, octets, again = _CARRIED.unpack_from(self._memory, self._at)
            if time == again:
                break
        return BusTraffic(time, frames, octets) if time else None
