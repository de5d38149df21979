"""A clock for modules that ask ``time`` themselves: it goes on only while somebody sleeps."""

from __future__ import annotations


class SleepingClock:
    """Stands in for the module ``time``; ``now`` in seconds."""

    def __init__(self, now: float = 0.0) -> None:
        self.now = now

    def monotonic(self) -> float:
        return self.now

    def sleep(self, seconds: float) -> None:
        self.now += seconds
