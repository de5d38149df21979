"""A straight move from the present speed of an axis: accelerate, cruise, brake to rest, possibly after a reversal."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from axisbus.motion.moves.profile import braking_distance


@dataclass(frozen=True, slots=True)
class Start:
    """The start position of a move (unit) and the velocity of the axis there (unit/s, signed)."""

    position: float
    velocity: float


@dataclass(frozen=True, slots=True)
class ProfileFromSpeed:
    """A move from ``start`` to rest at ``end``, with at most ``velocity`` (unit/s), ``up`` and ``down`` (unit/s²), all above 0.

    An axis that is faster than ``velocity`` brakes to it. If the distance is too short to brake, or lies in the other direction,
    the axis first comes to rest and then moves back.
    """

    start: Start
    end: float
    velocity: float
    up: float
    down: float
    # Of each segment: its duration in seconds, its start position, its start speed, and its acceleration.
    pieces: tuple[tuple[float, float, float, float], ...] = field(init=False, default=())

    def __post_init__(self) -> None:
        """Plan the segments."""
        object.__setattr__(self, "pieces", tuple(self._plan()))

    @property
    def duration(self) -> float:
        """Seconds until rest."""
        return sum(piece[0] for piece in self.pieces)

    @property
    def span(self) -> tuple[float, float]:
        """The lowest and the highest position."""
        turns = [piece[1] for piece in self.pieces]
        return min(*turns, self.end, self.start.position), max(*turns, self.end, self.start.position)

    @property
    def top_acceleration(self) -> float:
        """The highest acceleration in unit/s²."""
        return max(self.up, self.down)

    def position(self, t: float) -> float:
        """Return the position at ``t`` seconds; before the start and after the end, the end positions."""
        if t <= 0:
            return self.start.position
        for time, position, speed, rate in self.pieces:
            if t < time:
                return position + speed * t + 0.5 * rate * t * t
            t -= time
        return self.end

    def speed(self, t: float) -> float:
        """Return the speed at ``t`` seconds (unit/s, signed); before the start, the start speed, after the end, 0."""
        if t <= 0:
            return self.start.velocity
        for time, _, speed, rate in self.pieces:
            if t < time:
                return speed + rate * t
            t -= time
        return 0.0

    def _plan(self) -> list[tuple[float, float, float, float]]:
        """Return the segments: duration, start position, start speed, and acceleration."""
        position, speed = self.start.position, self.start.velocity
        rest = position + math.copysign(braking_distance(speed, self.down), speed)
        direction = math.copysign(1.0, self.end - rest) if self.end != rest else math.copysign(1.0, speed)
        pieces = []
        if speed * direction < 0:  # it moves in the other direction, or too fast to stop at the end
            pieces.append((abs(speed) / self.down, position, speed, -math.copysign(self.down, speed)))
            position, speed = rest, 0.0
        for time, rate in self._forwards(abs(self.end - position), abs(speed)):
            if time > 0:
                pieces.append((time, position, speed, direction * rate))
                position += speed * time + 0.5 * direction * rate * time * time
                speed += direction * rate * time
        return pieces or [(0.0, position, 0.0, 0.0)]

    def _forwards(self, distance: float, speed: float) -> list[tuple[float, float]]:
        """Return duration and acceleration of the segments over ``distance``, which is long enough to brake from ``speed``."""
        if speed > self.velocity:
            top, first = self.velocity, -self.down
        else:
            gain = 2.0 * self.up * self.down * distance + self.down * speed * speed
            top, first = min(self.velocity, math.sqrt(gain / (self.up + self.down))), self.up
            top = max(top, speed)
        ramp_time = (top - speed) / first
        covered = 0.5 * (speed + top) * ramp_time
        left = max(0.0, distance - covered - braking_distance(top, self.down))
        return [(ramp_time, first), (left / top if top else 0.0, 0.0), (top / self.down, -self.down)]
