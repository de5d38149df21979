"""What a machine tells once and forgets, counted: emergency messages by code, and what error control has told of nodes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from typing import Protocol


class Stamped(Protocol):
    """What has a time of its own (s, monotonic)."""

    @property
    def stamp(self) -> float:
        """When it came."""


class Tally:
    """Counts what is new in lists that keep the last of something; holds the counts, and the newest time of each list."""

    def __init__(self) -> None:
        self.counts: Counter[tuple[str, ...]] = Counter()
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
