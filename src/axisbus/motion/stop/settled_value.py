"""Whether a value stays constant for a time, by the timestamps of the received values."""

from __future__ import annotations

import math

_LEAST_VALUES = 3


class SettledValue:
    """Detects a constant value: for a whole window, no two values differ by more than twice the tolerance, and the value has not
    gone farther than the tolerance from the first one to the last.

    So noise of ± the tolerance is constant, whichever value was the first, and a slow motion is not.

    The window has at least three values, however rare they are: two may be equal on both sides of the turning point of a motion.

    Only values received after ``since`` count. A value with the same timestamp as before is not new.
    """

    __slots__ = (
        "_began_at",
        "_first",
        "_first_outside",
        "_highest",
        "_lowest",
        "_number",
        "_stamp",
        "_tolerance",
        "_window",
        "still",
    )

    def __init__(self, tolerance: float, window: float, since: float = -math.inf) -> None:
        """``tolerance`` in the value's unit; ``window`` and ``since`` in seconds."""
        self._tolerance = tolerance
        self._window = window
        self._first = self._lowest = self._highest = math.nan
        self._began_at = -math.inf
        self._number = 0  # of the newest value in the window; counted until the value is constant
        # The first value that is too far from the first one of the window, its time, and its number.
        self._first_outside: tuple[float, float, int] | None = None
        self._stamp = since
        self.still = False

    def feed(self, value: float, stamp: float) -> bool:
        """Evaluate the newest value; return whether the value is constant."""
        if stamp <= self._stamp:
            return self.still
        self._stamp = stamp
        if self._lowest <= value <= self._highest:
            pass  # most values of an axis at standstill
        elif self._highest - 2.0 * self._tolerance <= value <= self._lowest + 2.0 * self._tolerance:
            self._lowest, self._highest = min(self._lowest, value), max(self._highest, value)
        else:  # also the first value: no comparison with NaN holds
            self._begin(value, stamp)
        if not self.still:
            self._judge(value, stamp)
        return self.still

    def _judge(self, value: float, stamp: float) -> None:
        """Decide at the end of the window; if the value left its tolerance, the window begins again where that happened first."""
        self._number += 1
        if self._first_outside is None and abs(value - self._first) > self._tolerance:
            self._first_outside = value, stamp, self._number
        if not self._is_whole(stamp):
            return
        if self._first_outside is not None and abs(value - self._first) > self._tolerance:
            (self._first, self._began_at, before), self._first_outside = self._first_outside, None
            self._number -= before - 1
        self.still = self._is_whole(stamp) and abs(value - self._first) <= self._tolerance

    def _is_whole(self, stamp: float) -> bool:
        return stamp - self._began_at >= self._window and self._number >= _LEAST_VALUES

    def _begin(self, value: float, stamp: float) -> None:
        self._first = self._lowest = self._highest = value
        self._began_at, self._number, self._first_outside, self.still = stamp, 0, None, False

    @property
    def rested_since(self) -> float:
        """When the first of these values was received (-inf: never)."""
        return self._began_at

    def since(self, moment: float) -> bool:
        """Return whether the value has been constant for a whole window after ``moment``, with a value received at its end."""
        return self.still and self._stamp - moment >= self._window

    def forget(self) -> None:
        """Start again: the value is unknown, or has another origin now."""
        self._lowest = self._highest = math.nan
        self.still = False
