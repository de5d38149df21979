"""Whether an axis has reached the velocity that the master commands: from the measured values, not from the sent ones."""

from __future__ import annotations

import math

from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.continuous_motion import VELOCITY_FLOOR, VELOCITY_SHARE, velocity_missed
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.override.factor import scaled
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.velocity_estimator import VelocityEstimator

_FILTER = 0.2  # share of a new sample in the mean of a noisy velocity
_MARGIN = 2.0  # seconds that the axis may be late, in addition to four times its ramp


class VelocityReached:
    """Holds the commanded velocity under the override, its measured values, and the remaining time."""

    def __init__(self, profile: MoveProfile, parameters: AxisParameters) -> None:
        """``profile`` with a signed velocity, all of its ratios, and a jerk."""
        assert profile.speed is not None
        units, velocity = parameters.units, profile.velocity
        sign = math.copysign(1.0, units.velocity.to_units(velocity)) if velocity else 0.0
        self._asked = sign * profile.speed / abs(units.position.factor)  # unit/s
        self._profile = profile
        self._parameters = parameters
        self._track = VelocityEstimator()  # of the positions, for a drive whose 606Ch is not received
        self._mean: float | None = None
        self.override(1.0)

    def override(self, factor: float) -> None:
        """Restart the check with the velocity under another override."""
        limit, asked = self._parameters.limits.velocity, self._asked
        speed = abs(asked) * factor
        speed = speed if limit is None else min(speed, max(limit, abs(asked)))
        self.goal = math.copysign(speed, asked) if asked else 0.0
        self._target = scaled(self._profile.velocity, factor, self._parameters)
        self._deadline: float | None = None
        self._is_there = False

    def step(self, image: AxisImage, *, at_goal: bool) -> bool:
        """Return whether the velocity is reached, or was; ``at_goal``: the set-points no longer change.

        Raises:
            MotionTimeout: the time for it has passed.
        """
        self._track.take(image.position, image.position_stamp)
        if self._deadline is None:
            self._deadline = image.now + self._allowed(abs(self._measured(image) or 0.0))
        if self._is_there:
            return True
        self._is_there = at_goal and self._in_velocity(image)
        if not self._is_there and image.now > self._deadline:
            raise velocity_missed(image, self._parameters, self._target)
        return self._is_there

    def _measured(self, image: AxisImage) -> float | None:
        """Return the velocity in unit/s, from 606Ch, else from the positions; None if neither is known yet."""
        units = self._parameters.units
        if image.velocity is not None:
            return units.velocity.to_units(image.velocity)
        return units.position.to_units(self._track.motion[0]) if self._track.is_known else None

    def _in_velocity(self, image: AxisImage) -> bool:
        """Whether the velocity (or its mean, if it is noisy) has reached the goal; more than half of it is always required."""
        goal, velocity = self.goal, self._measured(image)
        if velocity is None:
            return False
        self._mean = velocity if self._mean is None else self._mean + _FILTER * (velocity - self._mean)
        floor = abs(self._parameters.units.velocity.to_units(VELOCITY_FLOOR))
        off = min(abs(velocity - goal), abs(self._mean - goal))
        if not goal:
            return off <= floor or image.standstill
        return off < 0.5 * abs(goal) and off <= max(floor, VELOCITY_SHARE * abs(goal))

    def _allowed(self, speed: float) -> float:
        """Return four times the ramp from ``speed`` (of either direction) through 0 to the new one with its jerk, plus a margin."""
        profile, unit = self._profile, abs(self._parameters.units.position.factor)
        if profile.timeout is not None:
            return profile.timeout
        assert profile.ramp
        return (
            4.0 * (speed + abs(self.goal)) * unit / profile.ramp + 2.0 * profile.soft_seconds(unit) + _MARGIN
        )
