"""Controller of a simulated module: motion from inputs, by control mode and input mode (manual 3.1.7).

Theory of operation
-------------------
An input mode derives a set-point from the input. The position loop derives a velocity from it (feed-forward plus ``pos_gain`` times
the error), limited by ``vel_limit`` and by the acceleration that the current limit permits. The motor follows the integral of this
velocity. No input causes a jump: on entering closed loop, and with each change of mode, everything starts from the present position
and velocity of the motor. The velocity loop is that of the motor model; its gains only matter in being 0 or not. In torque and MIT
modes the motor gets the torque of their formula. Units are the firmware's: turns, turns/s, N·m, all at the rotor; MIT's gains act
on rotor turns and give torque at the output.
"""

from __future__ import annotations

import math

from axisbus.drives.gim6010.sim.constants import (
    AxisError,
    ControllerError,
    ControlMode,
    InputMode,
    MotorError,
)
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.parameters import Parameters
from axisbus.drives.gim6010.sim.shaft import Shaft
from axisbus.sim.ramp import Profile, plan_move, slope

_PIECE = 0.001  # s of one pass of the loop
_MIT_PIECE = 0.00025  # s: a stiff spring oscillates faster
_CONTROLLER = "axis0.controller.config."
_TRAJECTORY = "axis0.traj_traj.config."
_AT_PLACE = 1e-5  # turns
_AT_REST = 1e-3  # turns/s
_OVERSPEED = 1.2  # ratio to vel_limit
_DISARMS_AFTER = 0.3  # s at full speed, after which a runaway module disarms
_MOST = 1e9
_INPUT_MODES = frozenset(InputMode)
_WELL = AxisError(0), MotorError(0), ControllerError(0)


class Controller:
    """Inputs, set-points and the active profile."""

    def __init__(self, shaft: Shaft, parameters: Parameters, dials: ModuleFaults) -> None:
        self._shaft = shaft
        self._parameters = parameters
        self._dials = dials
        self.input_pos = self.input_vel = self.input_torque = 0.0
        self.kp = self.kd = 0.0
        self.torque_setpoint = 0.0
        self.trajectory_done = True
        self._running = False
        self._demand = 0.0
        self._velocity = 0.0  # velocity of the demand
        self._setpoint = self._rate = 0.0
        self._profile: Profile | None = None
        self._since_input: float | None = None  # seconds; None: no input since the start
        self._running_away: float | None = None  # seconds at full speed

    # Inputs.

    def take(
        self, *, pos: float | None = None, vel: float | None = None, torque: float | None = None
    ) -> None:
        """Take inputs; those not given stay unchanged."""
        self.input_vel = self.input_vel if vel is None else vel
        self.input_torque = self.input_torque if torque is None else torque
        self._since_input = 0.0
        if pos is None:
            return
        self.input_pos = pos
        if self._running and self._input_mode == InputMode.TRAPEZOID and math.isfinite(pos):
            self._plan()

    def start(self) -> None:
        self._running = True
        self.mode_changed()

    def mode_changed(self) -> None:
        """Restart from the motor's position; a position is held until a new one arrives."""
        shaft = self._shaft
        self._demand, self._velocity = shaft.seize(), shaft.speed
        self._setpoint = self.input_pos = shaft.turns - shaft.origin
        self._rate = self._velocity
        self._profile, self.trajectory_done = None, True
        self._since_input = self._running_away = None
        self.torque_setpoint = 0.0

    def stop(self) -> None:
        self._running = False
        self._profile, self.trajectory_done = None, True
        self._running_away = None
        self.torque_setpoint = 0.0

    # Time.

    def step(self, dt: float, limit: float) -> tuple[AxisError, MotorError, ControllerError]:
        """Advance by ``dt`` s with at most ``limit`` N·m; return the errors that occurred."""
        size = _MIT_PIECE if self._input_mode == InputMode.MIT else _PIECE
        pieces = max(1, math.ceil(dt / size - 1e-9))
        for _ in range(pieces):
            wrong = self._piece(dt / pieces, limit)
            if any(wrong):
                return wrong
        return _WELL

    def _piece(self, h: float, limit: float) -> tuple[AxisError, MotorError, ControllerError]:
        no_axis, no_motor, no_controller = _WELL
        if self._since_input is not None:
            self._since_input += h
        if self._input_mode not in _INPUT_MODES:
            return no_axis, no_motor, ControllerError.INVALID_INPUT_MODE
        inputs = (self.input_pos, self.input_vel, self.input_torque, self.kp, self.kd)
        if not all(map(math.isfinite, inputs)):
            return no_axis, MotorError.MODULATION_IS_NAN, no_controller
        if self._runs_away():
            if self._run_away(h, limit):
                return AxisError.MOTOR_FAILED, no_motor, no_controller
        else:
            self._move(h, limit)
        fast = abs(self._shaft.speed) > _OVERSPEED * self._limit("vel_limit")
        overspeed = fast and bool(self._parameters[_CONTROLLER + "enable_vel_limit"])
        return no_axis, no_motor, ControllerError.OVERSPEED if overspeed else no_controller

    def _move(self, h: float, limit: float) -> None:
        mode = int(self._parameters[_CONTROLLER + "control_mode"])
        if mode == ControlMode.TORQUE:
            self._push(self._torque(h, limit), h, limit)
        elif mode == ControlMode.VELOCITY:
            self._turn(h, limit)
        elif mode == ControlMode.POSITION and self._input_mode == InputMode.MIT:
            self._push(self._mit(), h, limit)
        elif mode == ControlMode.POSITION:
            self._position(h, limit)
        else:
            self._push(0.0, h, limit)  # voltage control: CAN Simple has no voltage input

    # Position.

    def _position(self, h: float, limit: float) -> None:
        mode = self._input_mode
        if mode == InputMode.PASSTHROUGH:
            self._setpoint = self.input_pos
            self._lead(self._setpoint - self._demand, self.input_vel, h, limit)
            return
        before = self._setpoint
        if mode == InputMode.POSITION_FILTER:
            self._filter(h)
        elif mode == InputMode.TRAPEZOID and self._profile is not None:
            self._setpoint, self._rate = self._profile.advance(h)
            self.trajectory_done = self._profile.done
            self._profile = None if self._profile.done else self._profile
        self._lead(before - self._demand, (self._setpoint - before) / h, h, limit)

    def _filter(self, h: float) -> None:
        """Apply a critically damped second-order filter with limited velocity."""
        bandwidth = min(self._limit("input_filter_bandwidth"), 0.25 / h)
        away = self.input_pos - self._setpoint
        if abs(away) < _AT_PLACE and abs(self._rate) < _AT_REST:
            self._setpoint, self._rate = self.input_pos, 0.0
            return
        pull = bandwidth * bandwidth * away + 2.0 * bandwidth * (self.input_vel - self._rate)
        fastest = self._fastest()
        self._rate = max(-fastest, min(fastest, self._rate + pull * h))
        self._setpoint += self._rate * h

    def _plan(self) -> None:
        """Plan a trapezoid from the set-point; if one of its limits is 0, plan nothing, and the target is never reached."""
        fastest = min(_positive(self._parameters[_TRAJECTORY + "vel_limit"]), self._fastest())
        speeding = _positive(self._parameters[_TRAJECTORY + "accel_limit"])
        braking = _positive(self._parameters[_TRAJECTORY + "decel_limit"])
        self.trajectory_done = False
        if fastest > 0.0 and speeding > 0.0 and braking > 0.0:
            self._profile = plan_move(self._setpoint, self._rate, self.input_pos, fastest, speeding, braking)

    def _lead(self, error: float, rate: float, h: float, limit: float) -> None:
        reach = self._shaft.reach(limit)
        gain = min(self._limit("pos_gain"), 0.5 / h)
        correction = min(gain * abs(error), math.sqrt(reach * abs(error)))
        if rate == 0.0 and abs(error) < _AT_PLACE and abs(self._velocity) < _AT_REST and gain > 0.0:
            self._velocity = 0.0
            self._demand += error
            self._track(h, limit)
            return
        self._go(rate + math.copysign(correction, error), reach, h, limit)

    # Velocity.

    def _turn(self, h: float, limit: float) -> None:
        mode = self._input_mode
        if mode in (InputMode.PASSTHROUGH, InputMode.VELOCITY_RAMP):
            self._rate = self.input_vel
        reach = self._shaft.reach(limit)
        if mode == InputMode.VELOCITY_RAMP:
            reach = min(reach, self._limit("vel_ramp_rate"))
        self._go(self._rate, reach, h, limit)

    def _go(self, velocity: float, acceleration: float, h: float, limit: float) -> None:
        fastest = self._fastest()
        wanted = max(-fastest, min(fastest, velocity))
        self._velocity = slope(self._velocity, wanted, acceleration, h)
        self._demand += self._velocity * h
        self._track(h, limit)

    def _track(self, h: float, limit: float) -> None:
        """Move the motor; if it is blocked or too weak, the demand waits for it. Without velocity loop it has no torque."""
        shaft = self._shaft
        if not (self._limit("vel_gain") > 0.0 or self._limit("vel_integrator_gain") > 0.0):
            self._push(0.0, h, limit)
            return
        shaft.lead(self._demand, h, limit)
        self.torque_setpoint = shaft.torque
        if shaft.motor.saturated:
            self._velocity = shaft.speed
            self._demand = shaft.rewind(self._velocity)

    # Torque.

    def _torque(self, h: float, limit: float) -> float:
        mode = self._input_mode
        torque = self.torque_setpoint
        if mode == InputMode.PASSTHROUGH:
            torque = self.input_torque
        elif mode == InputMode.TORQUE_RAMP:
            torque = slope(torque, self.input_torque, self._limit("torque_ramp_rate"), h)
        torque = max(-limit, min(limit, torque))
        if self._parameters[_CONTROLLER + "enable_torque_mode_vel_limit"]:
            gain, fastest, speed = self._limit("vel_gain"), self._limit("vel_limit"), self._shaft.speed
            torque = max((-fastest - speed) * gain, min((fastest - speed) * gain, torque))
        return torque

    def _mit(self) -> float:
        shaft = self._shaft
        away = self.input_pos - (shaft.turns - shaft.origin)
        spring = self.kp * away + self.kd * (self.input_vel - shaft.speed)
        return spring / self.gear + self.input_torque

    def _push(self, torque: float, h: float, limit: float) -> None:
        self.torque_setpoint = max(-limit, min(limit, torque))
        self._shaft.push(self.torque_setpoint, h)
        self._demand, self._velocity = self._shaft.turns - self._shaft.origin, self._shaft.speed

    # Runaway, which owners saw when set-points paused.

    def _runs_away(self) -> bool:
        after = self._dials.runaway_after
        if self._running_away is not None:
            return True
        if after is None or self._since_input is None or self._parameters["can.config.break_timeout"]:
            return False
        if self._input_mode != InputMode.PASSTHROUGH or self._since_input < after:
            return False
        self._demand, self._velocity = self._shaft.seize(), self._shaft.speed
        self._running_away = 0.0
        return True

    def _run_away(self, h: float, limit: float) -> bool:
        """Run to the highest negative speed; return whether the module disarms."""
        fastest = self._fastest()
        self._go(-fastest, self._shaft.reach(limit), h, limit)
        if self._running_away is not None and self._velocity <= -0.98 * fastest:
            self._running_away += h
        return self._running_away is not None and self._running_away > _DISARMS_AFTER

    # Parameters.

    @property
    def gear(self) -> float:
        """Turns of the rotor per turn of the output shaft."""
        return _positive(self._parameters["axis0.motor.config.gear_ratio"]) or 8.0

    @property
    def _input_mode(self) -> int:
        return int(self._parameters[_CONTROLLER + "input_mode"])

    def _limit(self, name: str) -> float:
        return _positive(self._parameters[_CONTROLLER + name])

    def _fastest(self) -> float:
        return self._limit("vel_limit") if self._parameters[_CONTROLLER + "enable_vel_limit"] else _MOST


def _positive(value: float) -> float:
    """Return a limit or gain as the loop uses it: negative values and NaN count as 0."""
    return min(value, _MOST) if value > 0.0 else 0.0
