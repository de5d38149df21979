"""Profile position mode (CiA 402-2 10): set-points by handshake, trapezoidal moves.

Theory of operation
-------------------
A rising edge of bit 4 presents a set-point, with the present values of its target and limits. The drive *accepts* it by raising bit
12. The set-point becomes active at once if bit 5 is set or no other is active; otherwise it waits in a buffer for one set-point.
    Bit 12 falls when bit 4 has fallen and the buffer is free. With bit 9, the active set-point is passed at profile velocity if
    another one waits. With a profile velocity or acceleration of 0, a move is accepted but does not start until both are set. If
    6086h is 2 or 3 and the profile jerk (60A4h:01) is above 0, the jerk of a move is limited (``SoftProfile``); that of a halt is
    not.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from axisbus.sim.axis import Axis
from axisbus.sim.control_bits import (
    CW_BIT_4,
    CW_CHANGE_ON_SET_POINT,
    CW_HALT,
    CW_IMMEDIATELY,
    CW_RELATIVE,
    PP,
    SW_BIT_10,
    SW_BIT_12,
    SW_BIT_13,
)
from axisbus.sim.modes.base import Mode
from axisbus.sim.power import Effort
from axisbus.sim.ramp import Profile, SoftProfile, plan_move

_NO_WINDOW = 0xFFFF_FFFF
_SLOW = Effort.SLOW  # used in every step at standstill


class SetPoint(NamedTuple):
    """A presented set-point, in increments of the motor and increments/s (²); limits of 0 are read again until they are set."""

    target: float
    speed: float
    acceleration: float
    deceleration: float
    end_speed: float
    immediately: bool
    passing: bool
    clamped: bool


class ProfilePosition(Mode):
    """The handshake, the active set-point and the waiting one."""

    code = PP
    supervised = True

    def __init__(self) -> None:
        self._presented: SetPoint | None = None
        self._delay = 0.0
        self._active: SetPoint | None = None
        self._previous: SetPoint | None = None  # the last one that became active
        self._buffer: SetPoint | None = None
        self._profile: Profile | SoftProfile | None = None
        self._goal: float | None = None
        self._bit_4 = False
        self._acknowledge = False
        self._acknowledged_for = 0.0
        self._window_timer = 0.0
        self._reached = False
        self._stale_timer = 0.0

    def enter(self, axis: Axis) -> None:
        self.abandon(axis)

    def abandon(self, _axis: Axis) -> None:
        self._presented = self._active = self._buffer = self._profile = None
        self._acknowledge = False
        self._goal = None
        self._stale_timer = 0.0

    def resume_last_motion(self, axis: Axis) -> None:
        if self._previous is not None:
            self._start(axis, self._previous)

    def command(self, axis: Axis, old: int, new: int) -> None:
        self._bit_4 = bool(new & CW_BIT_4)
        if self._bit_4 and not old & CW_BIT_4:
            self._present(axis, new)
        self._clear_acknowledge(axis)

    def step(self, axis: Axis, dt: float) -> None:
        self._handshake(axis, dt)
        profile = self._profile
        if profile is not None:
            self._run(axis, profile, dt)
        else:
            axis.brake(_SLOW, dt)
            if self._active is not None:
                self._plan(axis, self._active)  # its limits were 0: they may have been set since
        self._watch_window(axis, dt)

    def halt(self, axis: Axis, effort: Effort, dt: float) -> None:
        self._handshake(axis, dt)
        super().halt(axis, effort, dt)
        self._watch_window(axis, dt)

    def resume(self, axis: Axis) -> None:
        if self._active is not None:
            self._plan(axis, self._active)

    def bits(self, axis: Axis) -> int:
        value = SW_BIT_12 if self._shows_acknowledge(axis) else 0
        if axis.following_exceeded:
            value |= SW_BIT_13
        if axis.dials.target_reached_never:
            return value
        if self._stale_timer > 0.0 or (axis.at_standstill if self._goal is None else self._reached):
            value |= SW_BIT_10
        return value

    # Handshake.

    def _shows_acknowledge(self, axis: Axis) -> bool:
        """Return bit 12, including the fault settings."""
        dials, since_mode = axis.dials, axis.since_mode_write
        if since_mode < dials.mode_pulses_acknowledge:
            return True
        hidden = dials.acknowledge_never or since_mode < dials.mode_clears_acknowledge
        return self._acknowledge and not hidden and self._acknowledged_for < dials.acknowledge_duration

    def _present(self, axis: Axis, word: int) -> None:
        delay = axis.dials.acknowledge_delay
        if delay == math.inf or (axis.dials.ignore_setpoint_during_halt and word & CW_HALT):
            return
        self._presented = self._set_point(axis, word)
        self._delay = delay
        self._handshake(axis, 0.0)

    def _set_point(self, axis: Axis, word: int) -> SetPoint:
        settings = axis.settings
        target = (
            self._base(axis) + _relative(axis) if word & CW_RELATIVE else axis.to_motor(axis.target_position)
        )
        inside = axis.position_within(target)
        return SetPoint(
            inside,
            min(axis.speed(settings.profile_velocity), axis.profile_speed_limit),
            axis.acceleration,
            axis.deceleration,
            axis.speed(settings.end_velocity),
            bool(word & CW_IMMEDIATELY),
            bool(word & CW_CHANGE_ON_SET_POINT),
            axis.clamped,
        )

    def _base(self, axis: Axis) -> float:
        """Return the reference of bit 6 (60F2h bits 0 and 1): the preceding target, the demand, or the actual position."""
        option = axis.settings.positioning_option & 3
        if option == 2:
            return axis.motor.position
        if option == 1:
            return axis.position
        newest = self._buffer or self._active
        if newest is not None:
            return newest.target
        return self._goal if self._goal is not None else axis.position

    def _handshake(self, axis: Axis, dt: float) -> None:
        self._acknowledged_for += dt
        presented = self._presented
        if presented is None:
            return
        self._delay -= dt
        if self._delay > 0.0:
            return
        self._presented = None
        if presented.immediately or not self._moving:
            self._buffer = None
            self._start(axis, presented)
        elif self._buffer is None:
            self._buffer = presented
            if presented.passing and self._active is not None:
                self._active = self._active._replace(end_speed=self._active.speed)
                self._plan(axis, self._active)
        else:
            return
        self._acknowledge = True
        self._acknowledged_for = 0.0
        self._clear_acknowledge(axis)

    def _clear_acknowledge(self, axis: Axis) -> None:
        if not self._bit_4 and self._buffer is None and not axis.dials.acknowledge_stays:
            self._acknowledge = False

    # Motion.

    @property
    def _moving(self) -> bool:
        return self._active is not None

    def _start(self, axis: Axis, point: SetPoint) -> None:
        if self._reached and axis.dials.target_reached_late:
            self._stale_timer = axis.dials.target_reached_late
        self._active = self._previous = point
        self._goal = point.target
        self._reached = False
        self._window_timer = 0.0
        axis.clamped = point.clamped
        before, self._profile = self._profile, None
        self._plan(axis, point, before)
        self._watch_window(axis, 0.0)

    def _plan(self, axis: Axis, point: SetPoint, before: Profile | SoftProfile | None = None) -> None:
        settings = axis.settings
        speed = point.speed or min(axis.speed(settings.profile_velocity), axis.profile_speed_limit)
        acceleration = point.acceleration or axis.acceleration
        deceleration = point.deceleration or axis.deceleration
        if speed <= 0.0 or acceleration <= 0.0 or deceleration <= 0.0:
            return
        jerk = axis.profile_jerk
        if not jerk or point.end_speed:
            begin, soft, seconds = (axis.position, axis.velocity), None, 0.0
        else:
            seconds = (acceleration + deceleration) / jerk
            soft = before if isinstance(before, SoftProfile) and before.seconds == seconds else None
            soft = soft if soft is not None and soft.is_at(axis.position, axis.velocity) else None
            begin = (axis.position + 0.5 * axis.velocity * seconds, axis.velocity)
            begin = begin if soft is None else soft.ahead
        plain = plan_move(*begin, point.target, speed, acceleration, deceleration, point.end_speed)
        self._profile = SoftProfile(plain, seconds, begin, soft) if seconds else plain

    def _run(self, axis: Axis, profile: Profile | SoftProfile, dt: float) -> None:
        position, velocity = profile.advance(dt)
        if axis.forbidden and velocity * axis.forbidden > 0.0:
            self._drop(axis)
            axis.brake(Effort.QUICK, dt)
            return
        axis.follow(position, velocity, dt)
        if not profile.done:
            return
        self._profile = self._active = None
        if self._buffer is not None:
            point, self._buffer = self._buffer, None
            self._start(axis, point)
            self._clear_acknowledge(axis)

    def _drop(self, axis: Axis) -> None:
        """End the move at a limit switch; its target is never reached."""
        self._profile = self._active = self._buffer = None
        axis.clamped = True

    def _watch_window(self, axis: Axis, dt: float) -> None:
        if self._stale_timer > 0.0:
            self._stale_timer -= dt
        goal = self._goal
        if goal is None:
            return
        window = axis.settings.position_window
        arrived = self._active is None
        inside = arrived if window == _NO_WINDOW else abs(goal - axis.motor.position) < window + 0.5
        if not inside:
            self._window_timer = 0.0
            self._reached = False
            return
        self._window_timer += dt
        self._reached = self._window_timer * 1000.0 >= axis.settings.position_window_time


def _relative(axis: Axis) -> float:
    """Return the distance of a relative set-point in motor direction."""
    return axis.to_user(float(axis.target_position)) - axis.to_user(0.0)
