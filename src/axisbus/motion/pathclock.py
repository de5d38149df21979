"""The time along an axis's own trajectory: one period per executed cycle, and slowed down so that its path is kept."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

Way = Callable[
    [float], float
]  # the distance covered along the path at a time; in any unit, forwards or backwards


class Clock(Protocol):
    """What goes on along a path: time, the place on the way of a group, or nothing of the path's own."""

    t: float
    braking: bool

    @property
    def stopped(self) -> bool:
        """Whether it stands because it was braked."""

    def told(self, t: float) -> str:
        """Return what it was at for people."""

    def advance(self, period: float) -> None:
        """Go on by one cycle of ``period`` seconds."""


class PathClock:
    """The time along a trajectory. It advances by exactly one period per executed cycle, and can be braked to a stop.

    Slowing time scales the velocity down and keeps the path. While braking, the speed along the path falls by no more than the
    deceleration times the period in each cycle, whatever the trajectory itself does meanwhile: where it slows down by itself as
    fast, time runs on; where it would speed up, time runs the slower.
    """

    __slots__ = ("_deceleration", "_last", "_period", "_speed", "_way", "braking", "rate", "t")

    def __init__(self) -> None:
        self.t = 0.0
        self.rate = 1.0
        self._last = 0.0  # the time one cycle before
        self._period = 0.0
        self.braking = False  # slowing down or stopped
        self._way: Way | None = None
        self._deceleration = 0.0
        self._speed = 0.0

    def advance(self, period: float) -> None:
        """Go on by one cycle of ``period`` seconds; raises what the way raises."""
        self._period, self._last = period, self.t
        if self._way is None:
            self.t += period
        elif self.rate:
            self._slow_down(self._way, period)

    def brake(self, way: Way, deceleration: float) -> None:
        """Slow down to a stop; ``deceleration`` in units of ``way`` per s², above 0. A second call changes nothing."""
        if self._way is not None:
            return
        self._way, self._deceleration, self.braking = way, deceleration, True
        if self._period:
            self._speed = abs(way(self.t) - way(self._last)) / self._period
        if not self._speed:
            self.rate = 0.0

    @property
    def stopped(self) -> bool:
        """Whether time stands still."""
        return self.rate == 0.0

    def told(self, t: float) -> str:
        """Return a time for people."""
        return f"{t:.3f} s"

    def _slow_down(self, way: Way, period: float) -> None:
        self._speed = max(0.0, self._speed - self._deceleration * period)
        here, ahead = way(self.t), self.rate * period
        natural = abs(way(self.t + ahead) - here)
        if not natural or not self._speed:
            self.rate = self._speed = 0.0
            return
        allowed = self._speed * period
        if natural > allowed:
            ahead *= allowed / natural
        self._speed = abs(way(self.t + ahead) - here) / period
        self.rate = ahead / period
        self.t += ahead
