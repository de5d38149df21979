"""Profiles with constant accelerations: from the present velocity to a position, to another velocity, or to rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from axisbus.motion.moves.profile_from_speed import ProfileFromSpeed, Start


class Piece(NamedTuple):
    """A time in seconds with a constant acceleration (per s², signed); ``end`` is the exact velocity (per s) at its end."""

    seconds: float
    acceleration: float
    end: float


class RampLimits(NamedTuple):
    """Highest speed (per s) and ramps (per s²) of a profile; all above 0."""

    speed: float
    up: float
    down: float


class RampProfile:
    """Successive pieces; holds the remaining ones. After the last one the velocity stays constant."""

    __slots__ = ("_left", "_pieces", "velocity")

    def __init__(self, velocity: float, pieces: Sequence[Piece] = ()) -> None:
        """``velocity``: the present one, in increments per s."""
        self.velocity = velocity
        self._pieces = list(pieces)
        self._left = self._pieces[0].seconds if self._pieces else math.inf
        self.advance(0.0)  # skips pieces without duration

    @property
    def over(self) -> bool:
        """Whether the last piece has ended."""
        return not self._pieces

    def advance(self, dt: float) -> float:
        """Advance ``dt`` seconds; return the distance in increments."""
        gone = 0.0
        while self._pieces and dt >= self._left:
            piece = self._pieces.pop(0)
            gone += _distance(self.velocity, piece.acceleration, self._left)
            dt -= self._left
            self.velocity = piece.end
            self._left = self._pieces[0].seconds if self._pieces else math.inf
        acceleration = self._pieces[0].acceleration if self._pieces else 0.0
        gone += _distance(self.velocity, acceleration, dt)
        self.velocity += acceleration * dt
        self._left -= dt
        return gone


def to_rest(velocity: float, down: float) -> RampProfile:
    """Return the profile to rest with a deceleration ``down`` above 0."""
    return RampProfile(velocity, [_change(velocity, 0.0, down)])


def to_velocity(velocity: float, target: float, ramps: RampLimits) -> RampProfile:
    """Return the profile to a velocity: it slows down with ``down``, also before a reversal, and speeds up with ``up``."""
    between = target if velocity * target > 0.0 else 0.0  # a reversal comes to rest first
    slower = between if abs(between) < abs(velocity) else velocity
    return RampProfile(velocity, [_change(velocity, slower, ramps.down), _change(slower, target, ramps.up)])


def to_distance(velocity: float, distance: float, ramps: RampLimits) -> RampProfile:
    """Return the profile that ends at rest after ``distance``: directly if braking suffices, otherwise with a reversal."""
    planned = ProfileFromSpeed(Start(0.0, velocity), distance, *ramps).pieces
    ends = [*(speed for _, _, speed, _ in planned[1:]), 0.0]
    return RampProfile(
        velocity, [Piece(time, rate, end) for (time, _, _, rate), end in zip(planned, ends, strict=True)]
    )


def _change(velocity: float, end: float, rate: float) -> Piece:
    return Piece(abs(end - velocity) / rate, math.copysign(rate, end - velocity), end)


def _distance(velocity: float, acceleration: float, seconds: float) -> float:
    return seconds * (velocity + 0.5 * acceleration * seconds)
