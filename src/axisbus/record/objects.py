"""Read objects for a recording by SDO, one after the other, as often as a small share of the bus load permits."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence

from axisbus.cia301.datatypes import Value
from axisbus.errors import SdoError
from axisbus.record.events import Watched
from axisbus.record.object_selection import WantedObject

_SHARE = 0.05  # of the bus load
_BITS = 260  # of a request and its answer, with stuff bits
_SLOWEST = 125_000  # bit/s, if the cell file has no bit rate


class ObjectReads:
    """Read the requested objects in turn; holds the number of reads of each, and when the next is due. For one thread."""

    def __init__(self, machine: Watched, wanted: Sequence[WantedObject]) -> None:
        self._machine = machine
        self._wanted = list(wanted)
        self._counts = {one.label: 0 for one in wanted}
        self._interval = _BITS / (machine.cell.bus.bitrate or _SLOWEST) / _SHARE
        self._due = 0.0
        self._next = 0

    def wait(self, most: float) -> float:
        """Return the seconds until the next read, at most ``most``."""
        return most if not self._wanted else min(most, max(0.0, self._due - time.monotonic()))

    def read_next(self) -> tuple[str, Value | None] | None:
        """Read the object that is due and return its label and value (None: no answer); None if none is due. Blocks."""
        if not self._wanted or time.monotonic() < self._due:
            return None
        one = self._wanted[self._next]
        self._next = (self._next + 1) % len(self._wanted)
        self._due = time.monotonic() + self._interval
        return one.label, self._read(one)

    def read_all(self) -> Iterator[tuple[str, Value | None]]:
        """Read all objects now: in virtual time, a read takes no time and sends no frames."""
        for one in self._wanted:
            yield one.label, self._read(one)

    def _read(self, one: WantedObject) -> Value | None:
        try:
            value: Value | None = self._machine.node(one.node).sdo[one.index, one.subindex]
        except SdoError:
            value = None
        self._counts[one.label] += value is not None
        return one.means(value)

    @property
    def reads(self) -> Mapping[str, int]:
        """The number of reads of each object."""
        return self._counts
