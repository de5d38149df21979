"""The rotor in the firmware's units: turns, turns/s and N·m at the rotor, based on the common motor model."""

from __future__ import annotations

import math

from axisbus.sim.motor import Motor

RATED_TORQUE = 5.0 / 8.0  # N·m at the rotor (manual 1.3: 5 N·m at the output, 8:1)
_SPARE = 0.8  # share of the torque used for accelerating: the rest is a reserve


class Shaft:
    """The motor, and the zero of its turns."""

    __slots__ = ("_frozen", "_linear", "motor", "origin")

    def __init__(self, motor: Motor) -> None:
        self.motor = motor
        self.origin = 0.0  # turns of the motor where the estimate is 0
        self._frozen: float | None = None
        self._linear = 0  # counts by which Set_Linear_Count has shifted Shadow_Count

    @property
    def counts(self) -> int:
        return self.motor.params.increments_per_turn

    @property
    def turns(self) -> float:
        """True position of the motor."""
        return self.motor.position / self.counts

    @property
    def estimate(self) -> float:
        """``encoder.pos_estimate`` in turns."""
        return (self.turns if self._frozen is None else self._frozen) - self.origin

    @property
    def velocity(self) -> float:
        """``encoder.vel_estimate`` in turns/s."""
        return self.motor.velocity / self.counts if self._frozen is None else 0.0

    @property
    def speed(self) -> float:
        """True velocity of the motor in turns/s, even if its encoder is frozen."""
        return self.motor.velocity / self.counts

    @property
    def torque(self) -> float:
        """Torque in N·m at the rotor."""
        return self.motor.torque / 1000.0 * RATED_TORQUE

    @property
    def count_in_turn(self) -> int:
        """``encoder.count_in_cpr``: the absolute encoder's count within a turn."""
        turns = self.turns if self._frozen is None else self._frozen
        return math.floor(turns * self.counts) % self.counts

    @property
    def shadow_count(self) -> int:
        """``encoder.shadow_count``: counts over turns."""
        return round(self.estimate * self.counts) + self._linear

    def freeze(self, frozen: bool) -> None:
        """Freeze the encoder's reading, or release it."""
        if not frozen:
            self._frozen = None
        elif self._frozen is None:
            self._frozen = self.turns

    def restart(self, zero: float, shadow_offset: int) -> None:
        """Power up: only the position within a turn remains known; ``zero`` is the user's zero within the turn, in turns."""
        self.origin = math.floor(self.turns) + zero
        self._linear = shadow_offset

    def set_linear_count(self, count: int) -> None:
        """Define the present position as ``count``."""
        self.origin += self.estimate - count / self.counts
        self._linear = 0

    def seize(self) -> float:
        """Begin to track from the motor's position; return the matching demand, in turns as the estimate counts."""
        return self.motor.restart_tracking() / self.counts - self.origin

    def rewind(self, velocity: float) -> float:
        """Discard the accumulated error of a blocked motor; return the matching demand for a velocity in turns/s."""
        return self.motor.rewind(velocity * self.counts) / self.counts - self.origin

    def lead(self, demand: float, dt: float, limit: float) -> None:
        """Make the motor follow a demand (turns) with at most ``limit`` N·m, for ``dt`` s."""
        self.motor.track((demand + self.origin) * self.counts, dt, self._permille(limit))

    def push(self, torque: float, dt: float) -> None:
        """Apply ``torque`` N·m for ``dt`` s."""
        self.motor.push(self._permille(torque), dt)

    def reach(self, limit: float) -> float:
        """Return an acceleration (turns/s²) that is certainly possible with ``limit`` N·m."""
        params = self.motor.params
        permille = self._permille(limit)
        spare = max(0.1 * permille, permille - abs(params.load) - params.friction)
        return _SPARE * spare / 1000.0 * params.rated_acceleration / self.counts

    def _permille(self, torque: float) -> float:
        most = self.motor.params.max_torque
        return max(-most, min(most, torque / RATED_TORQUE * 1000.0))
