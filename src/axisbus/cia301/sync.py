"""Another producer's SYNC as the clock of our cycle: whether it comes in time and at the right pace, without a bus or a clock.

Theory of operation
-------------------
Motion advances one period per executed cycle, so the pace of the cycles is the pace of the axes. Hence three rules:

- SYNC that has not come ``PATIENCE`` periods after the last one is missing (CiA 301 7.5.2.6: the period is that of 1006h).
- A SYNC less than half a period after the one that began the last cycle begins none: two cycles are never a burst.
- Cycles that together come faster than ``FASTEST`` allows mean a producer with a shorter period than ours: the axes would move
  faster than they were told to. A slower pace is safe, and is compared once, when listening begins.
"""

from __future__ import annotations

import math
from collections import deque

PATIENCE = 1.5  # periods
FASTEST = 0.9  # of the period, over WINDOW cycles
WINDOW = 64
NEAR = 0.1  # how far the measured period may be from ours, as a part of it
LONGEST = 1  # bytes of a SYNC: the counter
MEASURED = 8  # intervals that the first measurement takes


class SyncWatch:
    """The times of one producer's SYNC; holds state: the one that began the last cycle, and the last ``WINDOW`` of those."""

    def __init__(self, period: float, patience: float | None = None) -> None:
        """``period``: seconds between two SYNCs; ``patience``: seconds after which SYNC is missing, None for 1.5 periods."""
        self.period = period
        self.patience = PATIENCE * period if patience is None else patience
        self.skipped = 0
        self._last: float | None = None
        self._begun: deque[float] = deque(maxlen=WINDOW + 1)

    @property
    def deadline(self) -> float | None:
        """When the next SYNC is missing; None before the first one."""
        return None if self._last is None else self._last + self.patience

    def take(self, stamp: float, heard: int = 1) -> bool:
        """Take the newest of ``heard`` SYNCs, which came at ``stamp`` (seconds); return whether it begins a cycle."""
        self.skipped += heard - 1
        begun = self._begun
        if begun and stamp - begun[-1] < self.period / 2:
            self.skipped += 1
            self._last = stamp
            return False
        self._last = stamp
        begun.append(stamp)
        return True

    @property
    def too_fast(self) -> float | None:
        """The mean time between cycles in seconds where that is too short, else None."""
        if len(self._begun) <= WINDOW:
            return None
        mean = (self._begun[-1] - self._begun[0]) / WINDOW
        return mean if mean < FASTEST * self.period else None


def measured_period(stamps: list[float]) -> float:
    """Return the mean distance of SYNCs by the times of all of them (two at least)."""
    return (stamps[-1] - stamps[0]) / (len(stamps) - 1)


def fits(measured: float, period: float) -> bool:
    """Whether a measured period is ours, within a tenth of it."""
    return abs(measured - period) <= NEAR * period


class SyncTimes:
    """When each of our own SYNCs was sent, counted from 1; holds state: how many, and the times of the newest ``KEPT``.

    For one writer; readers of other threads may see the newest one late.
    """

    __slots__ = ("_times", "count")

    KEPT = 1024

    def __init__(self) -> None:
        self.count = 0
        self._times = [-math.inf] * self.KEPT

    def note(self, stamp: float) -> None:
        """Note that the next SYNC was sent, not before ``stamp`` (seconds)."""
        number = self.count + 1
        self._times[number % self.KEPT] = stamp
        self.count = number

    def time(self, number: int) -> float:
        """Return when a SYNC was sent; minus infinity where it is too long ago, or there was none."""
        return self._times[number % self.KEPT] if 0 <= self.count - number < self.KEPT else -math.inf

    def number_at(self, stamp: float) -> int:
        """Return the number of the newest SYNC that was sent by ``stamp``; 0 where there is none."""
        number = self.count
        while number > 0 and self.time(number) > stamp:
            number -= 1
        return number
