"""A velocity that changes with a limited acceleration and a limited jerk, one step per executed cycle.

Theory of operation
-------------------
In each cycle the acceleration comes nearer to the one that is wanted, by the jerk at most. Wanted is the highest one from which the
velocity comes to its goal just when all of it has been let go of, as much in each cycle as the jerk allows (``_rate_to``). In whole
cycles that is a sum and no integral, and with it differences of places keep to all limits. What is asked for may change in every
cycle: velocity and acceleration go on from what they are. An acceleration that cannot be let go of in time any more leads beyond
the goal, and back.

What takes over from a harder motion may have more acceleration than its own jerk can let go of below the highest velocity, or
within ``LONGEST``. Then it is let go of as suddenly as that takes: no axis becomes too fast, or fast without an end.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from axisbus.motion.jerk.online_profile import ReferenceState

LONGEST = 0.25  # seconds in which any acceleration is let go of
_SAME = 1e-9  # as a share: what arithmetic may be off


class VelocityRamps(NamedTuple):
    """How a velocity changes: away from 0 by ``up``, towards it by ``down`` (unit/s²), both by ``jerk`` (unit/s³); all above 0.

    ``top``: the highest speed of the axis (unit/s), which may be infinite.
    """

    up: float
    down: float
    jerk: float
    top: float = math.inf

    @property
    def hardest(self) -> float:
        """The harder of both accelerations."""
        return max(self.up, self.down)


class SoftRamp:
    """Leads an axis to a velocity. To the axis it is its clock (``Follow``), which never comes to an end."""

    __slots__ = ("_jerk", "_ramps", "braking", "goal", "led", "t")

    def __init__(self, led: ReferenceState, ramps: VelocityRamps) -> None:
        """``led``: where the axis was led to in the last cycle, how fast, and with which acceleration; it keeps that velocity."""
        self.led = led
        self.goal = led.velocity  # unit/s, signed
        self._ramps = ramps
        self._jerk = max(ramps.jerk, abs(led.acceleration) / LONGEST)  # as long as it has more than it may
        self.braking = False
        self.t = 0.0

    @property
    def at_goal(self) -> bool:
        """Whether it has its velocity, and nothing changes any more."""
        return self.led.velocity == self.goal and self.led.acceleration == 0.0

    @property
    def stopped(self) -> bool:
        """Whether it stands because it was braked."""
        return self.braking and self.led.velocity == 0.0 == self.led.acceleration

    def told(self, _t: float) -> str:
        """Return where it is for people."""
        return f"{self.led.place:g} with {self.led.velocity:g}/s"

    def brake(self) -> None:
        """Come to rest; a second call changes nothing."""
        self.braking = True

    def settle(self, period: float) -> None:
        """Let the acceleration go at once, and keep the velocity that is left then."""
        self.goal = self.settled(period).velocity

    def settled(self, period: float) -> ReferenceState:
        """Return where it is when it has let its acceleration go, from now on; nothing changes by this."""
        led, change = self.led, self._change(self.led, period)
        place = led.place
        while led.acceleration:
            rate = math.copysign(max(abs(led.acceleration) - change, 0.0), led.acceleration)
            velocity = led.velocity + rate * period
            place += velocity * period
            led = ReferenceState(place, velocity, rate)
        return led

    def next(self, period: float) -> ReferenceState:
        """Return what ``advance`` comes to; nothing changes by this."""
        led, goal = self.led, 0.0 if self.braking else self.goal
        change, limit, off = self._change(led, period), self._limit(led.velocity, goal), goal - led.velocity
        wanted = max(-limit, min(limit, _rate_to(off, change, period)))
        rate = max(led.acceleration - change, min(led.acceleration + change, wanted))
        velocity = led.velocity + rate * period
        if abs(velocity - goal) <= _SAME * change * period:
            velocity = goal
        return ReferenceState(led.place + velocity * period, velocity, rate)

    def advance(self, period: float) -> None:
        """Go on by one cycle of ``period`` seconds."""
        self.led = led = self.next(period)
        if abs(led.acceleration) <= self._ramps.hardest:
            self._jerk = self._ramps.jerk

    def _limit(self, velocity: float, goal: float) -> float:
        """Return the highest acceleration now: through 0 the weaker of both, so that it need not fall there."""
        up, down = self._ramps.up, self._ramps.down
        if velocity * goal < 0.0:
            return min(up, down)
        return up if abs(velocity) < abs(goal) else down

    def _change(self, led: ReferenceState, period: float) -> float:
        """Return by how much the acceleration may change in this cycle; more only where the axis would be too fast otherwise."""
        change, rate = self._jerk * period, abs(led.acceleration)
        if led.velocity * led.acceleration <= 0.0:
            return change
        room, top = self._ramps.top - abs(led.velocity), self._ramps.top
        if _gain(rate, change, period) <= room + _SAME * top:
            return change
        return 0.5 * rate * rate / room * period if room > _SAME * top else rate


def rest_way(led: ReferenceState, ramps: VelocityRamps) -> float:
    """Return how far (unit, above 0) an axis goes on at most in its direction, where it is braked on its ramps from now on."""
    speed, rate = abs(led.velocity), math.copysign(1.0, led.velocity) * led.acceleration
    more = max(rate, 0.0)
    peak = speed + 0.5 * more * more / ramps.jerk
    return peak * (more / ramps.jerk + 0.5 * peak / ramps.down + 0.5 * ramps.down / ramps.jerk)


def _gain(rate: float, change: float, period: float) -> float:
    """Return by how much the velocity still changes while ``rate`` (not below 0) is let go of by ``change`` in each cycle."""
    cycles = rate // change
    return period * (cycles * rate - 0.5 * change * cycles * (cycles + 1.0))


def _rate_to(off: float, change: float, period: float) -> float:
    """Return the acceleration of the next cycle from which letting go leads to a velocity that is ``off`` by now."""
    size = abs(off) / period
    cycles = math.floor(0.5 * (math.sqrt(1.0 + 8.0 * size / change) - 1.0))
    return math.copysign((size + 0.5 * change * cycles * (cycles + 1.0)) / (cycles + 1.0), off)
