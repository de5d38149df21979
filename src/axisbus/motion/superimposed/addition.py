"""A distance superimposed on an axis's path (MC_MoveSuperimposed), such that the sum stays within the limits of the axis.

Theory of operation
-------------------
The path continues unchanged, and in each cycle its next position is known before the superimposed motion advances. The rate of the
superimposed motion is chosen such that the sum exceeds neither the velocity nor the acceleration of the axis. So the superimposed
motion is slowed down, and waits if the path needs the whole limit. If the path alone is within the limits, there is always such
a rate: the present one, or one closer to 0. The superimposed motion never moves backwards, nor faster than requested, to compensate
for a path that exceeds the limits; the usual checks detect such a path.

To be able to brake when it must, the superimposed motion is limited in its ramps: they use the part of ``max_acceleration`` that a
path with a known highest acceleration leaves. If it overshoots its end, it returns automatically.
"""

from __future__ import annotations

import math

from axisbus.errors import AxisbusError
from axisbus.motion.commands import MoveSuperimposed
from axisbus.motion.moves.profile import braking_distance
from axisbus.motion.superimposed.offset_profile import Shift


class Addition:
    """Holds the completed part of the distance, and the error that stops it; in units of the axis."""

    __slots__ = ("_is_halted", "_shift", "error", "factor", "is_admitted")

    def __init__(self, command: MoveSuperimposed, period: float) -> None:
        """``period``: scan period in seconds."""
        self._shift = Shift(period)
        self._shift.aim(command.distance, command.velocity, command.acceleration, command.deceleration)
        self._is_halted = False
        self.is_admitted = False  # set by the path's activity in the first cycle in which both move
        self.factor = 1.0  # the override
        self.error: AxisbusError | None = None

    @property
    def value(self) -> float:
        """The completed part of the distance."""
        return self._shift.value

    @property
    def distance(self) -> float:
        """The whole distance."""
        return self._shift.end

    @property
    def rate(self) -> float:
        """The present velocity in unit/s."""
        return self._shift.rate

    @property
    def over(self) -> bool:
        """Whether it has ended."""
        return self._shift.rate == 0.0 if self._is_halted else self._shift.at_rest

    @property
    def hardest(self) -> float:
        """The higher one of its accelerations, in unit/s²."""
        return self._shift.hardest

    def go_on_from(self, before: Addition) -> None:
        """Take over the rate of another superimposed motion, which this one replaces."""
        self._shift.rate = before.rate

    def soften(self, most: float) -> None:
        """Limit its ramps to ``most`` (unit/s²)."""
        self._shift.soften(most)

    def halt(self, error: AxisbusError | None = None, deceleration: float | None = None) -> None:
        """Brake to rest, by ``deceleration`` (unit/s²) if given; ``error``: the reason, unless the user has requested the halt."""
        self._is_halted = True
        self.error = self.error or error
        if deceleration is not None:
            self._shift.brake_by(deceleration)

    def rest(self, velocity: float, deceleration: float, cycles: float) -> float:
        """Return the axis's distance to rest if this motion brakes now, and then its path, by ``deceleration`` from ``velocity``.

        ``cycles``: seconds before braking takes effect.
        """
        time = self._shift.braking_time + cycles
        way = math.copysign(braking_distance(velocity, deceleration), velocity)
        return self._shift.braking + (self._shift.rate + velocity) * cycles + velocity * (time - cycles) + way

    def step(self, velocity: float, low: float, high: float) -> float:
        """Advance by one cycle and return the rate; the path moves at ``velocity``, the sum must be from ``low`` to ``high``."""
        shift = self._shift
        wanted, rate = shift.braked() if self._is_halted else shift.wanted(self.factor), shift.rate
        held = min(max(wanted, low - velocity), high - velocity)
        shift.go(min(max(held, min(0.0, rate, wanted)), max(0.0, rate, wanted)))
        return shift.rate
