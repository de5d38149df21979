"""Move one axis to a position with limited jerk; target and velocity may change at any time.

Theory of operation
-------------------
An unfiltered position moves to the target as it would without a jerk limit: its speed changes by the acceleration at most, and
stays low enough to come to rest at the target. If that is no longer possible, it passes the target and comes back. The commanded
position of the axis is the moving average of the unfiltered positions of the last cycles. So the commanded velocity and
acceleration are averages too, and within the time of the averaging window the acceleration changes by no more than twice that of
the unfiltered position. A new target changes only the future unfiltered positions. So neither velocity nor acceleration jumps.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple, Protocol, runtime_checkable

from axisbus.motion.group.path_speed import slow_enough

_NEXT = 1e-12  # of the position: the resolution of the arithmetic
_LEAST = 1e-9  # of the change within a cycle: a slower speed counts as standstill


class ReferenceState(NamedTuple):
    """The commanded position, velocity (signed) and acceleration of an axis; unit, per s and per s²."""

    place: float
    velocity: float = 0.0
    acceleration: float = 0.0


class JerkLimits(NamedTuple):
    """The velocity (unit/s) and acceleration (unit/s²) of a profile, and the highest speed under an override."""

    velocity: float
    ramp: float
    top: float


@runtime_checkable
class ProfileState(Protocol):
    """A path at the moving average of unfiltered positions, which an ``OnlineProfile`` can continue."""

    def walk_to(self, target: float, gait: JerkLimits) -> OnlineProfile | None:
        """Return the profile that continues to ``target`` from the commanded state; None if the axis is on another path."""


class OnlineProfile:
    """A move to a target. For the axis it is the clock of its path (``Follow``): ``t`` is 0 during the move, and 1 at its end."""

    __slots__ = ("_gait", "_places", "_rests", "ahead", "braking", "factor", "led", "speed", "t", "target")

    def __init__(
        self, target: float, gait: JerkLimits, places: deque[float], speed: float, led: ReferenceState
    ) -> None:
        """``places``: the unfiltered positions of the last cycles, as many as the average has; ``speed``: the last one, signed."""
        self.target = target
        self._gait = gait
        self._places = places
        self.ahead, self.speed = places[-1], speed
        self.led = led
        self.factor = 1.0  # the override
        self.braking = False
        self.t = 0.0
        self._rests = 0  # cycles for which the unfiltered position has not moved

    @property
    def window(self) -> int:
        """The number of cycles in the moving average."""
        return len(self._places)

    @property
    def places(self) -> deque[float]:
        """The unfiltered positions of the last cycles, whose average is the axis's position."""
        return deque(self._places, maxlen=self.window)

    @property
    def stopped(self) -> bool:
        """Whether it is at standstill because it was braked."""
        return self.braking and self.speed == 0.0 and self.led.place == self.ahead

    def told(self, _t: float) -> str:
        """Return the present position as text for the user."""
        return f"{self.led.place:g} on its way to {self.target:g}"

    def brake(self) -> None:
        """Begin to brake to rest; a second call changes nothing."""
        self.braking = True

    def advance(self, period: float) -> None:
        """Advance by one cycle of ``period`` seconds."""
        self._go(period)
        places, ahead, before = self._places, self.ahead, self.led
        self._rests = self._rests + 1 if ahead == places[-1] else 0
        places.append(ahead)
        place = ahead if self._rests >= len(places) - 1 else sum(places) / len(places)
        velocity = (place - before.place) / period
        self.led = ReferenceState(place, velocity, (velocity - before.velocity) / period)
        if place == self.target and ahead == place:
            self.t = 1.0

    def turned(self, target: float, gait: JerkLimits, by: float) -> OnlineProfile:
        """Return the profile that continues from here to another target, with all positions shifted by ``by``."""
        places = deque((place + by for place in self._places), maxlen=len(self._places))
        return OnlineProfile(target, gait, places, self.speed, self.led._replace(place=self.led.place + by))

    def _go(self, period: float) -> None:
        """Advance the unfiltered position."""
        ramp = self._gait.ramp
        way = math.copysign(1.0, self.target - self.ahead)
        left, v, change = abs(self.target - self.ahead), way * self.speed, ramp * period
        w = max(v - change, min(v + change, self._wanted, slow_enough(v, 0.0, ramp, left, period)))
        w = 0.0 if abs(w) < _LEAST * change else w
        covered = 0.5 * v * abs(v) / ramp if w == 0.0 and abs(v) < change else 0.5 * (v + w) * period
        if abs(left - covered) <= _NEXT * max(1.0, abs(self.target)) and abs(w) <= change:
            self.ahead, self.speed = self.target, 0.0
        else:
            self.ahead, self.speed = self.ahead + way * covered, way * w

    @property
    def _wanted(self) -> float:
        return 0.0 if self.braking else min(self._gait.velocity * self.factor, self._gait.top)


def walk_from(
    led: ReferenceState, target: float, gait: JerkLimits, window: int, period: float
) -> OnlineProfile:
    """Return the profile that continues from ``led``, as if its acceleration had been constant during the averaging window.

    If this would command a speed above the highest one, the acceleration is reduced.
    """
    time = window * period
    room = max(gait.top - abs(led.velocity), 0.0)
    most = 2.0 * room / time
    rate = (
        led.acceleration if led.acceleration * led.velocity < 0.0 else max(-most, min(most, led.acceleration))
    )
    speed = led.velocity + 0.5 * rate * time
    gone = [-n * period for n in range(window - 1, -1, -1)]
    shape = [speed * t + 0.5 * rate * t * t for t in gone]
    off = led.place - sum(shape) / window
    return OnlineProfile(target, gait, deque((off + place for place in shape), maxlen=window), speed, led)
