"""The time along an axis's own trajectory: one period per executed cycle, and slowed down so that its path is kept."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

Way = Callable[
    [float], float
]  # the distance covered along the path at a time; in any unit, forwards or backwards

_ROUNDS = 30
_CLOSE = 1e-6  # of what is wanted


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


class Guided(Clock, Protocol):
    """A clock that knows by itself how to come to rest."""

    def brake(self) -> None:
        """Come to rest; a second call changes nothing."""


class PathClock:
    """The time along a trajectory. It advances by one period per executed cycle, and can be slowed, held, and braked to a stop.

    Slowing time scales the velocity down and keeps the path. While braking, the speed along the path falls by no more than the
    deceleration times the period in each cycle, whatever the trajectory itself does meanwhile: where it slows down by itself as
    fast, time runs on; where it would speed up, time runs the slower. Under an override (``aim``) time comes to run at its factor,
    as fast as the velocity may change for it. A stop is never scaled: it brakes from the speed that there is.
    """

    __slots__ = (
        "_deceleration",
        "_factor",
        "_last",
        "_period",
        "_ramp",
        "_speed",
        "_way",
        "braking",
        "rate",
        "t",
    )

    def __init__(self) -> None:
        self.t = 0.0
        self.rate = 1.0  # seconds of the trajectory in one of the clock
        self._factor = 1.0  # that it is to come to
        self._last = 0.0  # the time one cycle before
        self._period = 0.0
        self.braking = False  # slowing down or stopped
        self._way: Way | None = None
        self._ramp: float | None = None
        self._deceleration = 0.0
        self._speed = 0.0

    @property
    def is_even(self) -> bool:
        """Whether it goes on as time does, and will in the next cycle."""
        return self.rate == 1.0 == self._factor and not self.braking

    @property
    def fastest(self) -> float:
        """How fast it runs at most until something else is asked of it: as it does, or as it comes to."""
        return max(self.rate, self._factor)

    def aim(self, factor: float, way: Way, ramp: float | None) -> None:
        """Let time come to run at ``factor``; the velocity changes for it by ``ramp`` per s² (None: only at rest)."""
        self._factor, self._way, self._ramp = factor, way, ramp

    def next(self, period: float) -> float:
        """Return the time that ``advance`` comes to, where it is not braked; nothing changes by this."""
        return self.t + self._next_rate(period) * period

    def advance(self, period: float) -> None:
        """Go on by one cycle of ``period`` seconds; raises what the way raises."""
        if self.braking and self._deceleration:
            self._period, self._last = period, self.t
            if self.rate and self._way is not None:
                self._slow_down(self._way, period)
            return
        self.rate = self._next_rate(period)
        self._period, self._last = period, self.t
        self.t += self.rate * period

    def run_on(self, period: float) -> None:
        """Do what ``advance`` does where the clock ``is_even``."""
        self._period, self._last = period, self.t
        self.t += period

    def brake(self, way: Way, deceleration: float) -> None:
        """Slow down to a stop; ``deceleration`` in units of ``way`` per s², above 0. A second call changes nothing."""
        if self._deceleration:
            return
        self._way, self._deceleration, self.braking = way, deceleration, True
        if self._period:
            self._speed = abs(way(self.t) - way(self._last)) / self._period
        if not self._speed:
            self.rate = 0.0

    @property
    def stopped(self) -> bool:
        """Whether time stands still because it was braked."""
        return self.braking and self.rate == 0.0

    def told(self, t: float) -> str:
        """Return a time for people."""
        return f"{t:.3f} s"

    def _next_rate(self, period: float) -> float:
        """Return how fast time runs in the next cycle: nearer to its factor, as far as the velocity may change."""
        rate, factor, way = self.rate, self._factor, self._way
        if rate == factor or way is None:
            return rate
        here = way(self.t)
        now = (here - way(self._last)) / (self._period or period)
        kept, asked = ((way(self.t + each * period) - here) / period for each in (rate, factor))
        change = 0.0 if self._ramp is None else self._ramp * period
        if abs(asked - now) <= change or asked == kept:
            return factor
        bound = now + change if asked > kept else now - change
        if not kept < bound < asked and not asked < bound < kept:
            return rate if abs(bound - kept) < abs(bound - asked) else factor

        def gained(share: float) -> float:
            return abs((way(self.t + (rate + share * (factor - rate)) * period) - here) / period - kept)

        return rate + _share(gained, abs(asked - kept), abs(bound - kept)) * (factor - rate)

    def _slow_down(self, way: Way, period: float) -> None:
        self._speed = max(0.0, self._speed - self._deceleration * period)
        here, ahead = way(self.t), self.rate * period
        natural = abs(way(self.t + ahead) - here)
        if not natural or not self._speed:
            self.rate = self._speed = 0.0
            return
        allowed = self._speed * period
        if natural > allowed:
            ahead *= _share(lambda share: abs(way(self.t + share * ahead) - here), natural, allowed)
        self._speed = abs(way(self.t + ahead) - here) / period
        self.rate = ahead / period
        self.t += ahead


def _share(gone: Way, whole: float, wanted: float) -> float:
    """Return the share (0 to 1) of a stretch at which ``gone`` of it is ``wanted``; all of it is ``whole``, more than that.

    A path that bends in time has not gone half of its way in half of its time. (Regula falsi, with the halving of Illinois.)
    """
    low, high, under, over = 0.0, 1.0, -wanted, whole - wanted
    share, side = wanted / whole, 0
    for _ in range(_ROUNDS):
        off = gone(share) - wanted
        if abs(off) <= _CLOSE * wanted:
            break
        if off < 0.0:
            low, under, over = share, off, over * (0.5 if side < 0 else 1.0)
        else:
            high, over, under = share, off, under * (0.5 if side > 0 else 1.0)
        side = -1 if off < 0.0 else 1
        share = (low * over - high * under) / (over - under)
    return share
