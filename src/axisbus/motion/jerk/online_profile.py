"""One axis on its way to a place, of which the way, the velocity and the target may change at any time, with a limited jerk.

Theory of operation
-------------------
A place in front goes to the target as it would without a limit of jerk: its speed changes by the acceleration at most, and stays
low enough to come to rest there; where it cannot any more, it goes beyond and comes back. The axis is led to the mean of the last
cycles of that. So its velocity and its acceleration are means, too, and the acceleration changes by no more than twice that of
the place in front in the time of the mean. A new target changes what is in front, and nothing of what has been: neither velocity
nor acceleration jumps.
"""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple, Protocol, runtime_checkable

from axisbus.motion.group.path_speed import slow_enough

_NEXT = 1e-12  # of the place: as near as numbers come
_LEAST = 1e-9  # of the change within a cycle: what is slower stands


class ReferenceState(NamedTuple):
    """Where an axis is led to, how fast (signed) and with which acceleration; unit, per s and per s²."""

    place: float
    velocity: float = 0.0
    acceleration: float = 0.0


class JerkLimits(NamedTuple):
    """How fast (unit/s) and how hard (unit/s²) it goes, and the highest speed under an override."""

    velocity: float
    ramp: float
    top: float


@runtime_checkable
class ProfileState(Protocol):
    """What leads an axis at the mean of the last places of something in front, and may be gone on with by a ``OnlineProfile``."""

    def walk_to(self, target: float, gait: JerkLimits) -> OnlineProfile | None:
        """Return what goes on to ``target`` from where the axis is led to; None where it is not led so (any more)."""


class OnlineProfile:
    """Goes to a target. To the axis it is its clock (``Follow``): ``t`` is 0 on the way, and 1 at its end."""

    __slots__ = ("_gait", "_places", "_rests", "ahead", "braking", "factor", "led", "speed", "t", "target")

    def __init__(
        self, target: float, gait: JerkLimits, places: deque[float], speed: float, led: ReferenceState
    ) -> None:
        """``places``: those in front of the last cycles, as many as the mean has; ``speed``: that of the last one, signed."""
        self.target = target
        self._gait = gait
        self._places = places
        self.ahead, self.speed = places[-1], speed
        self.led = led
        self.factor = 1.0  # the override
        self.braking = False
        self.t = 0.0
        self._rests = 0  # cycles for which what is in front has not moved

    @property
    def window(self) -> int:
        """Of how many cycles the mean is taken."""
        return len(self._places)

    @property
    def places(self) -> deque[float]:
        """Those in front of the last cycles, of which the axis is at the mean."""
        return deque(self._places, maxlen=self.window)

    @property
    def stopped(self) -> bool:
        """Whether it stands because it was braked."""
        return self.braking and self.speed == 0.0 and self.led.place == self.ahead

    def told(self, _t: float) -> str:
        """Return where it is for people."""
        return f"{self.led.place:g} on its way to {self.target:g}"

    def brake(self) -> None:
        """Come to rest; a second call changes nothing."""
        self.braking = True

    def advance(self, period: float) -> None:
        """Go on by one cycle of ``period`` seconds."""
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
        """Return what goes on from here to another target, with all places ``by`` farther on."""
        places = deque((place + by for place in self._places), maxlen=len(self._places))
        return OnlineProfile(target, gait, places, self.speed, self.led._replace(place=self.led.place + by))

    def _go(self, period: float) -> None:
        """Let the place in front go on."""
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
    """Return what goes on from ``led``, as if its acceleration had been the same for all of the mean.

    Where that would lead the axis beyond the highest speed, the acceleration is less.
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
