"""Ways with constant accelerations: from the present velocity to a position, to another velocity, or to rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from axisbus.motion.moves.profile_from_speed import ProfileFromSpeed, Start


class Piece(NamedTuple):
    """So many seconds at a constant acceleration (per s², signed); ``end`` is the velocity (per s) at its end, exactly."""

    seconds: float
    acceleration: float
    end: float


class RampLimits(NamedTuple):
    """Highest speed (per s) and ramps (per s²) of a way; all above 0."""

    speed: float
    up: float
    down: float


class RampProfile:
    """Pieces one after the other; holds how much of them is left. Behind the last one its velocity goes on."""

    __slots__ = ("_left", "_pieces", "velocity")

    def __init__(self, velocity: float, pieces: Sequence[Piece] = ()) -> None:
        """``velocity``: the present one, in increments per s."""
        self.velocity = velocity
        self._pieces = list(pieces)
        self._left = self._pieces[0].seconds if self._pieces else math.inf
        self.advance(0.0)  # past what takes no time

    @property
    def over(self) -> bool:
        """Whether the last piece is through."""
        return not self._pieces

    def advance(self, dt: float) -> float:
        """Go on for ``dt`` seconds; return the increments that this goes."""
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
    """Return the way to rest with a deceleration ``down`` above 0."""
    return RampProfile(velocity, [_change(velocity, 0.0, down)])


def to_velocity(velocity: float, target: float, ramps: RampLimits) -> RampProfile:
    """Return the way to a velocity: slower, also through rest, with the deceleration, faster with the acceleration."""
    between = target if velocity * target > 0.0 else 0.0  # whoever turns round comes to rest first
    slower = between if abs(between) < abs(velocity) else velocity
    return RampProfile(velocity, [_change(velocity, slower, ramps.down), _change(slower, target, ramps.up)])


def to_distance(velocity: float, distance: float, ramps: RampLimits) -> RampProfile:
    """Return the way that ends at rest after ``distance``: straight on where it can be braked to, else back again."""
    planned = ProfileFromSpeed(Start(0.0, velocity), distance, *ramps).pieces
    ends = [*(speed for _, _, speed, _ in planned[1:]), 0.0]
    return RampProfile(
        velocity, [Piece(time, rate, end) for (time, _, _, rate), end in zip(planned, ends, strict=True)]
    )


def _change(velocity: float, end: float, rate: float) -> Piece:
    return Piece(abs(end - velocity) / rate, math.copysign(rate, end - velocity), end)


def _distance(velocity: float, acceleration: float, seconds: float) -> float:
    return seconds * (velocity + 0.5 * acceleration * seconds)
