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

_NEXT = 1e-12  # of the largest position: the resolution of the arithmetic
_LEAST = 1e-9  # of the change within a cycle: a slower speed counts as standstill


class ReferenceState(NamedTuple):
    """The commanded position, velocity (signed) and acceleration of an axis; unit, per s and per s²."""

    position: float
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

    def continued_to(self, target: float, jerk_limits: JerkLimits) -> OnlineProfile | None:
        """Return the profile that continues to ``target`` from the commanded state; None if the axis is on another path."""


class OnlineProfile:
    """A move to a target. For the axis it is the clock of its path (``Follow``): ``t`` is 0 during the move, and 1 at its end."""

    __slots__ = (
        "_jerk_limits",
        "_next",
        "_positions",
        "_rests",
        "ahead",
        "braking",
        "factor",
        "reference",
        "speed",
        "t",
        "target",
    )

    def __init__(
        self,
        target: float,
        jerk_limits: JerkLimits,
        positions: deque[float],
        speed: float,
        reference: ReferenceState,
    ) -> None:
        """``positions``: unfiltered positions of the last cycles, as many as in the average; ``speed``: the last one, signed."""
        self.target = target
        self._jerk_limits = jerk_limits
        self._positions = positions
        self.ahead, self.speed = positions[-1], speed
        self._next = _NEXT * max(1.0, abs(target), abs(self.ahead))
        self.reference = reference
        self.factor = 1.0  # the override
        self.braking = False
        self.t = 0.0
        self._rests = 0  # cycles for which the unfiltered position has not moved

    @property
    def window(self) -> int:
        """The number of cycles in the moving average."""
        return len(self._positions)

    @property
    def positions(self) -> deque[float]:
        """The unfiltered positions of the last cycles, whose average is the axis's position."""
        return deque(self._positions, maxlen=self.window)

    @property
    def stopped(self) -> bool:
        """Whether it is at standstill because it was braked."""
        return self.braking and self.speed == 0.0 and self.reference.position == self.ahead

    def as_text(self, _t: float) -> str:
        """Return the present position as text for the user."""
        return f"{self.reference.position:g} on its way to {self.target:g}"

    def brake(self) -> None:
        """Begin to brake to rest; a second call changes nothing."""
        self.braking = True

    def advance(self, period: float) -> None:
        """Advance by one cycle of ``period`` seconds."""
        self._advance_unfiltered(period)
        positions, ahead, before = self._positions, self.ahead, self.reference
        self._rests = self._rests + 1 if ahead == positions[-1] else 0
        positions.append(ahead)
        position = ahead if self._rests >= len(positions) - 1 else sum(positions) / len(positions)
        velocity = (position - before.position) / period
        self.reference = ReferenceState(position, velocity, (velocity - before.velocity) / period)
        if position == self.target and ahead == position:
            self.t = 1.0

    def retargeted(self, target: float, jerk_limits: JerkLimits, by: float) -> OnlineProfile:
        """Return the profile that continues from here to another target, with all positions shifted by ``by``."""
        positions = deque((position + by for position in self._positions), maxlen=len(self._positions))
        return OnlineProfile(
            target,
            jerk_limits,
            positions,
            self.speed,
            self.reference._replace(position=self.reference.position + by),
        )

    def _advance_unfiltered(self, period: float) -> None:
        """Advance the unfiltered position."""
        ramp = self._jerk_limits.ramp
        direction = math.copysign(1.0, self.target - self.ahead)
        left, v, change = abs(self.target - self.ahead), direction * self.speed, ramp * period
        w = max(v - change, min(v + change, self._wanted, slow_enough(v, 0.0, ramp, left, period)))
        w = 0.0 if abs(w) < _LEAST * change else w
        covered = 0.5 * v * abs(v) / ramp if w == 0.0 and abs(v) < change else 0.5 * (v + w) * period
        if abs(left - covered) <= self._next and abs(w) <= change:
            self.ahead, self.speed = self.target, 0.0
        else:
            self.ahead, self.speed = self.ahead + direction * covered, direction * w

    @property
    def _wanted(self) -> float:
        return 0.0 if self.braking else min(self._jerk_limits.velocity * self.factor, self._jerk_limits.top)


def online_profile_from(
    reference: ReferenceState, target: float, jerk_limits: JerkLimits, window: int, period: float
) -> OnlineProfile:
    """Return the profile that continues from ``reference``, as if its acceleration had been constant during the averaging window.

    If this would command a speed above the highest one, the acceleration is reduced.
    """
    time = window * period
    headroom = max(jerk_limits.top - abs(reference.velocity), 0.0)
    most = 2.0 * headroom / time
    rate = (
        reference.acceleration
        if reference.acceleration * reference.velocity < 0.0
        else max(-most, min(most, reference.acceleration))
    )
    speed = reference.velocity + 0.5 * rate * time
    times = [-n * period for n in range(window - 1, -1, -1)]
    shape = [speed * t + 0.5 * rate * t * t for t in times]
    off = reference.position - sum(shape) / window
    return OnlineProfile(
        target, jerk_limits, deque((off + position for position in shape), maxlen=window), speed, reference
    )


# -- A velocity that changes with limited acceleration and limited jerk, one step per executed cycle -------------------
#
# Theory of operation
# In each cycle the acceleration approaches the wanted acceleration, by the jerk at most. The wanted acceleration is the highest
# one that can still be reduced to 0, in each cycle by as much as the jerk allows, when the velocity reaches its goal
# (``_rate_to``). In whole cycles this is a sum and no integral, so that differences of positions keep to all limits. The goal may
# change in every cycle: velocity and acceleration continue from their present values. If an acceleration can no longer be reduced
# in time, the velocity passes the goal and comes back.
#
# After a harder motion, the acceleration may be too high for its own jerk to reduce it below the highest velocity, or within
# ``LONGEST``. Then it is reduced with a higher jerk: no axis becomes too fast, or stays fast without an end.


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

    __slots__ = ("_jerk", "_ramps", "braking", "goal", "reference", "t")

    def __init__(self, reference: ReferenceState, ramps: VelocityRamps) -> None:
        """``reference``: the commanded position, velocity and acceleration of the last cycle; the velocity is the first goal."""
        self.reference = reference
        self.goal = reference.velocity  # unit/s, signed
        self._ramps = ramps
        # While it has a higher acceleration than permitted.
        self._jerk = max(ramps.jerk, abs(reference.acceleration) / LONGEST)
        self.braking = False
        self.t = 0.0

    @property
    def at_goal(self) -> bool:
        """Whether it has its velocity, and nothing changes any more."""
        return self.reference.velocity == self.goal and self.reference.acceleration == 0.0

    @property
    def stopped(self) -> bool:
        """Whether it is at standstill because it was braked."""
        return self.braking and self.reference.velocity == 0.0 == self.reference.acceleration

    def as_text(self, _t: float) -> str:
        """Return the present position as text for the user."""
        return f"{self.reference.position:g} with {self.reference.velocity:g}/s"

    def brake(self) -> None:
        """Begin to brake to rest; a second call changes nothing."""
        self.braking = True

    def settle(self, period: float) -> None:
        """Reduce the acceleration to 0 from now on, and keep the velocity that results."""
        self.goal = self.settled(period).velocity

    def settled(self, period: float) -> ReferenceState:
        """Return the state after the acceleration has been reduced to 0, from now on; nothing changes by this."""
        reference, change = self.reference, self._change(self.reference, period)
        position = reference.position
        while reference.acceleration:
            rate = math.copysign(max(abs(reference.acceleration) - change, 0.0), reference.acceleration)
            velocity = reference.velocity + rate * period
            position += velocity * period
            reference = ReferenceState(position, velocity, rate)
        return reference

    def next(self, period: float) -> ReferenceState:
        """Return the result of the next ``advance``; nothing changes by this."""
        reference, goal = self.reference, 0.0 if self.braking else self.goal
        change, limit, off = (
            self._change(reference, period),
            self._limit(reference.velocity, goal),
            goal - reference.velocity,
        )
        wanted = max(-limit, min(limit, _rate_to(off, change, period)))
        rate = max(reference.acceleration - change, min(reference.acceleration + change, wanted))
        velocity = reference.velocity + rate * period
        if abs(velocity - goal) <= _SAME * change * period:
            velocity = goal
        return ReferenceState(reference.position + velocity * period, velocity, rate)

    def advance(self, period: float) -> None:
        """Advance by one cycle of ``period`` seconds."""
        self.reference = reference = self.next(period)
        if abs(reference.acceleration) <= self._ramps.hardest:
            self._jerk = self._ramps.jerk

    def _limit(self, velocity: float, goal: float) -> float:
        """Return the highest acceleration now: through 0 the weaker of both, so that it need not decrease there."""
        up, down = self._ramps.up, self._ramps.down
        if velocity * goal < 0.0:
            return min(up, down)
        return up if abs(velocity) < abs(goal) else down

    def _change(self, reference: ReferenceState, period: float) -> float:
        """Return the permitted change of acceleration in this cycle; a higher one only if the axis would become too fast."""
        change, rate = self._jerk * period, abs(reference.acceleration)
        if reference.velocity * reference.acceleration <= 0.0:
            return change
        headroom, top = self._ramps.top - abs(reference.velocity), self._ramps.top
        if _gain(rate, change, period) <= headroom + _SAME * top:
            return change
        return 0.5 * rate * rate / headroom * period if headroom > _SAME * top else rate


def stopping_distance(reference: ReferenceState, ramps: VelocityRamps) -> float:
    """Return the longest distance (unit, above 0) of an axis in its direction if it brakes on its ramps from now on."""
    speed, rate = abs(reference.velocity), math.copysign(1.0, reference.velocity) * reference.acceleration
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
