"""Trapezoidal moves and velocity ramps by closed formulas.

Theory of operation
-------------------
A ``Profile`` is planned once, from any velocity, as at most five segments of constant acceleration, and then evaluated at any time:
the step width does not matter, and the end is exactly the target. After a change of target or limits, a new profile is planned from
the present position and velocity. All values are floats in increments, increments/s and increments/s².
"""

from __future__ import annotations

import math
from collections import deque
from itertools import pairwise


class Profile:
    """An active move; holds its elapsed time."""

    __slots__ = (
        "_base",
        "_count",
        "_index",
        "_pieces",
        "_time",
        "done",
        "duration",
        "end_velocity",
        "target",
    )

    def __init__(self, start: float, target: float, pieces: list[tuple[float, float, float]]) -> None:
        """``pieces``: segments of (duration in s, initial velocity, acceleration); ``target``: their end position."""
        self.target = target
        self._base = []
        time, position, velocity = 0.0, start, pieces[0][1] if pieces else 0.0
        for duration, velocity, acceleration in pieces:
            self._base.append((time, position))
            time += duration
            position += velocity * duration + 0.5 * acceleration * duration * duration
            velocity += acceleration * duration
        self._pieces = pieces
        self._count = len(pieces)
        self._index = 0
        self._time = 0.0
        self.duration = time
        self.end_velocity = velocity if abs(velocity) > 1e-6 else 0.0
        self.done = not pieces

    def advance(self, dt: float) -> tuple[float, float]:
        """Return position and velocity ``dt`` seconds (>= 0) later; at the end, exactly the target.

        A profile with an end velocity ends at its target; the rest of the last step is not used.
        """
        self._time = time = self._time + dt
        if time >= self.duration:
            self.done = True
            return self.target, self.end_velocity
        index = self._index
        while index + 1 < self._count and time >= self._base[index + 1][0]:
            index += 1
        self._index = index
        return self._within(index, time)

    @property
    def segment_starts(self) -> list[float]:
        """Begin of each segment, in seconds."""
        return [begin for begin, _ in self._base]

    def at(self, time: float) -> tuple[float, float]:
        """Return position and velocity at any ``time`` >= 0; after the end, the target."""
        if time >= self.duration:
            return self.target, self.end_velocity
        index = sum(1 for begin, _ in self._base if begin <= time) - 1
        return self._within(max(index, 0), time)

    def _within(self, index: int, time: float) -> tuple[float, float]:
        begin, position = self._base[index]
        _, velocity, acceleration = self._pieces[index]
        t = time - begin
        return position + (velocity + 0.5 * acceleration * t) * t, velocity + acceleration * t


def plan_move(
    start: float,
    velocity: float,
    target: float,
    limit: float,
    acceleration: float,
    deceleration: float,
    end_velocity: float = 0.0,
) -> Profile:
    """Plan the fastest trapezoid from ``start``, moving at ``velocity``, to ``target``.

    ``limit``, ``acceleration`` and ``deceleration`` are > 0; ``end_velocity`` (>= 0) is the speed, in the direction of the move, at
    which the target is passed. A motion that cannot stop before the target overshoots and returns.
    """
    passing = end_velocity > 0.0 and velocity * (target - start) > 0.0
    rest = start if passing else start + velocity * abs(velocity) / (2.0 * deceleration)
    distance = target - rest
    if abs(distance) < 1e-9:
        distance = velocity  # braking alone ends at the target
    direction = 1.0 if distance >= 0.0 else -1.0
    pieces = _pieces(
        (target - start) * direction,
        velocity * direction,
        limit,
        acceleration,
        deceleration,
        min(end_velocity, limit),
    )
    return Profile(start, target, [(t, v * direction, a * direction) for t, v, a in pieces if t > 0.0])


def _pieces(
    distance: float, velocity: float, limit: float, acceleration: float, deceleration: float, end: float
) -> list[tuple[float, float, float]]:
    """Plan in the direction of the move: ``distance`` to go, ``velocity`` negative if it must reverse first."""
    pieces = []
    if velocity < 0.0:
        pieces.append((-velocity / deceleration, velocity, deceleration))
        distance += velocity * velocity / (2.0 * deceleration)
        velocity = 0.0
    elif velocity > limit:
        pieces.append(((velocity - limit) / deceleration, velocity, -deceleration))
        distance -= (velocity * velocity - limit * limit) / (2.0 * deceleration)
        velocity = limit
    if end > 0.0:  # as far as the distance lets the speed change
        end = min(end, math.sqrt(velocity * velocity + 2.0 * acceleration * max(0.0, distance)))
        end = max(end, math.sqrt(max(0.0, velocity * velocity - 2.0 * deceleration * distance)))
    both = acceleration + deceleration
    square = 2.0 * acceleration * deceleration * distance
    square = (square + deceleration * velocity * velocity + acceleration * end * end) / both
    peak = min(limit, math.sqrt(max(0.0, square)))
    if peak < velocity:  # rounding only: there is just room to brake
        peak = velocity
    speeding = (peak * peak - velocity * velocity) / (2.0 * acceleration)
    braking = max(0.0, peak * peak - end * end) / (2.0 * deceleration)
    pieces.append(((peak - velocity) / acceleration, velocity, acceleration))
    if peak > 0.0:
        pieces.append((max(0.0, distance - speeding - braking) / peak, peak, 0.0))
    pieces.append((max(0.0, peak - end) / deceleration, peak, -deceleration))
    return pieces


def ramp_velocity(
    velocity: float, target: float, acceleration: float, deceleration: float, dt: float
) -> tuple[float, float]:
    """Return the velocity after ``dt`` seconds of a ramp to ``target``, and the distance covered.

    Away from zero ``acceleration`` applies, towards zero ``deceleration``; with a rate of 0 the velocity does not change.
    """
    distance = 0.0
    while dt > 0.0 and velocity != target:
        slowing = velocity * target < 0.0 or abs(velocity) > abs(target)
        rate = deceleration if slowing else acceleration
        goal = target if not slowing or velocity * target > 0.0 else 0.0
        if rate <= 0.0:
            break
        time = abs(goal - velocity) / rate
        if time > dt:
            step = rate * dt if goal > velocity else -rate * dt
            return velocity + step, distance + (velocity + 0.5 * step) * dt
        distance += 0.5 * (velocity + goal) * time
        velocity = goal
        dt -= time
    return velocity, distance + velocity * dt


def slope(value: float, target: float, rate: float, dt: float) -> float:
    """Return ``value`` moved towards ``target`` by at most ``rate * dt``."""
    step = rate * dt
    if target > value:
        return min(target, value + step)
    return max(target, value - step)


# -- Moves and velocities with limited jerk: the moving average of a trapezoid or ramp ---------------------------------
#
# Theory of operation
# Averaged over a time of (acceleration + deceleration) / jerk, the trapezoid changes its acceleration by no more than the jerk
# per second: within that time the trapezoid's acceleration changes by at most the sum of both. The average begins with the
# trapezoid and ends later by that time. Positions are piecewise parabolas, so that Simpson's rule between their transitions is
# exact. A new target continues with the trapezoid and its past. In all other cases the past is a straight line that ends at the
# position of the axis.


_SAME = 1e-6  # increments, increments/s


class SoftProfile:
    """An active move; holds its elapsed time, and the previous trapezoid as long as the average includes it."""

    __slots__ = ("_before", "_raw", "_start", "_time", "done", "seconds")

    def __init__(
        self, raw: Profile, seconds: float, start: tuple[float, float], before: SoftProfile | None = None
    ) -> None:
        """``seconds`` (> 0): averaging time; ``start``: position and velocity at which the trapezoid begins."""
        self._raw = raw
        self.seconds = seconds
        self._start = start
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
        segment_starts = sorted(
            {
                begin,
                end,
                *(segment_start for segment_start in self._segment_starts() if begin < segment_start < end),
            }
        )
        total = 0.0
        for a, b in pairwise(segment_starts):
            first, middle, last = (self._at(t)[0] for t in (a, 0.5 * (a + b), b))
            total += (b - a) / 6.0 * (first + 4.0 * middle + last)
        return total / self.seconds, (self._at(end)[0] - self._at(begin)[0]) / self.seconds

    def _segment_starts(self) -> list[float]:
        """Return the times at which the trapezoid, or the one before it, changes its acceleration."""
        own = [*self._raw.segment_starts, self._raw.duration, 0.0]
        if self._before is None:
            return own
        return own + [segment_start - self._before._time for segment_start in self._before._segment_starts()]

    def _at(self, t: float) -> tuple[float, float]:
        if t >= 0.0:
            return self._raw.at(t)
        if self._before is not None:
            return self._before._at(self._before._time + t)
        position, velocity = self._start
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
        self._set_averaging_time((acceleration + deceleration) / jerk if jerk > 0.0 else 0.0, dt)
        ahead, distance = ramp_velocity(self._ramp[-1], target, acceleration, deceleration, dt)
        self._ramp.popleft()
        self._ramp.append(ahead)
        after = self.velocity
        return after, distance if len(self._ramp) == 1 else 0.5 * (before + after) * dt

    @property
    def velocity(self) -> float:
        """The mean: the velocity of the axis."""
        return sum(self._ramp) / len(self._ramp)

    def _set_averaging_time(self, seconds: float, dt: float) -> None:
        """Change the averaging time; the average restarts from the present velocity."""
        if seconds != self._seconds:
            self._seconds = seconds
            self._ramp = deque([self.velocity] * max(1, math.ceil(seconds / dt)))
