"""Moves and velocities with limited jerk: the moving average of a trapezoid or ramp.

Theory of operation
-------------------
Averaged over a time of (acceleration + deceleration) / jerk, the trapezoid changes its acceleration by no more than the jerk per
second: within that time the trapezoid's acceleration changes by at most the sum of both. The average begins with the trapezoid and
ends later by that time. Positions are piecewise parabolas, so that Simpson's rule between their transitions is exact. A new target
continues with the trapezoid and its past. In all other cases the past is a straight line that ends at the position of the axis.
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise

from axisbus.sim.ramp import Profile, ramp_velocity

_SAME = 1e-6  # increments, increments/s


class SoftProfile:
    """An active move; holds its elapsed time, and the previous trapezoid as long as the average includes it."""

    __slots__ = ("_before", "_line", "_raw", "_time", "done", "seconds")

    def __init__(
        self, raw: Profile, seconds: float, line: tuple[float, float], before: SoftProfile | None = None
    ) -> None:
        """``seconds`` (> 0): averaging time; ``line``: position and velocity at which the trapezoid begins."""
        self._raw = raw
        self.seconds = seconds
        self._line = line
        self._before = before
        self._time = 0.0
        self.done = False

    @property
    def ahead(self) -> tuple[float, float]:
        """Present position and velocity of the trapezoid."""
        return self._at(self._time)

    def is_at(self, position: float, velocity: float) -> bool:
        """Whether the axis is at the position and velocity of this move."""
        here, speed = self._mean()
        return abs(here - position) <= _SAME and abs(speed - velocity) <= _SAME

    def advance(self, dt: float) -> tuple[float, float]:
        """Return position and velocity ``dt`` seconds (>= 0) later; at the end, exactly the target."""
        self._time += dt
        if self._time >= self.seconds:
            self._before = None
        if self._time >= self._raw.duration + self.seconds:
            self.done = True
            return self._raw.target, 0.0
        return self._mean()

    def _mean(self) -> tuple[float, float]:
        begin, end = self._time - self.seconds, self._time
        joints = sorted({begin, end, *(joint for joint in self._joints() if begin < joint < end)})
        total = 0.0
        for a, b in pairwise(joints):
            first, middle, last = (self._at(t)[0] for t in (a, 0.5 * (a + b), b))
            total += (b - a) / 6.0 * (first + 4.0 * middle + last)
        return total / self.seconds, (self._at(end)[0] - self._at(begin)[0]) / self.seconds

    def _joints(self) -> list[float]:
        """Return the times at which the trapezoid, or the one before it, changes its acceleration."""
        own = [*self._raw.joints, self._raw.duration, 0.0]
        if self._before is None:
            return own
        return own + [joint - self._before._time for joint in self._before._joints()]

    def _at(self, t: float) -> tuple[float, float]:
        if t >= 0.0:
            return self._raw.at(t)
        if self._before is not None:
            return self._before._at(self._before._time + t)
        position, velocity = self._line
        return position + velocity * t, velocity


class SoftVelocity:
    """An active ramp to a velocity; holds the ramp's velocities of the last steps, whose mean is the velocity of the axis."""

    __slots__ = ("_ramp", "_seconds")

    def __init__(self, velocity: float) -> None:
        self._ramp = deque([velocity])
        self._seconds = 0.0

    def step(
        self, target: float, acceleration: float, deceleration: float, jerk: float, dt: float
    ) -> tuple[float, float]:
        """Return the velocity ``dt`` seconds later, and the distance until then; ``jerk`` 0: the ramp without averaging."""
        before = self.velocity
        self._stretch((acceleration + deceleration) / jerk if jerk > 0.0 else 0.0, dt)
        ahead, way = ramp_velocity(self._ramp[-1], target, acceleration, deceleration, dt)
        self._ramp.popleft()
        self._ramp.append(ahead)
        after = self.velocity
        return after, way if len(self._ramp) == 1 else 0.5 * (before + after) * dt

    @property
    def velocity(self) -> float:
        """The mean: the velocity of the axis."""
        return sum(self._ramp) / len(self._ramp)

    def _stretch(self, seconds: float, dt: float) -> None:
        """Change the averaging time; the average restarts from the present velocity."""
        if seconds != self._seconds:
            self._seconds = seconds
            self._ramp = deque([self.velocity] * max(1, math.ceil(seconds / dt)))
