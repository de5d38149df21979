"""SYNC of another producer as the clock of the cycle: check that it comes in time and at the right rate, without bus or clock.

Theory of operation
-------------------
Motion advances one period per executed cycle, so the rate of the cycles is the speed of the axes. Hence three rules:

- SYNC is missing if it has not come ``PATIENCE`` periods after the last one (CiA 301 7.5.2.6: the period is that of 1006h).
- A SYNC that comes less than half a period after the SYNC of the last cycle begins no cycle, so that two cycles are never a burst.
- If the cycles are on average faster than ``FASTEST`` allows, the producer has a shorter period than this master. The axes would
  then move faster than commanded. A slower rate is safe; it is checked once, when listening begins.
"""

from __future__ import annotations

import math
from collections import deque

PATIENCE = 1.5  # periods
FASTEST = 0.9  # of the period, over WINDOW cycles
WINDOW = 64
NEAR = 0.1  # maximum deviation of the measured period, as a fraction of the master's period
LONGEST = 1  # maximum bytes of a SYNC: the counter
MEASURED = 8  # intervals of the first measurement


class SyncWatch:
    """The times of one producer's SYNC; holds state: the last SYNC, and the SYNCs that began the last ``WINDOW`` cycles."""

    def __init__(self, period: float, patience: float | None = None) -> None:
        """``period``: seconds between two SYNCs; ``patience``: seconds after which SYNC is missing, None for 1.5 periods."""
        self.period = period
        self.patience = PATIENCE * period if patience is None else patience
        self.skipped = 0
        self._last: float | None = None
        self._begun: deque[float] = deque(maxlen=WINDOW + 1)

    @property
    def deadline(self) -> float | None:
        """Time at which the next SYNC counts as missing; None before the first one."""
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
        """The mean time between cycles in seconds if it is too short, else None."""
        if len(self._begun) <= WINDOW:
            return None
        mean = (self._begun[-1] - self._begun[0]) / WINDOW
        return mean if mean < FASTEST * self.period else None


def measured_period(stamps: list[float]) -> float:
    """Return the mean period of the SYNCs with these time stamps (two at least)."""
    return (stamps[-1] - stamps[0]) / (len(stamps) - 1)


def fits(measured: float, period: float) -> bool:
    """Whether a measured period equals ``period`` within a tenth of it."""
    return abs(measured - period) <= NEAR * period


class SyncTimes:
    """Send times of this master's SYNCs, counted from 1; holds state: the count, and the times of the newest ``KEPT``.

    For one writer; threads that read may see the newest one late.
    """

    __slots__ = ("_times", "count")

    KEPT = 1024

    def __init__(self) -> None:
        self.count = 0
        self._times = [-math.inf] * self.KEPT

    def note(self, stamp: float) -> None:
        """Record that the next SYNC was sent, not before ``stamp`` (seconds)."""
        number = self.count + 1
        self._times[number % self.KEPT] = stamp
        self.count = number

    def time(self, number: int) -> float:
        """Return the send time of a SYNC; minus infinity if it is no longer stored or was never sent."""
        return self._times[number % self.KEPT] if 0 <= self.count - number < self.KEPT else -math.inf

    def number_at(self, stamp: float) -> int:
        """Return the number of the newest SYNC that was sent by ``stamp``; 0 if there is none."""
        number = self.count
        while number > 0 and self.time(number) > stamp:
            number -= 1
        return number
