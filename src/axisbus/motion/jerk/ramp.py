"""A velocity that changes with limited acceleration and limited jerk, one step per executed cycle.

Theory of operation
-------------------
In each cycle the acceleration approaches the wanted acceleration, by the jerk at most. The wanted acceleration is the highest one
that can still be reduced to 0, in each cycle by as much as the jerk allows, when the velocity reaches its goal (``_rate_to``). In
whole cycles this is a sum and no integral, so that differences of positions keep to all limits. The goal may change in every cycle:
velocity and acceleration continue from their present values. If an acceleration can no longer be reduced in time, the velocity
passes the goal and comes back.

After a harder motion, the acceleration may be too high for its own jerk to reduce it below the highest velocity, or within
``LONGEST``. Then it is reduced with a higher jerk: no axis becomes too fast, or stays fast without an end.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from axisbus.motion.jerk.online_profile import ReferenceState

LONGEST = 0.25  # seconds in which any acceleration is reduced to 0
_SAME = 1e-9  # as a share: possible error of the arithmetic


class VelocityRamps(NamedTuple):
    """How a velocity changes: away from 0 by ``up``, towards 0 by ``down`` (unit/s²), both with ``jerk`` (unit/s³); all above 0.

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
    """Commands an axis to a velocity. For the axis it is the clock of its path (``Follow``), and never ends."""

    __slots__ = ("_jerk", "_ramps", "braking", "goal", "led", "t")

    def __init__(self, led: ReferenceState, ramps: VelocityRamps) -> None:
        """``led``: the commanded position, velocity and acceleration of the last cycle; the velocity is the first goal."""
        self.led = led
        self.goal = led.velocity  # unit/s, signed
        self._ramps = ramps
        # While it has a higher acceleration than permitted.
        self._jerk = max(ramps.jerk, abs(led.acceleration) / LONGEST)
        self.braking = False
        self.t = 0.0

    @property
    def at_goal(self) -> bool:
        """Whether it has its velocity, and nothing changes any more."""
        return self.led.velocity == self.goal and self.led.acceleration == 0.0

    @property
    def stopped(self) -> bool:
        """Whether it is at standstill because it was braked."""
        return self.braking and self.led.velocity == 0.0 == self.led.acceleration

    def told(self, _t: float) -> str:
        """Return the present position as text for the user."""
        return f"{self.led.place:g} with {self.led.velocity:g}/s"

    def brake(self) -> None:
        """Begin to brake to rest; a second call changes nothing."""
        self.braking = True

    def settle(self, period: float) -> None:
        """Reduce the acceleration to 0 from now on, and keep the velocity that results."""
        self.goal = self.settled(period).velocity

    def settled(self, period: float) -> ReferenceState:
        """Return the state after the acceleration has been reduced to 0, from now on; nothing changes by this."""
        led, change = self.led, self._change(self.led, period)
        place = led.place
        while led.acceleration:
            rate = math.copysign(max(abs(led.acceleration) - change, 0.0), led.acceleration)
            velocity = led.velocity + rate * period
            place += velocity * period
            led = ReferenceState(place, velocity, rate)
        return led

    def next(self, period: float) -> ReferenceState:
        """Return the result of the next ``advance``; nothing changes by this."""
        led, goal = self.led, 0.0 if self.braking else self.goal
        change, limit, off = self._change(led, period), self._limit(led.velocity, goal), goal - led.velocity
        wanted = max(-limit, min(limit, _rate_to(off, change, period)))
        rate = max(led.acceleration - change, min(led.acceleration + change, wanted))
        velocity = led.velocity + rate * period
        if abs(velocity - goal) <= _SAME * change * period:
            velocity = goal
        return ReferenceState(led.place + velocity * period, velocity, rate)

    def advance(self, period: float) -> None:
        """Advance by one cycle of ``period`` seconds."""
        self.led = led = self.next(period)
        if abs(led.acceleration) <= self._ramps.hardest:
            self._jerk = self._ramps.jerk

    def _limit(self, velocity: float, goal: float) -> float:
        """Return the highest acceleration now: through 0 the weaker of both, so that it need not decrease there."""
        up, down = self._ramps.up, self._ramps.down
        if velocity * goal < 0.0:
            return min(up, down)
        return up if abs(velocity) < abs(goal) else down

    def _change(self, led: ReferenceState, period: float) -> float:
        """Return the permitted change of acceleration in this cycle; a higher one only if the axis would become too fast."""
        change, rate = self._jerk * period, abs(led.acceleration)
        if led.velocity * led.acceleration <= 0.0:
            return change
        room, top = self._ramps.top - abs(led.velocity), self._ramps.top
        if _gain(rate, change, period) <= room + _SAME * top:
            return change
        return 0.5 * rate * rate / room * period if room > _SAME * top else rate


def rest_way(led: ReferenceState, ramps: VelocityRamps) -> float:
    """Return the longest distance (unit, above 0) of an axis in its direction if it brakes on its ramps from now on."""
    speed, rate = abs(led.velocity), math.copysign(1.0, led.velocity) * led.acceleration
    more = max(rate, 0.0)
    peak = speed + 0.5 * more * more / ramps.jerk
    return peak * (more / ramps.jerk + 0.5 * peak / ramps.down + 0.5 * ramps.down / ramps.jerk)


def _gain(rate: float, change: float, period: float) -> float:
    """Return the change of velocity while ``rate`` (not below 0) is reduced to 0 by ``change`` in each cycle."""
    cycles = rate // change
    return period * (cycles * rate - 0.5 * change * cycles * (cycles + 1.0))


def _rate_to(off: float, change: float, period: float) -> float:
    """Return the acceleration of the next cycle from which its reduction to 0 changes the velocity by ``off``."""
    size = abs(off) / period
    cycles = math.floor(0.5 * (math.sqrt(1.0 + 8.0 * size / change) - 1.0))
    return math.copysign((size + 0.5 * change * cycles * (cycles + 1.0)) / (cycles + 1.0), off)
