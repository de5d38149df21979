"""The offsets of one axis (60B1h, 60B2h), computed in each cycle from the velocity of its set-points.

Theory of operation
-------------------
A drive in csp moves evenly from the previous target to the target of this SYNC. The velocity of a set-point is the distance between
both targets, divided by the period: exactly that of the interval which begins with this SYNC. Its acceleration is the difference
from the previous velocity. Both are computed before the set-point is rounded to increments, because a second difference of rounded
values is noise.

The constant torque changes on a ramp, because a step would be a jolt for a controller that already holds the load. If this master
does not command the axis, all offsets are 0 at once.
"""

from __future__ import annotations

import math

from axisbus.motion.feed_forward.settings import FeedForward
from axisbus.motion.parameters import AxisParameters
from axisbus.units import INT32_HALF, INT32_LEAST, whole_below

RAMP = 0.2  # seconds in which the constant torque changes from one value to another
_INT16_MOST = 32767

Offsets = tuple[int | None, int | None]  # 60B1h and 60B2h; None: not sent


class Forward:
    """Holds the velocity of the previous set-point, and the present constant torque (0.1 % of rated torque)."""

    __slots__ = (
        "_by_torque",
        "_by_velocity",
        "_change",
        "_goal",
        "_inertia",
        "_most",
        "_period",
        "_velocity",
        "_velocity_factor",
        "asked",
        "constant",
        "nothing",
    )

    def __init__(self, given: FeedForward, parameters: AxisParameters) -> None:
        units, rated = parameters.units, parameters.units.rated_torque
        per_torque = 1000.0 / rated if rated else 0.0
        self._period = parameters.scan_period
        self._by_velocity, self._by_torque = given.velocity, given.by_torque
        self._velocity_factor = units.velocity.factor * (-1.0 if given.turned else 1.0)
        self._inertia = (given.inertia or 0.0) * per_torque  # per unit/s²
        limit = parameters.limits.torque
        most = _INT16_MOST if limit is None else whole_below(abs(limit * per_torque))
        self._most = min(most, _INT16_MOST)
        self._velocity: float | None = None
        self.asked = (given.torque or 0.0) * per_torque  # the requested constant torque
        self.constant = self._goal = self._change = 0.0
        self.nothing = self._offsets(0.0, 0.0)

    def aim(self, torque: float) -> None:
        """Request another constant torque (0.1 % of rated torque); it takes effect now, or when the axis is next commanded."""
        self.asked = torque

    def rest(self) -> Offsets:
        """Return the offsets of an axis that this master does not command: 0."""
        self._velocity = None
        self.constant = self._goal = 0.0
        return self.nothing

    def lead(self, velocity: float | None, *, by_position: bool = True, holds: bool = True) -> Offsets:
        """Return the offsets of this cycle.

        ``velocity``: velocity of the set-point in unit/s; None if the last set-point is held. ``by_position``: True in csp; False
        in csv, where the target itself is the velocity. ``holds``: whether the constant torque acts; otherwise it changes to 0.
        """
        before, self._velocity = self._velocity, velocity
        acceleration = 0.0
        if velocity is not None and before is not None:
            acceleration = (velocity - before) / self._period
        goal = self.asked if holds else 0.0
        if self.constant != goal or self._goal != goal:
            self._approach(goal)
        torque = self._inertia * acceleration + self.constant
        return self._offsets((velocity or 0.0) if by_position else 0.0, torque)

    def _approach(self, goal: float) -> None:
        if goal != self._goal:
            self._goal = goal
            self._change = abs(goal - self.constant) * self._period / RAMP
        off = goal - self.constant
        self.constant = goal if abs(off) <= self._change else self.constant + math.copysign(self._change, off)

    def _offsets(self, velocity: float, torque: float) -> Offsets:
        first = second = None
        if self._by_velocity:
            first = min(max(round(velocity * self._velocity_factor), INT32_LEAST), INT32_HALF - 1)
        if self._by_torque:
            second = min(max(round(torque), -self._most), self._most)
        return first, second
