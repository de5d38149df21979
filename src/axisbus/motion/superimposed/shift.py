"""A distance that is gone from cycle to cycle, on ramps, while something else goes on; it may be held back in any of them.

Theory of operation
-------------------
In each cycle the rate comes nearer to what is wanted by no more than its ramp, and stays so low that it can be at rest at the end.
A place is the one before and the rate times the period, so a rate of n times d T leaves d T² (n² + n) / 2 until rest: the highest
rate with which that is still there is the root of a quadratic equation, and falls by d T in each cycle from then on.

Who is held back while it should brake goes beyond its end, and comes back to it.
"""

from __future__ import annotations

import math

_NEAR = 1e-12  # of the larger number: as near as numbers come


class Shift:
    """Holds how much of a distance is gone (``value``), how fast (``rate``, per s), and where it ends."""

    __slots__ = ("_down", "_period", "_up", "_velocity", "end", "rate", "value")

    def __init__(self, period: float) -> None:
        """``period``: of the scan, in seconds."""
        self.value = self.rate = self.end = 0.0
        self._period = period
        self._velocity = self._up = self._down = 0.0

    def aim(self, end: float, velocity: float, up: float, down: float) -> None:
        """Go to ``end``, by at most ``velocity`` (per s), ``up`` and ``down`` (per s²), all above 0, from the present rate."""
        self.end, self._velocity, self._up, self._down = end, velocity, up, down

    def brake_by(self, down: float) -> None:
        """Brake by ``down`` (per s²) from now on."""
        self._down = down

    @property
    def hardest(self) -> float:
        """The harder one of its ramps."""
        return max(self._up, self._down)

    def soften(self, most: float) -> None:
        """Let no ramp be harder than ``most`` (per s²)."""
        self._up, self._down = min(self._up, most), min(self._down, most)

    @property
    def at_rest(self) -> bool:
        """Whether it is at its end, and no longer changes."""
        return self.rate == 0.0 and self.value == self.end

    @property
    def braking(self) -> float:
        """How much it would still go until rest if it braked now; signed."""
        return 0.5 * self.rate * abs(self.rate) / self._down

    @property
    def braking_time(self) -> float:
        """Seconds until rest if it braked now."""
        return abs(self.rate) / self._down

    def wanted(self, factor: float = 1.0) -> float:
        """Return the rate of the next cycle, with ``factor`` times the velocity; nothing changes by this."""
        left, period = self.end - self.value, self._period
        half = 0.5 * self._down * period
        size = abs(left)
        bound = (
            size / period
            if size <= 2.0 * half * period
            else math.sqrt(half * half + 2.0 * self._down * size) - half
        )
        return self._nearer(math.copysign(min(bound, self._velocity * factor), left))

    def braked(self) -> float:
        """Return the rate of the next cycle of one that is to come to rest; nothing changes by this."""
        return self._nearer(0.0)

    def go(self, rate: float) -> None:
        """Go on by one cycle with ``rate``."""
        self.rate = rate
        self.value += rate * self._period
        if abs(self.end - self.value) <= _NEAR * max(abs(self.end), abs(self.value)):
            self.value = self.end

    def _nearer(self, target: float) -> float:
        """Return ``target``, or the rate that is nearest to it after one cycle."""
        rate, up, down = self.rate, self._up * self._period, self._down * self._period
        if rate * target < 0.0:
            target = 0.0
        if abs(target) > abs(rate):
            return target if abs(target) - abs(rate) <= up else math.copysign(abs(rate) + up, target)
        return target if abs(rate) - abs(target) <= down else math.copysign(abs(rate) - down, rate)
