"""Velocity and ramps of a profile move, in raw increments for the drive and, if known, in increments per second for deadlines."""

from __future__ import annotations

import math
from typing import NamedTuple

from axisbus.cia402 import objects
from axisbus.motion.parameters import AxisParameters


class MoveProfile(NamedTuple):
    """Velocity and ramps of one command.

    ``velocity``, ``acceleration`` and ``deceleration`` are the drive's own increments (6081h, 6083h, 6084h). ``speed`` and ``ramp``
    are the same in position increments per s and per s² (the weaker ramp), or None if the ratio is not known. ``timeout`` in
    seconds is the caller's own deadline. ``up`` and ``down`` are 6083h and 6084h in position increments per s². ``softness`` is the
    jerk in units per s³ (None: not limited), and ``jerk`` the same for 60A4h:01, if the drive limits it (None: the master does).
    """

    velocity: int
    acceleration: int
    deceleration: int
    speed: float | None
    ramp: float | None
    timeout: float | None = None
    up: float | None = None
    down: float | None = None
    softness: float | None = None
    jerk: int | None = None

    def soft_seconds(self, unit: float) -> float:
        """Return by how many seconds a jerk limit prolongs the move at most; ``unit``: position increments in a unit."""
        if self.softness is None or self.up is None or self.down is None:
            return 0.0
        return (self.up + self.down) / (self.softness * unit)


def on_ramps(
    profile: MoveProfile, acceleration: int | None, deceleration: int | None, parameters: AxisParameters
) -> MoveProfile:
    """Return a profile with the actual ramps of the drive, given in its own increments (0 or None: not known).

    ``up``, ``down`` and ``ramp`` change accordingly; the values to write remain as commanded. A drive without 6084h brakes as it
    accelerates (CiA 402-2).
    """
    units, braking = parameters.units, parameters.braking
    if not units.ratio_known:
        return profile
    if not parameters.has(objects.PROFILE_DECELERATION):
        deceleration = acceleration
    per = abs(units.position.factor / units.acceleration.factor)
    up = braking.capped_up(acceleration * per if acceleration else None)
    down = braking.capped_down(deceleration * per if deceleration else None)
    return profile._replace(up=up, down=down, ramp=min(up, down) if up and down else None)


def duration(distance: float, speed: float, ramp: float) -> float:
    """Return the seconds of a trapezoid (or triangle) from rest to rest; ``speed`` and ``ramp`` > 0."""
    distance = abs(distance)
    if distance * ramp >= speed * speed:
        return distance / speed + speed / ramp
    return 2.0 * math.sqrt(distance / ramp)


def braking_distance(speed: float, ramp: float) -> float:
    """Return the braking distance from ``speed`` to rest."""
    return speed * speed / (2.0 * ramp)
