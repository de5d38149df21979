"""Profile velocity (CiA 402-2 13) and cyclic synchronous velocity (15): a velocity demand by a ramp, or by SYNC.

If 6086h is 2 or 3 and the profile jerk (60A4h:01) is above 0, the ramps have limited jerk (``SoftVelocity``); a halt has not.
"""

from __future__ import annotations

from axisbus.sim.axis import Axis
from axisbus.sim.control_bits import CSV, PV, SW_BIT_10, SW_BIT_12
from axisbus.sim.modes.base import Mode
from axisbus.sim.power import Effort
from axisbus.sim.ramp import SoftVelocity

_SAME = 1e-6  # increments/s


class ProfileVelocity(Mode):
    """Ramps to 60FFh with 6083h and 6084h; holds the timers of its two windows, and the active ramp."""

    code = PV

    def __init__(self) -> None:
        self._inside = 0.0
        self._fast = 0.0
        self._reached = False
        self._zero = True
        self._soft: SoftVelocity | None = None  # valid while only the ramp moves the axis
        self._previous = 0  # the last 60FFh other than 0
        self._written: int | None = None  # unchanged 60FFh while the former velocity applies

    def enter(self, _axis: Axis) -> None:
        self._inside = self._fast = 0.0
        self._soft = None
        self._written = None

    def resume_last_motion(self, axis: Axis) -> None:
        self._written = axis.target_velocity

    def step(self, axis: Axis, dt: float) -> None:
        wanted = axis.motor_velocity(self._wanted(axis))
        target = axis.velocity_within(wanted, axis.profile_speed_limit)
        if axis.forbidden and axis.velocity * axis.forbidden > 0.0:
            self._soft = None
            axis.brake(Effort.QUICK, dt)
        else:
            self._go_to(target, axis, dt)
            axis.forget_error()
        self._watch(axis, dt)

    def halt(self, axis: Axis, effort: Effort, dt: float) -> None:
        self._soft = None
        super().halt(axis, effort, dt)
        self._watch(axis, dt)

    def bits(self, axis: Axis) -> int:
        value = SW_BIT_12 if self._zero else 0
        if self._reached and not axis.dials.target_reached_never:
            value |= SW_BIT_10
        return value

    def _go_to(self, target: float, axis: Axis, dt: float) -> None:
        soft = self._soft
        if soft is None or abs(soft.velocity - axis.velocity) > _SAME:
            soft = self._soft = SoftVelocity(axis.velocity)
        velocity, distance = soft.step(target, axis.acceleration, axis.deceleration, axis.profile_jerk, dt)
        axis.follow(axis.position + distance, velocity, dt)

    def _wanted(self, axis: Axis) -> int:
        target = axis.target_velocity
        if self._written is not None and target == self._written:
            return self._previous
        self._written = None
        self._previous = target or self._previous
        return target

    def _watch(self, axis: Axis, dt: float) -> None:
        """Update bit 10 by 606Dh and 606Eh, bit 12 by 606Fh and 6070h."""
        settings = axis.settings
        actual = axis.user_velocity(axis.motor.velocity)
        if abs(axis.target_velocity - actual) <= settings.velocity_window:
            self._inside += dt
            self._reached = self._inside * 1000.0 >= settings.velocity_window_time
        else:
            self._inside, self._reached = 0.0, False
        if abs(actual) <= settings.velocity_threshold:
            self._fast, self._zero = 0.0, True
        else:
            self._fast += dt
            if self._fast * 1000.0 > settings.velocity_threshold_time:
                self._zero = False


class CyclicVelocity(Mode):
    """Changes evenly to the velocity of each SYNC within the interpolation time, and holds it if no other arrives."""

    code = CSV
    cyclic = True

    def __init__(self) -> None:
        self._goal = 0.0
        self._time_left = 0.0
        self._push = 0.0  # 60B2h

    def enter(self, axis: Axis) -> None:
        self._goal, self._time_left = axis.velocity, 0.0
        self._push = 0.0

    def resume(self, axis: Axis) -> None:
        self.enter(axis)

    def sync(self, axis: Axis, period: float) -> None:
        wanted = axis.motor_velocity(axis.target_velocity + axis.settings.velocity_offset)
        self._goal = axis.velocity_within(wanted, axis.speed_limit)
        self._time_left = period
        self._push = float(axis.settings.torque_offset)

    def step(self, axis: Axis, dt: float) -> None:
        goal = axis.velocity_within(self._goal, axis.speed_limit) if axis.forbidden else self._goal
        left = self._time_left
        before = axis.velocity
        if left > dt:
            after = before + (goal - before) * dt / left
            distance = 0.5 * (before + after) * dt
        else:
            after = goal
            distance = 0.5 * (before + after) * left + after * (dt - left)
        self._time_left = max(0.0, left - dt)
        axis.follow(axis.position + distance, after, dt, push=self._push)
        axis.forget_error()

    def bits(self, _axis: Axis) -> int:
        return SW_BIT_12

    def halted_bits(self, axis: Axis) -> int:
        return SW_BIT_10 if axis.at_standstill else 0
