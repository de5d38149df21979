"""Whether a value stays at one place for a time, by the stamps of what was received."""

from __future__ import annotations

import math


class SettledValue:
    """Standing still means: within the tolerance of one anchor for the whole window; holds that anchor.

    Only values received after ``since`` count, and a value that is seen again, with the stamp that it had, says nothing new.
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
        """Take the newest value; return whether it is still."""
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
        """When the value was first received at the place where it is (-inf: never)."""
        return self._anchor_stamp

    def since(self, moment: float) -> bool:
        """Return whether it has been still for a whole window after ``moment``, when a value came."""
        return self.still and self._stamp - moment >= self._window

    def forget(self) -> None:
        """Begin anew: the value is unknown, or counts from another place now."""
        self._anchor, self.still = None, False
