"""How far a rotor has turned, by counts within one turn that come often enough to tell the way."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.drives.gim6010.make import COUNTS_PER_ROTOR_TURN as TURN


@dataclass(slots=True)
class RotorRotation:
    """Rotor turns from where the first count was: now, and the farthest either way; ``heard`` counts."""

    now: float = 0.0
    low: float = 0.0
    high: float = 0.0
    heard: int = 0
    _count: int = 0

    def take(self, count: int) -> None:
        """Take a count (0 to 16383); the way to it is the shorter one, so that less than half a turn may lie between two."""
        if self.heard:
            step = (count - self._count + TURN // 2) % TURN - TURN // 2
            self.now += step / TURN
        self._count, self.heard = count, self.heard + 1
        self.low, self.high = min(self.low, self.now), max(self.high, self.now)

    @property
    def farthest(self) -> float:
        """Rotor turns between where it stood and the farthest place."""
        return max(self.high, -self.low)
