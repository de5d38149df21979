"""How fast a profile move runs, in raw increments for the drive and, where known, in increments per second for deadlines."""

from __future__ import annotations

import math
from typing import NamedTuple


class Profile(NamedTuple):
    """Velocity and ramps of one command.

    ``velocity``, ``acceleration`` and ``deceleration`` are the drive's own increments (6081h, 6083h, 6084h). ``speed`` and ``ramp``
    are the same in position increments per s and per s² (the weaker one), or None where the ratio is not known. ``timeout`` in
    seconds is the caller's own deadline. ``up`` and ``down`` are 6083h and 6084h in position increments per s².
    """

    velocity: int
    acceleration: int
    deceleration: int
    speed: float | None
    ramp: float | None
    timeout: float | None = None
    up: float | None = None
    down: float | None = None


def duration(distance: float, speed: float, ramp: float) -> float:
    """Return the seconds of a trapezoid (or triangle) from rest to rest; ``speed`` and ``ramp`` > 0."""
    distance = abs(distance)
    if distance * ramp >= speed * speed:
        return distance / speed + speed / ramp
    return 2.0 * math.sqrt(distance / ramp)


def braking_distance(speed: float, ramp: float) -> float:
    """Return the way from ``speed`` to rest."""
    return speed * speed / (2.0 * ramp)
