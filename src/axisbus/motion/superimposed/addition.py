"""A distance laid over the path that leads an axis (MC_MoveSuperimposed), such that the sum keeps the limits of the axis.

Theory of operation
-------------------
The path goes where it would have gone, and in each cycle its next place is known before the addition goes on. So the rate of that
is chosen such that the sum is no faster and no harder than the axis may be: it is held back, and where the path takes up all that
there is, it waits. A path that keeps the limits by itself always leaves such a rate: the one that the addition has, or one nearer
to 0. It is never led the other way, nor faster than it wants to be, to make up for a path that is itself too much: that is found
out by the same look as ever.

So that it is not held back while it should brake, its ramps are what a path that tells its highest acceleration leaves of
``max_acceleration``. Beyond the end it would come back by itself.
"""

from __future__ import annotations

import math

from axisbus.errors import AxisbusError
from axisbus.motion.commands import MoveSuperimposed
from axisbus.motion.moves.profile import braking_distance
from axisbus.motion.superimposed.offset_profile import Shift


class Addition:
    """Holds how much of the distance is laid over the path, and why it goes no farther; in units of the axis."""

    __slots__ = ("_is_halted", "_shift", "error", "factor", "is_admitted")

    def __init__(self, command: MoveSuperimposed, period: float) -> None:
        """``period``: of the scan, in seconds."""
        self._shift = Shift(period)
        self._shift.aim(command.distance, command.velocity, command.acceleration, command.deceleration)
        self._is_halted = False
        self.is_admitted = False  # by what leads the axis, in the first cycle in which both go on
        self.factor = 1.0  # the override
        self.error: AxisbusError | None = None

    @property
    def value(self) -> float:
        """How much of it is gone."""
        return self._shift.value

    @property
    def distance(self) -> float:
        """How much of it there is."""
        return self._shift.end

    @property
    def rate(self) -> float:
        """How fast it goes on, in unit/s."""
        return self._shift.rate

    @property
    def over(self) -> bool:
        """Whether it goes no farther."""
        return self._shift.rate == 0.0 if self._is_halted else self._shift.at_rest

    @property
    def hardest(self) -> float:
        """Its harder ramp, in unit/s²."""
        return self._shift.hardest

    def go_on_from(self, before: Addition) -> None:
        """Take up the rate of another one, which this one supersedes."""
        self._shift.rate = before.rate

    def soften(self, most: float) -> None:
        """Let its ramps be no harder than ``most`` (unit/s²)."""
        self._shift.soften(most)

    def halt(self, error: AxisbusError | None = None, deceleration: float | None = None) -> None:
        """Come to rest, by ``deceleration`` (unit/s²) where that is given; ``error`` says why, where nobody asked for it."""
        self._is_halted = True
        self.error = self.error or error
        if deceleration is not None:
            self._shift.brake_by(deceleration)

    def rest(self, velocity: float, deceleration: float, cycles: float) -> float:
        """Return how far the axis would still go if this braked now, and then the path, by ``deceleration``, from its ``velocity``.

        ``cycles``: seconds that are lost before that.
        """
        time = self._shift.braking_time + cycles
        way = math.copysign(braking_distance(velocity, deceleration), velocity)
        return self._shift.braking + (self._shift.rate + velocity) * cycles + velocity * (time - cycles) + way

    def step(self, velocity: float, low: float, high: float) -> float:
        """Go on by one cycle: the path has ``velocity``, the sum is to have one from ``low`` to ``high``; return the rate."""
        shift = self._shift
        wanted, rate = shift.braked() if self._is_halted else shift.wanted(self.factor), shift.rate
        held = min(max(wanted, low - velocity), high - velocity)
        shift.go(min(max(held, min(0.0, rate, wanted)), max(0.0, rate, wanted)))
        return shift.rate
