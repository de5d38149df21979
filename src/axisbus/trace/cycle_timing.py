"""Measure how regular the cycle of a bus is: SYNC against its grid, TPDOs and RPDOs after it, by the times of frames.

Frames may arrive slightly out of order (those that were drained come after the next SYNC). Each frame waits until all earlier ones
must have arrived.
"""

from __future__ import annotations

import heapq
from array import array
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from axisbus.cia301.frame import CanFrame

# The measured values of a ``CycleTiming``, and their descriptions.
MEASURED = {
    "off": "interval of two SYNCs, off the period by",
    "last_tpdo": "last TPDO after its SYNC",
    "last_rpdo": "last RPDO after its SYNC",
    "skew": "first to last node's answer",
}
_LATE = 0.25  # seconds by which a frame may arrive late


@dataclass(frozen=True, slots=True)
class CyclicIdentifiers:
    """The identifiers to measure: SYNC, the cyclic TPDOs and RPDOs, and the first TPDO of each node."""

    sync: int
    tpdos: frozenset[int]
    rpdos: frozenset[int]
    answers: frozenset[int]


class Spread(NamedTuple):
    """The distribution of values in seconds: number of cycles, minimum, median, 99th percentile, and worst."""

    cycles: int
    least: float
    p50: float
    p99: float
    worst: float


@dataclass
class CycleTiming:
    """The measurements so far, in seconds; holds the frames that wait for their turn.

    ``off``: the difference between the SYNC interval and the period (skipped SYNCs are counted in ``missing``); ``last_tpdo`` and
    ``last_rpdo``: the delay of the last TPDO or RPDO of a cycle after its SYNC; ``skew``: the time between the first and the last
    node's answer.
    """

    identifiers: CyclicIdentifiers
    period: float
    off: array[float] = field(default_factory=lambda: array("d"))
    last_tpdo: array[float] = field(default_factory=lambda: array("d"))
    last_rpdo: array[float] = field(default_factory=lambda: array("d"))
    skew: array[float] = field(default_factory=lambda: array("d"))
    cycles: int = 0
    missing: int = 0

    def __post_init__(self) -> None:
        self._waiting: list[tuple[float, int]] = []
        self._began: float | None = None
        self._tpdos = array("d")
        self._rpdos = array("d")
        self._answers = array("d")
        self.seen = (
            self.identifiers.tpdos
            | self.identifiers.rpdos
            | self.identifiers.answers
            | {self.identifiers.sync}
        )

    def add(self, frames: Iterable[CanFrame]) -> None:
        """Add frames in the order of their arrival."""
        newest = 0.0
        for frame in frames:
            if frame.can_id in self.seen:
                heapq.heappush(self._waiting, (frame.time, frame.can_id))
                newest = max(newest, frame.time)
        while self._waiting and self._waiting[0][0] < newest - _LATE:
            self._take(*heapq.heappop(self._waiting))

    def finish(self) -> None:
        """Process the waiting frames."""
        while self._waiting:
            self._take(*heapq.heappop(self._waiting))

    def _take(self, time: float, can_id: int) -> None:
        if can_id == self.identifiers.sync:
            self._close(time)
            return
        if self._began is None:
            return
        for wanted, times in (
            (self.identifiers.tpdos, self._tpdos),
            (self.identifiers.rpdos, self._rpdos),
            (self.identifiers.answers, self._answers),
        ):
            if can_id in wanted:
                times.append(time)

    def _close(self, time: float) -> None:
        """Handle a SYNC: the frames since the previous one belong to the previous one."""
        began, self._began = self._began, time
        if began is not None:
            steps = max(1, round((time - began) / self.period))
            self.missing += steps - 1
            self.cycles += 1
            self.off.append(time - began - steps * self.period)
            _last(self.last_tpdo, self._tpdos, began)
            _last(self.last_rpdo, self._rpdos, began)
            if len(self._answers) == len(self.identifiers.answers) > 1:
                self.skew.append(max(self._answers) - min(self._answers))
        for times in (self._tpdos, self._rpdos, self._answers):
            del times[:]


def _last(into: array[float], times: Collection[float], began: float) -> None:
    if times:
        into.append(max(times) - began)


def spread(values: Iterable[float]) -> Spread | None:
    """Return the distribution of values, in either direction from 0; None if there are none."""
    found = sorted(map(abs, values))
    if not found:
        return None
    return Spread(len(found), found[0], found[len(found) // 2], found[int(len(found) * 0.99)], found[-1])


def histogram(values: Sequence[float], bins: int) -> list[tuple[float, float, int]]:
    """Return (from, to, count) of equal bins between minimum and maximum; a single bin if all values are equal."""
    least, most = min(values), max(values)
    if least == most:
        return [(least, most, len(values))]
    width = (most - least) / bins
    counts = [0] * bins
    for value in values:
        counts[min(bins - 1, int((value - least) / width))] += 1
    return [
        (least + bin_number * width, least + (bin_number + 1) * width, count)
        for bin_number, count in enumerate(counts)
    ]
