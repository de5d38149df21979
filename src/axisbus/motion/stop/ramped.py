"""The way that a velocity on ramps should have made, against the way that was made; forgetful, because no speed is exact.

Theory of operation
-------------------
The commanded velocity goes up by the profile acceleration and down by the deceleration, from the velocity that the axis had. Its
way is integrated from position to position, and what was made is taken off. An exact integral would grow for ever by a speed
that is one increment off, so the difference decays, and the slower the axis is to turn the longer it takes: an axis that makes
less than half of the way it should is found out, in about 1.4 times ``window / speed + 0.25 s``; one that makes more is not.
"""

from __future__ import annotations

import math

from axisbus.cia402 import objects
from axisbus.motion.axis.image import Image
from axisbus.motion.moves.profile import Profile
from axisbus.motion.parameters import AxisParameters

_LAG_TIME = 0.25  # seconds of lag that a drive may have (see ``AxisParameters.lag_allowed``)
_LONGEST = 60.0  # seconds of memory


class RampedWay:
    """Holds the velocity that is commanded by now, and how far the axis is behind it (position increments, None: not known)."""

    __slots__ = (
        "_down",
        "_per_velocity",
        "_position",
        "_stamp",
        "_target",
        "_up",
        "_window",
        "behind",
        "speed",
    )

    def __init__(self, target: float, per_velocity: float, up: float, down: float, window: float) -> None:
        """``target`` in the drive's velocity increments (signed), each of ``per_velocity`` position increments per s.

        ``up`` and ``down`` in position increments per s², above 0; ``window`` in position increments.
        """
        self._target = target * per_velocity
        self._per_velocity = per_velocity
        self._up = up
        self._down = down
        self._window = window
        self._position = 0
        self._stamp = 0.0
        self.speed = 0.0
        self.behind: float | None = None

    def aim(self, target: float) -> None:
        """Go on to another target, in the drive's velocity increments."""
        self._target = target * self._per_velocity

    def step(self, image: Image) -> None:
        """Take this cycle's position; begin from what the axis does, where that is known."""
        position, stamp = image.position, image.position_stamp
        if position is None:
            self.behind = None
        elif self.behind is None:
            if image.velocity is not None:
                self.speed, self.behind = image.velocity * self._per_velocity, 0.0
                self._position, self._stamp = position, stamp
        elif stamp > self._stamp:
            self._advance(position, stamp - self._stamp)
            self._position, self._stamp = position, stamp

    def _advance(self, position: int, dt: float) -> None:
        before = self.speed
        self._ramp(dt)
        way = 0.5 * (before + self.speed) * dt - (position - self._position)
        behind = self.behind or 0.0
        self.behind = behind + way - behind * min(1.0, dt / self._memory(before))

    def _memory(self, speed: float) -> float:
        """Seconds in which a difference is forgotten: twice those in which an axis that stands loses all that is allowed."""
        fastest = max(abs(speed), abs(self._target))
        return min(_LONGEST, 2.0 * (self._window / fastest + _LAG_TIME)) if fastest else _LONGEST

    def _ramp(self, dt: float) -> None:
        speed, target = self.speed, self._target
        slows = abs(target) < abs(speed) or speed * target < 0.0
        change = (self._down if slows else self._up) * dt
        self.speed = max(speed - change, target) if target < speed else min(speed + change, target)


def ramped_way(profile: Profile, parameters: AxisParameters) -> RampedWay | None:
    """Return the watch over a velocity move; None where the drive's ramps, or the ratio of its units, are not known."""
    units = parameters.units
    if not profile.up or not profile.down or not parameters.has(objects.PROFILE_ACCELERATION):
        return None
    return RampedWay(profile.velocity, units.per_velocity, profile.up, profile.down, parameters.pull_window)


def led_way(parameters: AxisParameters) -> RampedWay | None:
    """Return the watch over velocities that are made here, each given with ``aim``; None where the ratio of units is not known."""
    units = parameters.units
    if not units.ratio_known:
        return None
    at_once = math.inf
    return RampedWay(0.0, units.per_velocity, at_once, at_once, parameters.pull_window)
