"""Rotation of a rotor, from counts within one turn that are frequent enough to determine the direction."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.drives.gim6010.make import COUNTS_PER_ROTOR_TURN as TURN


@dataclass(slots=True)
class RotorRotation:
    """Rotor turns from the first count: now, and the extremes in both directions; ``heard``: number of counts."""

    now: float = 0.0
    low: float = 0.0
    high: float = 0.0
    heard: int = 0
    _count: int = 0

    def take(self, count: int) -> None:
        """Take a count (0 to 16383). The shorter direction is assumed: the rotor must turn less than half a turn between two."""
        if self.heard:
            step = (count - self._count + TURN // 2) % TURN - TURN // 2
            self.now += step / TURN
        self._count, self.heard = count, self.heard + 1
        self.low, self.high = min(self.low, self.now), max(self.high, self.now)

    @property
    def farthest(self) -> float:
        """Rotor turns between the first and the farthest position."""
        return max(self.high, -self.low)
