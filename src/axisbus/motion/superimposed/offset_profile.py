"""A distance covered from cycle to cycle, on ramps, while another motion continues; any cycle may slow it down.

Theory of operation
-------------------
In each cycle the rate approaches the requested rate by no more than its ramp, and stays low enough to be at rest at the end. A
position is the previous one plus the rate times the period. Let d be the deceleration, T the period, w a rate in units of d T, and
k the whole number below w. When braking, the rate w is followed by w - 1, w - 2 and so on. Together these cycles cover (k + 1) w -
k (k + 1) / 2 units of d T². ``_bound`` is the rate for which this equals the remaining distance. One cycle later it is lower by
one, and in the last cycle it reaches the end.

A motion that is slowed down while it should brake overshoots its end, and returns to it.
"""

from __future__ import annotations

import math

_NEAR = 1e-12  # relative to the larger number: the resolution of the numbers


class Shift:
    """Holds the covered part of a distance (``value``), its velocity (``rate``, per s), and its end."""

    __slots__ = ("_down", "_period", "_up", "_velocity", "end", "rate", "value")

    def __init__(self, period: float) -> None:
        """``period``: scan period in seconds."""
        self.value = self.rate = self.end = 0.0
        self._period = period
        self._velocity = self._up = self._down = 0.0

    def aim(self, end: float, velocity: float, up: float, down: float) -> None:
        """Move to ``end`` from the present rate, by at most ``velocity`` (per s), ``up`` and ``down`` (per s²), all above 0."""
        self.end, self._velocity, self._up, self._down = end, velocity, up, down

    def brake_by(self, down: float) -> None:
        """Set the deceleration to ``down`` (per s²)."""
        self._down = down

    @property
    def hardest(self) -> float:
        """The higher one of its ramps."""
        return max(self._up, self._down)

    def soften(self, most: float) -> None:
        """Limit the ramps to ``most`` (per s²)."""
        self._up, self._down = min(self._up, most), min(self._down, most)

    @property
    def at_rest(self) -> bool:
        """Whether it is at its end, and no longer changes."""
        return self.rate == 0.0 and self.value == self.end

    @property
    def braking(self) -> float:
        """The signed distance to rest if it brakes now."""
        return 0.5 * self.rate * abs(self.rate) / self._down

    @property
    def braking_time(self) -> float:
        """Seconds to rest if it brakes now."""
        return abs(self.rate) / self._down

    def wanted(self, factor: float = 1.0) -> float:
        """Return the rate of the next cycle at ``factor`` times the velocity; changes nothing."""
        left = self.end - self.value
        return self._nearer(math.copysign(min(self._bound(abs(left)), self._velocity * factor), left))

    def braked(self) -> float:
        """Return the rate of the next cycle when braking to rest; changes nothing."""
        return self._nearer(0.0)

    def go(self, rate: float) -> None:
        """Advance by one cycle with ``rate``."""
        self.rate = rate
        self.value += rate * self._period
        if abs(self.end - self.value) <= _NEAR * max(abs(self.end), abs(self.value)):
            self.value = self.end

    def _bound(self, left: float) -> float:
        """Return the highest rate of the next cycle with which it can come to rest after distance ``left``."""
        change = self._down * self._period
        length = left / (change * self._period)
        k = math.floor(0.5 * (math.sqrt(1.0 + 8.0 * length) - 1.0))
        return change * (length / (k + 1) + 0.5 * k)

    def _nearer(self, target: float) -> float:
        """Return ``target``, or the rate closest to it that the ramps permit after one cycle."""
        rate, up, down = self.rate, self._up * self._period, self._down * self._period
        if rate * target < 0.0:
            target = 0.0
        if abs(target) > abs(rate):
            return target if abs(target) - abs(rate) <= up else math.copysign(abs(rate) + up, target)
        return target if abs(rate) - abs(target) <= down else math.copysign(abs(rate) - down, rate)
