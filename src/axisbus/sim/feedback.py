"""Measured and reported values of a motor: with noise, and delayed as by a filter or a slow encoder."""

from __future__ import annotations

import random
from collections import deque

from axisbus.sim.axis import Axis
from axisbus.sim.control_bits import as_int32
from axisbus.sim.fault_injection import DriveFaults

Values = tuple[float, float, float]


class Feedback:
    """Position, velocity and torque of one axis as its drive reports them; holds delayed values."""

    def __init__(self, axis: Axis, dials: DriveFaults, seed: int) -> None:
        """``seed`` is for the noise of the encoder."""
        self._axis = axis
        self._dials = dials
        self._noise = axis.params.noise
        self._random = random.Random(seed)
        self._frozen: Values | None = None
        self._delayed: deque[tuple[float, Values]] = deque()

    def measured(self, now: float) -> Values:
        """Return position (of the motor), velocity and torque as reported at ``now``."""
        motor = self._axis.motor
        if self._dials.encoder_frozen:
            return self._frozen if self._frozen is not None else self._freeze(motor.position)
        self._frozen = None
        values = motor.position, motor.velocity, motor.torque
        if self._dials.feedback_delay > 0.0:
            values = self._late(now, values)
        if self._noise:
            return values[0] + self._random.uniform(-self._noise, self._noise), values[1], values[2]
        return values

    def _freeze(self, position: float) -> Values:
        self._frozen = position, 0.0, 0.0
        return self._frozen

    def demand(self, position: int, shown: int) -> int:
        """Return 6062h of an energised drive that reports ``position``; ``shown`` is the present 6062h."""
        axis, dials = self._axis, self._dials
        if dials.demand_frozen:
            return shown
        if dials.demand_is_actual:
            return position
        if dials.demand_is_target:
            return as_int32(axis.target_position)
        demand = axis.position + axis.drift if dials.creep_shown else axis.position
        return as_int32(round(axis.to_user(demand)))

    def _late(self, now: float, values: Values) -> Values:
        """Store the present values; return those of ``feedback_delay`` ago, or the oldest ones."""
        delayed = self._delayed
        delayed.append((now, values))
        due = now - self._dials.feedback_delay + 1e-9
        while len(delayed) > 1 and delayed[1][0] <= due:
            delayed.popleft()
        return delayed[0][1]
