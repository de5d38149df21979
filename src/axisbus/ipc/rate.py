"""Limit the message rate of a client with a token bucket; callers do not count stops."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

RATE, BURST = 60.0, 120.0  # messages per second, and at once: a client that jogs sends 20 per second
CORE_RATE, CORE_BURST = 500.0, 200.0  # the same, that a core accepts from a program that has joined
COMMAND_RATE, COMMAND_BURST = (
    400.0,
    150.0,
)  # commands of such a program: fewer, so that a stop never waits behind them


@dataclass(slots=True)
class Bucket:
    """A token bucket; holds state. It permits ``burst`` messages at once and ``rate`` messages per second; times are in seconds."""

    rate: float = RATE
    burst: float = BURST
    left: float = field(default=math.nan)
    seen: float = 0.0

    def take(self, now: float) -> bool:
        """Return whether one more message is within the rate, and count it if so."""
        if math.isnan(self.left):
            self.left, self.seen = self.burst, now
        self.left = min(self.burst, self.left + (now - self.seen) * self.rate)
        self.seen = now
        if self.left < 1.0:
            return False
        self.left -= 1.0
        return True
