"""What a machine tells once and forgets, counted: emergency messages, what error control told, what programs had lost."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Protocol

Counts = Counter[tuple[str, ...]]
_MOST = 32  # names that are counted apart
_OTHERS = "others"


class Stamped(Protocol):
    """What has a time of its own (s, monotonic)."""

    @property
    def stamp(self) -> float:
        """When it came."""


class MetricCounters:
    """Counts what is new in lists that keep the last of something; holds the counts, and the newest time of each list."""

    def __init__(self) -> None:
        self.counts: Counts = Counter()
        self._seen: dict[object, float] = {}

    def take(self, key: object, items: Iterable[tuple[Stamped, tuple[str, ...], int]]) -> None:
        """Count what of a list is newer than all of it that was seen before: each item with its labels, and how often it was.

        ``key`` says which list it is, also of the next machine: the clock is the computer's. What it held at the first look counts.
        """
        before = newest = self._seen.get(key, float("-inf"))
        for item, labels, times in items:
            if item.stamp > before:
                self.counts[labels] += times
                newest = max(newest, item.stamp)
        self._seen[key] = newest


class Growth:
    """Counts by how much the numbers of those have grown who come with 0, and go; holds the counts by name, and the last."""

    def __init__(self) -> None:
        self.counts: Counts = Counter()
        self._seen: Counter[str] = Counter()

    def take(self, items: Iterable[tuple[str, str, int]]) -> None:
        """Count what is new: for each who is there, who it is, its name (several may have the same) and its number.

        ``items`` are all who are there. After 32 names further ones count as ``others``.
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
