"""How much before its time a sleep has to end, so that it does not end after it: learned from those before."""

from __future__ import annotations

_SPARE = 5e-6  # seconds beside what the sleeps are late by
_MORE = 1.25  # times what one was late by
_FORGETS = (
    0.002  # per sleep of what is not needed any more: what comes once in some hundred sleeps is reckoned with
)


class Waking:
    """Holds ``early``, the seconds that a sleep is to end before its time; never above ``most``, with which it begins.

    What is left of them is spent looking at the clock, so each microsecond too much is one of a processor in every cycle.
    """

    __slots__ = ("early", "most")

    def __init__(self, most: float) -> None:
        self.early = self.most = most

    def note(self, late: float) -> None:
        """Take into account that a sleep ended ``late`` seconds after the time that it was given."""
        wanted = _MORE * late + _SPARE
        if wanted > self.early:
            self.early = min(self.most, wanted)
        else:
            self.early -= _FORGETS * (self.early - wanted)
