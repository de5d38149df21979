"""Learn from earlier sleeps how long before a deadline a sleep must end, so that it does not end late."""

from __future__ import annotations

_SPARE = 5e-6  # seconds, added to the delay of the sleeps
_MORE = 1.15  # factor on that delay
_BLOCK = 50  # sleeps; the delay in one block is also used for the next one


class Waking:
    """Holds ``early``, the seconds that a sleep must end before its deadline; never above ``most``, its initial value.

    The rest of the time is spent polling the clock, so each surplus microsecond costs a microsecond of a processor in every cycle.
    ``early`` follows the maximum delay of the last fifty to a hundred sleeps, at once if one was later than all of those.
    """

    __slots__ = ("_before", "_latest", "_seen", "early", "most")

    def __init__(self, most: float) -> None:
        self.early = self.most = most
        self._before = self._latest = 0.0
        self._seen = 0

    def note(self, late: float) -> None:
        """Record that a sleep ended ``late`` seconds after its requested end."""
        if late > self._latest:
            self._latest = late
            self.early = max(self.early, self._needed())
        self._seen += 1
        if self._seen == _BLOCK:
            self.early = self._needed()
            self._before, self._latest, self._seen = self._latest, 0.0, 0

    def _needed(self) -> float:
        return min(self.most, _MORE * max(self._latest, self._before) + _SPARE)
