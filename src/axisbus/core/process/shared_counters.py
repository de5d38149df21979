"""What a core counts, its cycles' lateness and what the bus has carried, in shared memory behind the images: no reader asks it.

Theory of operation
-------------------
``Lateness`` counts in place: a reader finds each number as it is at that moment. What the bus has carried is written after each
cycle, between two copies of its time; a reader looks again where they differ.
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
    """Return where it begins, in the memory of a machine with so many axes, and inputs and outputs."""
    return io_image.offset(axes) + io_image.size_of(points)


class SharedCounters:
    """The numbers in ``memory``, for their one writer and for any reader of any process."""

    def __init__(self, memory: mmap.mmap, axes: int, points: int) -> None:
        """``axes``, and inputs and outputs, of the machine."""
        at = offset(axes, points)
        self._memory = memory
        self._at = at + 8 * COUNTS
        self._lateness = Lateness(memoryview(memory)[at : self._at].cast("d"))

    def take(self, lateness: Lateness) -> None:
        """Let what a scan counts stand here from now on; for the thread of the scan, or before it runs."""
        lateness.share(self._lateness)

    def writer(self, carried: Callable[[], BusTraffic | None]) -> Callable[..., None]:
        """Return what notes, after each cycle, what the bus has carried."""
        pack, memory, at = _CARRIED.pack_into, self._memory, self._at

        def write(*_: object) -> None:
            now = carried()
            if now is not None:
                pack(memory, at, now.time, now.frames, now.octets, now.time)

        return write

    @property
    def lateness(self) -> LatenessReport:
        """How late the cycles were, up to now."""
        return self._lateness.report()

    @property
    def carried(self) -> BusTraffic | None:
        """What the bus had carried after the last cycle; None before the first."""
        for _ in range(_TRIES):
            time, frames, octets, again = _CARRIED.unpack_from(self._memory, self._at)
            if time == again:
                break
        return BusTraffic(time, frames, octets) if time else None
