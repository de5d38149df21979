"""Whether a value stays constant for a time, by the timestamps of the received values."""

from __future__ import annotations

import math


class SettledValue:
    """Detects a constant value: within the tolerance of one anchor value for the whole window; holds that anchor.

    Only values received after ``since`` count. A value with the same timestamp as before is not new.
    """

    __slots__ = ("_anchor", "_anchor_stamp", "_stamp", "_tolerance", "_window", "still")

    def __init__(self, tolerance: float, window: float, since: float = -math.inf) -> None:
        """``tolerance`` in the value's unit; ``window`` and ``since`` in seconds."""
        self._tolerance = tolerance
        self._window = window
        self._anchor: float | None = None
        self._anchor_stamp = -math.inf
        self._stamp = since
        self.still = False

    def feed(self, value: float, stamp: float) -> bool:
        """Evaluate the newest value; return whether the value is constant."""
        if stamp <= self._stamp:
            return self.still
        self._stamp = stamp
        if self._anchor is None or not -self._tolerance <= value - self._anchor <= self._tolerance:
            self._anchor, self._anchor_stamp, self.still = value, stamp, False
        elif stamp - self._anchor_stamp >= self._window:
            self.still = True
        return self.still

    @property
    def rested_since(self) -> float:
        """When the value was first received within the tolerance of the present one (-inf: never)."""
        return self._anchor_stamp

    def since(self, moment: float) -> bool:
        """Return whether the value has been constant for a whole window after ``moment``, with a value received at its end."""
        return self.still and self._stamp - moment >= self._window

    def forget(self) -> None:
        """Start again: the value is unknown, or has another origin now."""
        self._anchor, self.still = None, False
