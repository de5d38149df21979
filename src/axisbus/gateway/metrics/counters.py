"""Count events that a machine reports once: emergency messages, error control events, samples lost by programs."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Protocol

Counts = Counter[tuple[str, ...]]
_MOST = 32  # the most names with a count of their own
_OTHERS = "others"


class Stamped(Protocol):
    """An item with a time (s, monotonic)."""

    @property
    def stamp(self) -> float:
        """The time at which it arrived."""


class MetricCounters:
    """Count new items of lists that store only the last ones; holds the counts, and the newest time of each list."""

    def __init__(self) -> None:
        self.counts: Counts = Counter()
        self._seen: dict[object, float] = {}

    def take(self, key: object, items: Iterable[tuple[Stamped, tuple[str, ...], int]]) -> None:
        """Count the items of a list that are newer than all seen before: each item with its labels and its multiplicity.

        ``key`` identifies the list, also for the next machine, because the clock is the computer's. Items of the first call count
        as well.
        """
        before = newest = self._seen.get(key, float("-inf"))
        for item, labels, times in items:
            if item.stamp > before:
                self.counts[labels] += times
                newest = max(newest, item.stamp)
        self._seen[key] = newest


class Growth:
    """Count the growth of numbers that begin with 0 for each source; holds the counts by name, and the last numbers."""

    def __init__(self) -> None:
        self.counts: Counts = Counter()
        self._seen: Counter[str] = Counter()

    def take(self, items: Iterable[tuple[str, str, int]]) -> None:
        """Count the growth since the last call: for each source its identity, its name (several may share one) and its number.

        ``items`` are all present sources. After 32 names, further ones count as ``others``.
        """
        now: Counter[str] = Counter()
        names: dict[str, str] = {}
        for who, name, number in items:
            now[who] += number
            names[who] = name
        for who, name in names.items():
            self.counts[self._label(name)] += max(0, now[who] - self._seen[who])
        self._seen = now

    def _label(self, name: str) -> tuple[str]:
        known = (name,) in self.counts or len(self.counts) < _MOST
        return (name if known else _OTHERS,)
