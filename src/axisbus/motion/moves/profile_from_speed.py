"""A straight move from the speed that an axis has already: speeds up, goes on, brakes to rest, perhaps after turning round."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from axisbus.motion.moves.profile import braking_distance


@dataclass(frozen=True, slots=True)
class Start:
    """Where a move begins (unit) and how fast the axis is there (unit/s, signed)."""

    position: float
    velocity: float


@dataclass(frozen=True, slots=True)
class ProfileFromSpeed:
    """A move from ``start`` to rest at ``end``, with at most ``velocity`` (unit/s), ``up`` and ``down`` (unit/s²), all above 0.

    An axis that is faster than ``velocity`` is braked to it. Where the way is too short to brake, or leads the other way, it comes
    to rest first and goes back.
    """

    start: Start
    end: float
    velocity: float
    up: float
    down: float
    # Of each piece: its seconds, and where it begins, how fast, and with what acceleration.
    pieces: tuple[tuple[float, float, float, float], ...] = field(init=False, default=())

    def __post_init__(self) -> None:
        """Plan the pieces."""
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
        """Return the position at ``t`` seconds; before and after, the ends."""
        if t <= 0:
            return self.start.position
        for time, position, speed, rate in self.pieces:
            if t < time:
                return position + speed * t + 0.5 * rate * t * t
            t -= time
        return self.end

    def speed(self, t: float) -> float:
        """Return the speed at ``t`` seconds (unit/s, signed); before, that of the start, after, 0."""
        if t <= 0:
            return self.start.velocity
        for time, _, speed, rate in self.pieces:
            if t < time:
                return speed + rate * t
            t -= time
        return 0.0

    def _plan(self) -> list[tuple[float, float, float, float]]:
        """Return the pieces: seconds, and where they begin, how fast, and with what acceleration."""
        position, speed = self.start.position, self.start.velocity
        rest = position + math.copysign(braking_distance(speed, self.down), speed)
        way = math.copysign(1.0, self.end - rest) if self.end != rest else math.copysign(1.0, speed)
        pieces = []
        if speed * way < 0:  # it goes the other way, or too fast to stop at the end
            pieces.append((abs(speed) / self.down, position, speed, -math.copysign(self.down, speed)))
            position, speed = rest, 0.0
        for time, rate in self._forwards(abs(self.end - position), abs(speed)):
            if time > 0:
                pieces.append((time, position, speed, way * rate))
                position += speed * time + 0.5 * way * rate * time * time
                speed += way * rate * time
        return pieces or [(0.0, position, 0.0, 0.0)]

    def _forwards(self, distance: float, speed: float) -> list[tuple[float, float]]:
        """Return time and acceleration of each piece of a way of ``distance`` that is long enough to brake from ``speed``."""
        if speed > self.velocity:
            top, first = self.velocity, -self.down
        else:
            gain = 2.0 * self.up * self.down * distance + self.down * speed * speed
            top, first = min(self.velocity, math.sqrt(gain / (self.up + self.down))), self.up
            top = max(top, speed)
        began = (top - speed) / first
        gone = 0.5 * (speed + top) * began
        left = max(0.0, distance - gone - braking_distance(top, self.down))
        return [(began, first), (left / top if top else 0.0, 0.0), (top / self.down, -self.down)]
