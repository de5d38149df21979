"""A motor on a spring: a controller of finite stiffness, or a soft shaft, with which the load droops and rings.

Theory of operation
-------------------
The torque is ``stiffness`` times the distance to the demand, plus a damper on the difference of the velocities. If the demand moves
evenly within the step, the deviation from the equilibrium (``load / stiffness`` below the demand) is a damped oscillation, computed
by a closed formula: the step width does not matter. If that would need more torque than allowed, or if the motor is held, the same
equation is integrated in small steps. When it is pushed by a torque, or not energised, it moves like every motor.
"""

from __future__ import annotations

import math

from axisbus.sim.motor import Motor, MotorParams

_LONGEST_STEP = 0.001  # s
_STEPS_PER_RADIAN = 20.0
_AT_REST = 1e-3  # increments: a deviation below it counts as 0
_MOST_DAMPING = 0.99  # share of the critical damping


def make_motor(params: MotorParams) -> Motor:
    """Return the motor for these parameters."""
    return CompliantMotor(params) if params.stiffness > 0.0 else Motor(params)


class CompliantMotor(Motor):
    """A motor on a spring, with the mechanical state of ``Motor``."""

    __slots__ = (
        "_angular_frequency",
        "_cosine",
        "_damper",
        "_decay_rate",
        "_droop",
        "_push",
        "_sine",
        "_spring",
        "_step_dt",
    )

    def __init__(self, params: MotorParams) -> None:
        super().__init__(params)
        self._spring = params.stiffness  # ‰ per increment
        natural = math.sqrt(self._gain * self._spring)  # rad/s
        damping = min(params.damping, _MOST_DAMPING)
        self._damper = 2.0 * damping * natural / self._gain  # ‰ per increment/s
        self._decay_rate = damping * natural  # 1/s
        self._angular_frequency = natural * math.sqrt(1.0 - damping * damping)  # rad/s
        self._push = 0.0
        self._droop = params.load / self._spring
        self._step_dt = self._cosine = self._sine = 0.0

    def restart_tracking(self) -> float:
        """Begin with the present torque; a load then lets the motor sag until the spring holds it."""
        self._push = 0.0
        self._demand = self.position + self.torque / self._spring
        return self._demand

    def rewind(self, velocity: float) -> float:  # noqa: ARG002 - a spring does not trail at constant velocity
        """Limit the deviation to the value that the torque explains; return the matching demand."""
        return self.restart_tracking()

    def track(
        self,
        demand: float,
        dt: float,
        limit: float,
        feed_forward: float = 0.0,  # noqa: ARG002
        push: float = 0.0,
    ) -> None:
        """Follow a demand that moves evenly to ``demand`` within ``dt`` (> 0 s), with at most ``limit`` ‰ of torque.

        ``push`` (‰) is added to the torque of the spring. Its damper uses the demand's velocity already: ``feed_forward`` has no
        effect.
        """
        before, self._demand = self._demand, demand
        self._push = push
        self._droop = (self.load - push) / self._spring
        rate = (demand - before) / dt
        position, velocity = self._free_oscillation(before, rate, dt)
        torque = push + self._spring * (demand - position) + self._damper * (rate - velocity)
        if (
            -limit <= torque <= limit
            and abs(push + self._spring * (before - self.position)) <= limit
            and not self._is_held
            and self._low <= position <= self._high
        ):
            self.position, self.velocity, self.torque, self.saturated = position, velocity, torque, False
            return
        self._advance_in_small_steps(before, rate, dt, limit)

    @property
    def _is_held(self) -> bool:
        return self.blocked or self.brake_closed or (self.sticks > 0.0 and self.velocity == 0.0)

    def _free_oscillation(self, before: float, rate: float, dt: float) -> tuple[float, float]:
        """Return position and velocity after ``dt`` of free oscillation about the equilibrium."""
        if dt != self._step_dt:
            angle, fade = self._angular_frequency * dt, math.exp(-self._decay_rate * dt)
            self._step_dt, self._cosine, self._sine = dt, fade * math.cos(angle), fade * math.sin(angle)
        off, drift = before - self._droop - self.position, rate - self.velocity
        pull = (drift + self._decay_rate * off) / self._angular_frequency
        after = off * self._cosine + pull * self._sine
        slip = (pull * self._angular_frequency - self._decay_rate * off) * self._cosine
        slip -= (off * self._angular_frequency + self._decay_rate * pull) * self._sine
        if -_AT_REST < after < _AT_REST and abs(slip) < _AT_REST * self._angular_frequency:
            after = slip = 0.0
        return before + rate * dt - self._droop - after, rate - slip

    def _advance_in_small_steps(self, before: float, rate: float, dt: float, limit: float) -> None:
        """Advance in small steps, with limited torque, against friction, brake or a block."""
        self.saturated = False
        steps = math.ceil(dt / min(_LONGEST_STEP, 1.0 / (_STEPS_PER_RADIAN * self._angular_frequency)) - 1e-9)
        h = dt / max(1, steps)
        for number in range(1, max(1, steps) + 1):
            wanted = self._push + self._spring * (before + rate * h * number - self.position)
            wanted += self._damper * (rate - self.velocity)
            self.torque = max(-limit, min(limit, wanted))
            self.saturated = self.saturated or self.torque != wanted
            self._advance_small_step(self.torque - self.load, h)
        self._stop_at_ends()

    def _advance_small_step(self, net: float, h: float) -> None:
        """Advance one small step with the torque in excess of the load."""
        holding = self._brake_torque()
        if self.blocked or (self.velocity == 0.0 and abs(net) <= holding + self.sticks):
            self.velocity = 0.0
            return
        direction = math.copysign(1.0, self.velocity or net)
        after = self.velocity + (net - direction * holding) * self._gain * h
        if self.velocity * after < 0.0 and abs(net) <= holding + self.sticks:
            after = 0.0
        self.velocity = after
        self.position += after * h
