"""The time along an axis's own trajectory: one period per executed cycle; it slows down such that the axis stays on its path."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

DistanceAt = Callable[
    [float], float
]  # the distance covered along the path at a time; in any unit, forwards or backwards

_ROUNDS = 30
_CLOSE = 1e-6  # of the wanted value


class PathParameter(Protocol):
    """The parameter of a path: time, the path position of a group, or nothing if the path has no parameter of its own."""

    t: float
    braking: bool

    @property
    def stopped(self) -> bool:
        """Whether it is at standstill because it was braked."""

    def as_text(self, t: float) -> str:
        """Return its value ``t`` as text for messages."""

    def advance(self, period: float) -> None:
        """Advance by one cycle of ``period`` seconds."""


class BrakingClock(PathParameter, Protocol):
    """A clock that can brake without further data."""

    def brake(self) -> None:
        """Brake to standstill; a second call has no effect."""


class PathClock:
    """The time along a trajectory. It advances by one period per executed cycle, and can be slowed, held, and braked to a stop.

    Slowing time scales the velocity down and keeps the path. While braking, the speed along the path falls by at most the
    deceleration times the period in each cycle, whatever the trajectory does meanwhile: if the trajectory itself slows down as
    fast, time continues unchanged; if it speeds up, time runs slower. Under an override (``aim``) the rate of time approaches the
    override factor, as fast as the velocity may change. A stop is never scaled by an override: it brakes from the present speed.
    """

    __slots__ = (
        "_deceleration",
        "_distance_at",
        "_factor",
        "_last",
        "_period",
        "_ramp",
        "_speed",
        "_start",
        "braking",
        "rate",
        "t",
    )

    def __init__(self) -> None:
        self.t = 0.0
        self.rate = 1.0  # seconds of the trajectory per second of the clock
        self._factor = 1.0  # the rate to approach
        self._last = 0.0  # the time of the previous cycle
        self._period = 0.0
        self.braking = False  # slowing down or stopped
        self._distance_at: DistanceAt | None = None
        self._ramp: float | None = None
        self._deceleration = 0.0
        self._speed = self._start = 0.0

    @property
    def is_even(self) -> bool:
        """Whether time runs at rate 1 now and in the next cycle."""
        return self.rate == 1.0 == self._factor and not self.braking

    @property
    def fastest(self) -> float:
        """The highest rate without a new request: the present one or the one to approach."""
        return max(self.rate, self._factor)

    def start_at(self, velocity: float) -> None:
        """Note the velocity before the first cycle, for a path that continues another one; without this it begins at rest."""
        self._start = velocity

    def aim(self, factor: float, distance_at: DistanceAt, ramp: float | None) -> None:
        """Let the rate of time approach ``factor``; the velocity changes by ``ramp`` per s² at most (None: change only at rest)."""
        self._factor, self._distance_at, self._ramp = factor, distance_at, ramp

    def next(self, period: float) -> float:
        """Return the time after ``advance`` if it does not brake; changes nothing."""
        return self.t + self._next_rate(period) * period

    def advance(self, period: float) -> None:
        """Advance by one cycle of ``period`` seconds; propagates exceptions of the path function."""
        if self.braking and self._deceleration:
            self._period, self._last = period, self.t
            if self.rate and self._distance_at is not None:
                self._slow_down(self._distance_at, period)
            return
        self.rate = self._next_rate(period)
        self._period, self._last = period, self.t
        self.t += self.rate * period

    def run_on(self, period: float) -> None:
        """Do the same as ``advance``; valid only if the clock ``is_even``."""
        self._period, self._last = period, self.t
        self.t += period

    def brake(self, distance_at: DistanceAt, deceleration: float) -> None:
        """Brake to a stop; ``deceleration`` in units of ``distance_at`` per s², above 0. A second call has no effect."""
        if self._deceleration:
            return
        self._distance_at, self._deceleration, self.braking = distance_at, deceleration, True
        self._speed = abs(self._velocity(distance_at))
        if not self._speed:
            self.rate = 0.0

    @property
    def stopped(self) -> bool:
        """Whether time is at standstill because it was braked."""
        return self.braking and self.rate == 0.0

    def as_text(self, t: float) -> str:
        """Return a time as text for messages."""
        return f"{t:.3f} s"

    def _next_rate(self, period: float) -> float:
        """Return the rate of the next cycle: nearer to the requested factor, as far as the velocity may change."""
        rate, factor, distance_at = self.rate, self._factor, self._distance_at
        if rate == factor or distance_at is None:
            return rate
        here = distance_at(self.t)
        now = self._velocity(distance_at)
        current, requested = (
            (distance_at(self.t + each * period) - here) / period for each in (rate, factor)
        )
        change = 0.0 if self._ramp is None else self._ramp * period
        if abs(requested - now) <= change or requested == current:
            return factor
        bound = now + change if requested > current else now - change
        if not current < bound < requested and not requested < bound < current:
            return rate if abs(bound - current) < abs(bound - requested) else factor

        def gained(share: float) -> float:
            return abs(
                (distance_at(self.t + (rate + share * (factor - rate)) * period) - here) / period - current
            )

        return rate + _share(gained, abs(requested - current), abs(bound - current)) * (factor - rate)

    def _velocity(self, distance_at: DistanceAt) -> float:
        """Return the velocity of the last cycle."""
        return (distance_at(self.t) - distance_at(self._last)) / self._period if self._period else self._start

    def _slow_down(self, distance_at: DistanceAt, period: float) -> None:
        self._speed = max(0.0, self._speed - self._deceleration * period)
        here, ahead = distance_at(self.t), self.rate * period
        natural = abs(distance_at(self.t + ahead) - here)
        if not natural or not self._speed:
            self.rate = self._speed = 0.0
            return
        allowed = self._speed * period
        if natural > allowed:
            ahead *= _share(lambda share: abs(distance_at(self.t + share * ahead) - here), natural, allowed)
        self._speed = abs(distance_at(self.t + ahead) - here) / period
        self.rate = ahead / period
        self.t += ahead


def _share(distance: DistanceAt, whole: float, wanted: float) -> float:
    """Return the share (0 to 1) of an interval at which ``distance`` is ``wanted``; its value at 1 is ``whole``, which is larger.

    If the speed varies, half of the distance is not covered in half of the time. (Regula falsi, with the Illinois method.)
    """
    low, high, under, over = 0.0, 1.0, -wanted, whole - wanted
    share, side = wanted / whole, 0
    for _ in range(_ROUNDS):
        off = distance(share) - wanted
        if abs(off) <= _CLOSE * wanted:
            break
        if off < 0.0:
            low, under, over = share, off, over * (0.5 if side < 0 else 1.0)
        else:
            high, over, under = share, off, under * (0.5 if side > 0 else 1.0)
        side = -1 if off < 0.0 else 1
        share = (low * over - high * under) / (over - under)
    return share
