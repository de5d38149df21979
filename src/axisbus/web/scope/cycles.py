"""Buffer the last cycles of a machine for slow pages; the oldest are dropped and counted as lost."""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from itertools import islice
from typing import NamedTuple

from axisbus.motion.snapshot import Snapshot
from axisbus.record.columns import AxisForm
from axisbus.record.sample_packing import sample_of

KEPT = 4096  # cycles: 4 s at 1 kHz

Row = tuple[float | str | bool | None, ...]


class ScopeCycle:
    """One cycle: its ``number`` since the first page observes, its time (s) and the process images of its axes; caches its rows."""

    __slots__ = ("_rows", "number", "snapshots", "time")

    def __init__(self, number: int, time: float, snapshots: Mapping[str, Snapshot]) -> None:
        self.number = number
        self.time = time
        self.snapshots = snapshots
        self._rows: dict[str, Row] = {}

    def row(self, axis: str, form: AxisForm) -> Row | None:
        """Return the values of an axis in the order of ``record.columns.COLUMNS``, computed once; for one thread."""
        if axis not in self._rows:
            snapshot = self.snapshots.get(axis)
            if snapshot is None:
                return None
            self._rows[axis] = form.values(sample_of(snapshot))
        return self._rows[axis]


class Fetched(NamedTuple):
    """The cycles since a page's last fetch, how many of them were lost, and the number to continue from."""

    cycles: Sequence[ScopeCycle]
    lost: int
    next: int


class ScopeBuffer:
    """Hold the last cycles; one thread adds, another fetches."""

    def __init__(self, kept: int = KEPT) -> None:
        self._kept: deque[ScopeCycle] = deque(maxlen=kept)
        self.end = 0  # the number of the next cycle

    def add(self, now: float, snapshots: Mapping[str, Snapshot]) -> None:
        """Store one cycle; for ``Session.observe``."""
        self._kept.append(ScopeCycle(self.end, now, dict(snapshots)))
        self.end += 1

    def since(self, at: int, most: int) -> Fetched:
        """Return at most ``most`` cycles, beginning with number ``at``."""
        there = self._kept.copy()  # atomic: the other thread may add cycles
        if not there or there[-1].number < at:
            return Fetched((), 0, at)
        first = there[0].number
        begin = max(at, first)
        found = list(islice(there, begin - first, begin - first + most))
        return Fetched(found, begin - at, begin + len(found))
