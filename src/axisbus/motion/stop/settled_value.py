"""Whether a value stays constant for a time, by the timestamps of the received values."""

from __future__ import annotations

import math


class SettledValue:
    """Detects a constant value: all values of a whole window lie within a span, whichever of them was the first.

    Only values received after ``since`` count. A value with the same timestamp as before is not new.
    """

    __slots__ = ("_began", "_highest", "_lowest", "_span", "_stamp", "_window", "still")

    def __init__(self, span: float, window: float, since: float = -math.inf) -> None:
        """``span``: highest permitted difference of two values, in their unit; ``window`` and ``since`` in seconds."""
        self._span = span
        self._window = window
        self._lowest = self._highest = math.nan
        self._began = -math.inf
        self._stamp = since
        self.still = False

    def feed(self, value: float, stamp: float) -> bool:
        """Evaluate the newest value; return whether the value is constant."""
        if stamp <= self._stamp:
            return self.still
        self._stamp = stamp
        if self._lowest <= value <= self._highest:
            pass  # most values of an axis at standstill
        elif self._highest - self._span <= value <= self._lowest + self._span:
            self._lowest, self._highest = min(self._lowest, value), max(self._highest, value)
        else:  # also the first value: no comparison with NaN holds
            self._lowest = self._highest = value
            self._began, self.still = stamp, False
        if not self.still and stamp - self._began >= self._window:
            self.still = True
        return self.still

    @property
    def rested_since(self) -> float:
        """When the first value within the span was received (-inf: never)."""
        return self._began

    def since(self, moment: float) -> bool:
        """Return whether the value has been constant for a whole window after ``moment``, with a value received at its end."""
        return self.still and self._stamp - moment >= self._window

    def forget(self) -> None:
        """Start again: the value is unknown, or has another origin now."""
        self._lowest = self._highest = math.nan
        self.still = False
