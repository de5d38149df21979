"""A distance that is gone from cycle to cycle, on ramps, while something else goes on; it may be held back in any of them.

Theory of operation
-------------------
In each cycle the rate comes nearer to what is wanted by no more than its ramp, and stays so low that it can be at rest at the end.
A place is the one before and the rate times the period. So a rate w (in units of d T, d the deceleration) is followed by w - 1,
w - 2 and so on, and leads (k + 1) w - k (k + 1) / 2 units of d T² far with its own cycle, k being the whole number below w.
``_bound`` is the rate for which that is what is left; a cycle later it is one less, and in the last one it leads to the end.

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
        left = self.end - self.value
        return self._nearer(math.copysign(min(self._bound(abs(left)), self._velocity * factor), left))

    def braked(self) -> float:
        """Return the rate of the next cycle of one that is to come to rest; nothing changes by this."""
        return self._nearer(0.0)

    def go(self, rate: float) -> None:
        """Go on by one cycle with ``rate``."""
        self.rate = rate
        self.value += rate * self._period
        if abs(self.end - self.value) <= _NEAR * max(abs(self.end), abs(self.value)):
            self.value = self.end

    def _bound(self, left: float) -> float:
        """Return the highest rate of the next cycle with which it can be at rest when ``left`` more is gone."""
        change = self._down * self._period
        length = left / (change * self._period)
        k = math.floor(0.5 * (math.sqrt(1.0 + 8.0 * length) - 1.0))
        return change * (length / (k + 1) + 0.5 * k)

    def _nearer(self, target: float) -> float:
        """Return ``target``, or the rate that is nearest to it after one cycle."""
        rate, up, down = self.rate, self._up * self._period, self._down * self._period
        if rate * target < 0.0:
            target = 0.0
        if abs(target) > abs(rate):
            return target if abs(target) - abs(rate) <= up else math.copysign(abs(rate) + up, target)
        return target if abs(rate) - abs(target) <= down else math.copysign(abs(rate) - down, rate)
