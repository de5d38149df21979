"""How often somebody may ask: a bucket that fills again; a stop is never counted."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

RATE, BURST = 60.0, 120.0  # messages each second, and at once: one that jogs sends 20 each second


@dataclass(slots=True)
class Bucket:
    """What is left of a rate; holds state. ``burst`` messages at once, ``rate`` each second; times in seconds."""

    rate: float = RATE
    burst: float = BURST
    left: float = field(default=math.nan)
    seen: float = 0.0

    def take(self, now: float) -> bool:
        """Whether one more message is within the rate."""
        if math.isnan(self.left):
            self.left, self.seen = self.burst, now
        self.left = min(self.burst, self.left + (now - self.seen) * self.rate)
        self.seen = now
        if self.left < 1.0:
            return False
        self.left -= 1.0
        return True
