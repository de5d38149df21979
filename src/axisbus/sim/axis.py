"""Motion part of one axis: the demand that its motor follows, its limits, and the conversion between user and motor positions.

Modes of operation use it: they move the demand (``follow``, ``ramp_to``, ``brake``) or command a torque (``push``). Positions
inside are motor positions; ``to_motor`` and ``to_user`` apply polarity (607Eh) and the home offset.
"""

from __future__ import annotations

import math

from axisbus.sim.compliant import make_motor
from axisbus.sim.control_bits import as_int32
from axisbus.sim.fault_injection import DriveFaults
from axisbus.sim.motor import MotorParams
from axisbus.sim.power import Effort
from axisbus.sim.ramp import ramp_velocity
from axisbus.sim.settings import Settings

_REST = 1.0  # increments/s: slower is standstill
_NO_WINDOW = 0xFFFF_FFFF
_WHOLE_COUNT = (-(2**31), 2**31 - 1)  # software limits of the whole INTEGER32 are no limits: the count wraps


class Axis:
    """Motion state of one axis: the demand, the targets as written by the master, and the motor."""

    __slots__ = (
        "_following_timer",
        "_sign",
        "_speed_limit",
        "_torque_limit",
        "_velocity_sign",
        "_versions",
        "clamped",
        "dials",
        "drift",
        "following_exceeded",
        "forbidden",
        "motor",
        "offset",
        "params",
        "position",
        "settings",
        "since_mode_write",
        "speed_limited",
        "target_position",
        "target_torque",
        "target_velocity",
        "torque_demand",
        "velocity",
    )

    def __init__(self, settings: Settings, params: MotorParams, dials: DriveFaults) -> None:
        self.settings = settings
        self.params = params
        self.dials = dials
        self.motor = make_motor(params)
        self.target_position = self.target_velocity = self.target_torque = 0
        self.offset = 0.0
        self.position = self.motor.position  # the demand, and its velocity
        self.velocity = 0.0
        self.drift = 0.0  # distance of the motor from the demand, by a drive that creeps
        self.torque_demand = 0.0
        self.clamped = False  # the last target was beyond a limit
        self.speed_limited = False
        self.following_exceeded = False
        self.since_mode_write = math.inf  # seconds since 6060h was written, with any value
        self.forbidden = 0  # direction in which a limit switch forbids motion
        self._following_timer = 0.0
        self._versions = -1
        self._refresh()

    # Units and limits.

    def to_motor(self, target: int) -> float:
        """Return the motor position of a user position (INTEGER32), by the shorter way if the drive's count wraps."""
        base = round(self._sign * self.position + self.offset)
        distance = as_int32(target - base) if self.params.wraps else target - as_int32(base)
        return self._sign * (base + distance - self.offset)

    def to_user(self, position: float) -> float:
        """Return the user position of a motor position, unwrapped."""
        return self._sign * position + self.offset

    def user_velocity(self, velocity: float) -> int:
        """Return a motor velocity in the drive's velocity units."""
        return round(self._velocity_sign * velocity * self.params.velocity_unit)

    def motor_velocity(self, velocity: float) -> float:
        """Return a user velocity (signed velocity units) in increments/s."""
        return self._velocity_sign * velocity / self.params.velocity_unit

    def speed(self, value: float) -> float:
        """Return an unsigned speed in velocity units as increments/s."""
        return value / self.params.velocity_unit

    def refresh(self) -> None:
        """Compute the limits again if parameters were written."""
        if self.settings.changes != self._versions:
            self._refresh()

    def _refresh(self) -> None:
        settings = self.settings
        self._versions = settings.changes
        self._sign = -1.0 if settings.polarity & 0x80 else 1.0
        self._velocity_sign = -1.0 if settings.polarity & 0x40 else 1.0
        torque = float(settings.max_torque or math.inf)
        self._torque_limit = min(torque, self.params.max_torque)
        self._speed_limit = self._motor_speed_limit()

    def _motor_speed_limit(self) -> float:
        """Return the limit of 6080h, which is in revolutions per minute of the motor; 0: no limit."""
        settings = self.settings
        if settings.max_motor_speed <= 0:
            return math.inf
        turn = float(self.params.increments_per_turn)
        if settings.encoder_increments > 0 and settings.encoder_revolutions > 0:
            turn = settings.encoder_increments / settings.encoder_revolutions
        return settings.max_motor_speed / 60.0 * turn

    @property
    def speed_limit(self) -> float:
        """Limit of every mode, in increments/s (6080h)."""
        return self._speed_limit

    @property
    def profile_speed_limit(self) -> float:
        """Limit of the profile modes, in increments/s (607Fh and 6080h; 0: no limit)."""
        profile = self.settings.max_profile_velocity
        return min(self._speed_limit, self.speed(profile)) if profile > 0 else self._speed_limit

    @property
    def acceleration(self) -> float:
        """Profile acceleration (6083h, 60C5h) in increments/s²; 0 if not set."""
        return self._acceleration(self.settings.profile_acceleration, self.settings.max_acceleration)

    @property
    def deceleration(self) -> float:
        """Profile deceleration (6084h, else 6083h; 60C6h) in increments/s²; 0 if not set."""
        settings = self.settings
        value = settings.profile_deceleration or settings.profile_acceleration
        return self._acceleration(value, settings.max_deceleration or settings.max_acceleration)

    @property
    def profile_jerk(self) -> float:
        """Profile jerk (60A4h:01, by the type of 6086h) in increments/s³; 0 if not limited."""
        settings = self.settings
        return (
            settings.profile_jerk / self.params.acceleration_unit
            if settings.motion_profile_type in (2, 3)
            else 0.0
        )

    def _acceleration(self, value: int, limit: int) -> float:
        return (min(value, limit) if limit > 0 else value) / self.params.acceleration_unit

    def braking(self, effort: Effort) -> float:
        """Return the deceleration of an effort; if none is set, the motor's maximum: a brake command always brakes."""
        settings = self.settings
        if effort is Effort.QUICK and settings.quick_stop_deceleration > 0:
            return settings.quick_stop_deceleration / self.params.acceleration_unit
        slow = self.deceleration if effort is not Effort.LIMIT else 0.0
        return slow or self._strongest

    @property
    def _strongest(self) -> float:
        spare = self._torque_limit - abs(self.params.load) - self.params.friction
        return max(0.1 * self._torque_limit, spare) * self.params.rated_acceleration / 1000.0

    def torque_within(self, torque: float) -> float:
        """Limit a torque to 6072h, 60E0h and 60E1h (0: no limit; some EDS files give 60E1h a sign); set ``clamped``."""
        settings = self.settings
        high = min(self._torque_limit, settings.positive_torque_limit or math.inf)
        low = -min(self._torque_limit, abs(settings.negative_torque_limit) or math.inf)
        self.clamped = not low <= torque <= high
        return min(max(torque, low), high)

    def position_within(self, position: float) -> float:
        """Limit a motor position to 607Dh (active if low < high and not the whole INTEGER32); set ``clamped``."""
        settings = self.settings
        self.clamped = False
        if (
            settings.low_limit >= settings.high_limit
            or (settings.low_limit, settings.high_limit) == _WHOLE_COUNT
        ):
            return position
        user = self._sign * position + self.offset
        inside = min(max(user, settings.low_limit), settings.high_limit)
        if inside == user:
            return position
        self.clamped = True
        return self._sign * (inside - self.offset)

    def velocity_within(self, velocity: float, limit: float) -> float:
        """Limit a velocity to ``limit`` and by the limit switches; set ``clamped``."""
        self.clamped = abs(velocity) > limit
        velocity = min(max(velocity, -limit), limit)
        if self.forbidden and velocity * self.forbidden > 0.0:
            self.clamped = True
            return 0.0
        return velocity

    # Motion.

    @property
    def at_standstill(self) -> bool:
        """Whether demand and motor are at standstill."""
        return self.velocity == 0.0 and -_REST <= self.motor.velocity <= _REST

    def restart_tracking(self) -> None:
        """Set the demand to the position and velocity of the motor, so that nothing jumps."""
        self.position = self.motor.restart_tracking()
        self.drift = 0.0
        self.velocity = self.motor.velocity
        self.torque_demand = self.motor.torque
        self.following_exceeded = False
        self._following_timer = 0.0

    def follow(
        self, position: float, velocity: float, dt: float, feed_forward: float = 0.0, push: float = 0.0
    ) -> None:
        """Move the demand to ``position`` within ``dt``; the motor tracks it.

        ``feed_forward`` (increments/s) and ``push`` (‰) are added to the outputs of its controllers (60B1h, 60B2h).
        """
        self.position = position
        self.velocity = velocity
        self.motor.track(position + self.drift, dt, self._torque_limit, feed_forward, push)

    def ramp_to(self, velocity: float, acceleration: float, deceleration: float, dt: float) -> None:
        """Ramp the demand's velocity towards ``velocity``."""
        after, distance = ramp_velocity(self.velocity, velocity, acceleration, deceleration, dt)
        self.follow(self.position + distance, after, dt)

    def forget_error(self) -> None:
        """In velocity modes, do not catch up the distance that a motor at its torque limit has missed."""
        if self.motor.saturated:
            self.position = self.motor.rewind(self.velocity)
            self.drift = 0.0

    def brake(self, effort: Effort, dt: float) -> None:
        """Bring the demand to standstill and hold it there."""
        if self.velocity == 0.0:
            self.motor.track(self.position + self.drift, dt, self._torque_limit)
            return
        rate = self.braking(effort)
        self.ramp_to(0.0, rate, rate, dt)

    def push(self, torque: float, dt: float) -> None:
        """Apply a torque (0: coast); the demand follows the motor."""
        motor = self.motor
        motor.push(torque, dt)
        self.speed_limited = abs(motor.velocity) > self._speed_limit
        if self.speed_limited:
            motor.velocity = math.copysign(self._speed_limit, motor.velocity)
        self.position = motor.position
        self.velocity = motor.velocity
        self.torque_demand = torque

    def following_fault(self, dt: float) -> bool:
        """Supervise the following error (6065h, 6066h; a window of 0 or FFFFFFFFh: off); return True if it has lasted too long."""
        window = self.settings.following_window
        if window == 0 or window == _NO_WINDOW or abs(self.position - self.motor.position) <= window:
            self._following_timer = 0.0
            self.following_exceeded = False
            return False
        self.following_exceeded = True
        self._following_timer += dt
        return self._following_timer * 1000.0 > self.settings.following_time

    # Switches.

    def watch_switches(self) -> None:
        """Determine the direction in which a limit switch forbids motion."""
        low, high = self.params.limit_switches
        position = self.motor.position
        if high is not None and position >= high:
            self.forbidden = 1
        elif low is not None and position <= low:
            self.forbidden = -1
        else:
            self.forbidden = 0

    @property
    def digital_inputs(self) -> int:
        """60FDh: negative limit switch, positive limit switch, home switch in bits 0 to 2."""
        low, high = self.params.limit_switches
        position = self.motor.position
        value = 0
        if low is not None and position <= low:
            value |= 1
        if high is not None and position >= high:
            value |= 2
        home = self.params.home_switch
        if home is not None and home[0] <= position <= home[1]:
            value |= 4
        return value
