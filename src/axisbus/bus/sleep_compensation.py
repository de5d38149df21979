"""How much before its time a sleep has to end, so that it does not end after it: learned from those before."""

from __future__ import annotations

_SPARE = 5e-6  # seconds beside what the sleeps are late by
_MORE = 1.15  # times that
_BLOCK = 50  # sleeps; what was needed in one is kept for one more


class Waking:
    """Holds ``early``, the seconds that a sleep is to end before its time; never above ``most``, with which it begins.

    What is left of them is spent looking at the clock, so each microsecond too much is one of a processor in every cycle. ``early``
    follows the latest of the fifty to a hundred sleeps before, at once where one was later than all of those.
    """

    __slots__ = ("_before", "_latest", "_seen", "early", "most")

    def __init__(self, most: float) -> None:
        self.early = self.most = most
        self._before = self._latest = 0.0
        self._seen = 0

    def note(self, late: float) -> None:
        """Take into account that a sleep ended ``late`` seconds after the time that it was given."""
        if late > self._latest:
            self._latest = late
            self.early = max(self.early, self._needed())
        self._seen += 1
        if self._seen == _BLOCK:
            self.early = self._needed()
            self._before, self._latest, self._seen = self._latest, 0.0, 0

    def _needed(self) -> float:
        return min(self.most, _MORE * max(self._latest, self._before) + _SPARE)
