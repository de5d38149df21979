"""How much a browser may send: messages by size and rate, sockets by number; a stop is never counted."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

MESSAGE = 4096  # bytes of a message to us
FOREIGN_MESSAGE = 65_536  # bytes of a message or a request to the library of the page
FILE = 2 * 1024 * 1024  # bytes of a DCF
SAMPLES = 7 * 1024 * 1024  # bytes of what a scope shows
BRING_FILE, SAVE_SAMPLES = "/config/file", "/scope/mcap"
LONGER = {
    BRING_FILE: FILE,
    SAVE_SAMPLES: SAMPLES,
}  # by path, what a request may bring where it may bring more
SOCKETS = 64  # two for each open page, and one for its scope
RATE, BURST = 60.0, 120.0  # messages each second, and at once: one that jogs sends 20 each second


def most_bytes(path: str) -> int:
    """Return how much a request of a path may bring."""
    return LONGER.get(path, FOREIGN_MESSAGE)


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
