"""Cyclic synchronous position mode (CiA 402-2 14): targets latched at SYNC, a straight line between two of them."""

from __future__ import annotations

from axisbus.sim.axis import Axis
from axisbus.sim.control_bits import CSP, CW_BIT_4, IP, SW_BIT_10, SW_BIT_12, SW_BIT_13
from axisbus.sim.modes.base import Mode
from axisbus.sim.power import Effort


class CyclicPosition(Mode):
    """Reaches each target when the next is due (60C2h), and holds the last one: nothing is extrapolated."""

    code = CSP
    cyclic = True
    supervised = True

    def __init__(self) -> None:
        self._goal = 0.0
        self._time_left = 0.0
        self._feed_forward = self._push = 0.0  # 60B1h, 60B2h

    def enter(self, axis: Axis) -> None:
        self._goal, self._time_left = axis.position, 0.0
        self._feed_forward = self._push = 0.0

    def resume(self, axis: Axis) -> None:
        self.enter(axis)

    def target(self, axis: Axis) -> int:
        """Return the last target written by the master."""
        return axis.target_position

    def sync(self, axis: Axis, period: float) -> None:
        target = axis.to_motor(self.target(axis) + axis.settings.position_offset)
        self._goal = axis.position_within(target)
        self._time_left = period
        self._feed_forward = axis.motor_velocity(axis.settings.velocity_offset)
        self._push = float(axis.settings.torque_offset)

    def step(self, axis: Axis, dt: float) -> None:
        here, left = axis.position, self._time_left
        distance = self._goal - here
        if left > dt * 1.000001:
            distance *= dt / left
            self._time_left = left - dt
            time = dt
        else:
            self._time_left = 0.0
            time = left or dt
        axis.speed_limited = abs(distance) > axis.speed_limit * dt
        if axis.speed_limited:
            distance = axis.speed_limit * dt if distance > 0.0 else -axis.speed_limit * dt
            time = dt
        if axis.forbidden and distance * axis.forbidden > 0.0:
            axis.clamped = True
            distance = 0.0
        axis.follow(here + distance, distance / time, dt, self._feed_forward, self._push)

    def halt(self, axis: Axis, effort: Effort, dt: float) -> None:
        if axis.motor.feed_forward:
            axis.restart_tracking()
        super().halt(axis, effort, dt)

    def bits(self, axis: Axis) -> int:
        return SW_BIT_12 | (SW_BIT_13 if axis.following_exceeded else 0)

    def halted_bits(self, axis: Axis) -> int:
        value = SW_BIT_13 if axis.following_exceeded else 0
        return value | SW_BIT_10 if axis.at_standstill else value


# ----------------------------------------------------------------------------------------------------------------------
# Interpolated position mode (CiA 402-2 11), linear: set-points of 60C1h:01 latched at SYNC, straight lines between them.


_SLOW = Effort.SLOW


class InterpolatedPosition(CyclicPosition):
    """Interpolates while bit 4 of the controlword is set (*interpolation active*, bit 12); otherwise brakes and holds."""

    code = IP

    def __init__(self) -> None:
        super().__init__()
        self._active = False
        self._requested_for: float | None = None  # seconds since bit 4 was set

    def enter(self, axis: Axis) -> None:
        super().enter(axis)
        self._active = False

    def command(self, axis: Axis, _old: int, new: int) -> None:
        if not new & CW_BIT_4:
            if axis.motor.feed_forward:
                axis.restart_tracking()
            self._requested_for, self._active = None, False
        elif self._requested_for is None:
            self._requested_for = 0.0
            self._begin(axis)

    def _begin(self, axis: Axis) -> None:
        if self._requested_for is not None and self._requested_for >= axis.dials.interpolation_delay:
            super().enter(axis)
            self._active = True

    def abandon(self, axis: Axis) -> None:
        super().abandon(axis)
        self._active, self._requested_for = False, None

    def target(self, axis: Axis) -> int:
        return axis.settings.interpolation_target

    def sync(self, axis: Axis, period: float) -> None:
        if self._active:
            super().sync(axis, period)

    def step(self, axis: Axis, dt: float) -> None:
        if self._active:
            super().step(axis, dt)
            return
        axis.brake(_SLOW, dt)
        if self._requested_for is not None:
            self._requested_for += dt
            self._begin(axis)

    def bits(self, axis: Axis) -> int:
        reached = SW_BIT_10 if axis.at_standstill else 0
        return reached | (SW_BIT_12 if self._active else 0)

    def halted_bits(self, axis: Axis) -> int:
        return self.bits(axis)
