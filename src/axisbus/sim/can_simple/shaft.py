"""The rotor as the module's firmware counts it: turns, turns/s and N·m on the rotor's side, on the motor model of all stand-ins."""

from __future__ import annotations

import math

from axisbus.sim.motor import Motor

RATED_TORQUE = 5.0 / 8.0  # N·m at the rotor (manual 1.3: 5 N·m at the output, 8:1)
_SPARE = 0.8  # of the torque that may accelerate: the rest is for what is not foreseen


class Shaft:
    """Holds the motor, and from where its turns are counted."""

    __slots__ = ("_frozen", "_linear", "motor", "origin")

    def __init__(self, motor: Motor) -> None:
        self.motor = motor
        self.origin = 0.0  # turns of the motor where the estimate is 0
        self._frozen: float | None = None
        self._linear = 0  # counts by which Set_Linear_Count has shifted Shadow_Count

    @property
    def counts(self) -> int:
        """Counts in a turn."""
        return self.motor.params.increments_per_turn

    @property
    def turns(self) -> float:
        """Where the motor is."""
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
        """The motor's own velocity in turns/s, whatever its encoder says."""
        return self.motor.velocity / self.counts

    @property
    def torque(self) -> float:
        """N·m at the rotor."""
        return self.motor.torque / 1000.0 * RATED_TORQUE

    @property
    def count_in_turn(self) -> int:
        """``encoder.count_in_cpr``: the absolute encoder's own count."""
        turns = self.turns if self._frozen is None else self._frozen
        return math.floor(turns * self.counts) % self.counts

    @property
    def shadow_count(self) -> int:
        """``encoder.shadow_count``: counts over turns."""
        return round(self.estimate * self.counts) + self._linear

    def freeze(self, frozen: bool) -> None:
        """Let the encoder stand still, or not."""
        if not frozen:
            self._frozen = None
        elif self._frozen is None:
            self._frozen = self.turns

    def restart(self, zero: float, shadow_offset: int) -> None:
        """Power-up: the turns are forgotten, only the place within one is known; ``zero`` is the user's within it, in turns."""
        self.origin = math.floor(self.turns) + zero
        self._linear = shadow_offset

    def set_linear_count(self, count: int) -> None:
        """Let the position be ``count`` from here on."""
        self.origin += self.estimate - count / self.counts
        self._linear = 0

    def seize(self) -> float:
        """Begin to lead the motor from where it is; return the demand that fits, in turns as the estimate counts."""
        return self.motor.seize() / self.counts - self.origin

    def rewind(self, velocity: float) -> float:
        """Forget what a held motor has missed; return the demand that fits a velocity in turns/s."""
        return self.motor.rewind(velocity * self.counts) / self.counts - self.origin

    def lead(self, demand: float, dt: float, limit: float) -> None:
        """Let the motor follow a demand (turns) with at most ``limit`` N·m, for ``dt`` s."""
        self.motor.track((demand + self.origin) * self.counts, dt, self._permille(limit))

    def push(self, torque: float, dt: float) -> None:
        """Let ``torque`` N·m act."""
        self.motor.push(self._permille(torque), dt)

    def reach(self, limit: float) -> float:
        """Return the acceleration (turns/s²) that ``limit`` N·m surely gives."""
        params = self.motor.params
        permille = self._permille(limit)
        spare = max(0.1 * permille, permille - abs(params.load) - params.friction)
        return _SPARE * spare / 1000.0 * params.rated_acceleration / self.counts

    def _permille(self, torque: float) -> float:
        most = self.motor.params.max_torque
        return max(-most, min(most, torque / RATED_TORQUE * 1000.0))
