"""Axis of a simulated module: its states, error words, automatic disarming, and calibrations, advanced by dt.

Theory of operation
-------------------
``request`` executes Set_Axis_State. Only state 8 and the calibrations energise the motor. A module with any error ignores a request
for state 8; a new error removes the power at once, and the motor coasts. Error words stay until ``clear``; if their cause persists,
they return with the next step. Two watchdogs count the time since the last set-point, in every state.
"""

from __future__ import annotations

import math

from axisbus.drives.gim6010.sim.constants import (
    MIT_RANGES,
    AxisError,
    AxisState,
    ControllerError,
    EncoderError,
    Firmware,
    MotorError,
    SystemWord,
)
from axisbus.drives.gim6010.sim.controller import Controller
from axisbus.drives.gim6010.sim.fault_injection import ModuleFaults
from axisbus.drives.gim6010.sim.parameters import CALIBRATED, Parameters
from axisbus.drives.gim6010.sim.shaft import Shaft

# Sequence of each calibration: the reported states (never 3), with their durations in s.
_MOTOR = (AxisState.MOTOR_CALIBRATION, 4.0)
_ENCODER = (AxisState.ENCODER_CALIBRATION, 6.0)
_CALIBRATIONS = {
    AxisState.FULL_CALIBRATION: (_MOTOR, _ENCODER),
    AxisState.MOTOR_CALIBRATION: (_MOTOR,),
    AxisState.ENCODER_CALIBRATION: (_ENCODER,),
}
_TURNED = 1.0  # rotor turns forward and back during the encoder calibration
_RESISTANCE = 0.25  # ohm: resistance that causes the heat loss


class ModuleAxis:
    """State, error words and timers."""

    def __init__(self, shaft: Shaft, parameters: Parameters, dials: ModuleFaults, firmware: Firmware) -> None:
        self.shaft = shaft
        self.controller = Controller(shaft, parameters, dials)
        self._parameters = parameters
        self._dials = dials
        self._firmware = firmware
        self.state: int = AxisState.IDLE
        self.clear()
        self._since_input = 0.0
        self._sequence: list[tuple[AxisState, float]] = []
        self._time = 0.0  # in the present part of a calibration
        self._calibrated: set[AxisState] = set()  # since power-up
        self._place = 0.0

    # Commands.

    def request(self, state: int) -> None:
        if state == AxisState.UNDEFINED or (state == self.state and not self._sequence):
            return
        if state == AxisState.IDLE:
            self._release()
        elif state == AxisState.CLOSED_LOOP:
            self._start()
        elif state in _CALIBRATIONS:
            self._calibrate(AxisState(state))
        else:
            self.error |= AxisError.INVALID_STATE
            self._release()

    def estop(self) -> None:
        self.error |= AxisError.ESTOP_REQUESTED
        self._release()

    def clear(self) -> None:
        self.error = AxisError(0)
        self.motor_error = MotorError(0)
        self.encoder_error = EncoderError(0)
        self.controller_error = ControllerError(0)
        self.system_error = SystemWord(0)

    def feed(self) -> None:
        """Note a set-point: the watchdogs restart."""
        self._since_input = 0.0

    def restart(self) -> None:
        """Power up: idle, no errors, no commands."""
        self._release()
        self.clear()
        self._since_input = 0.0
        self._calibrated.clear()
        self.controller = Controller(self.shaft, self._parameters, self._dials)

    # Reported values.

    @property
    def energised(self) -> bool:
        return self.state != AxisState.IDLE

    @property
    def faulty(self) -> bool:
        words = self.error, self.motor_error, self.encoder_error, self.controller_error, self.system_error
        return any(words)

    @property
    def current(self) -> float:
        """Iq in A."""
        return self.shaft.torque / self._torque_constant if self.energised else 0.0

    @property
    def current_setpoint(self) -> float:
        """The target of Iq in A."""
        return self.controller.torque_setpoint / self._torque_constant if self.energised else 0.0

    @property
    def mechanical_power(self) -> float:
        """Mechanical power at the rotor, in W."""
        return self.shaft.torque * self.shaft.speed * 2.0 * math.pi if self.energised else 0.0

    @property
    def electrical_power(self) -> float:
        """Power from the supply, in W."""
        return self.mechanical_power + self.current * self.current * _RESISTANCE

    @property
    def bus_current(self) -> float:
        """Supply current in A."""
        voltage = self._dials.bus_voltage
        return self.electrical_power / voltage if voltage > 0.0 else 0.0

    # Time.

    def step(self, dt: float) -> None:
        """Advance by ``dt`` s."""
        dials, shaft = self._dials, self.shaft
        shaft.motor.blocked = dials.blocked
        shaft.freeze(dials.encoder_frozen)
        self._since_input += dt
        self._supervise()
        if self.faulty and self.energised:
            self._release()
        if dt <= 0.0:
            return
        if self.state == AxisState.CLOSED_LOOP:
            self._run(dt)
        elif self._sequence:
            self._calibrating(dt)
        else:
            shaft.push(0.0, dt)

    def _run(self, dt: float) -> None:
        axis, motor, controller = self.controller.step(dt, self._torque_limit)
        if not (axis or motor or controller):
            return
        self.error |= axis
        self.motor_error |= motor
        self.controller_error |= controller
        self._summarise()
        self._release()

    # Errors.

    def _supervise(self) -> None:
        dials, get = self._dials, self._parameters
        if dials.bus_voltage < get["config.dc_bus_undervoltage_trip_level"]:
            self.system_error |= SystemWord.DC_BUS_UNDER_VOLTAGE
        if dials.bus_voltage > get["config.dc_bus_overvoltage_trip_level"]:
            self.system_error |= SystemWord.DC_BUS_OVER_VOLTAGE
        too_hot = dials.temperature > get["axis0.motor.fet_thermistor.config.temp_limit_upper"]
        if too_hot and get["axis0.motor.fet_thermistor.config.enabled"]:
            self.motor_error |= MotorError.FET_THERMISTOR_OVER_TEMP
            self.error |= AxisError.OVER_TEMP
        if dials.encoder_error:
            self.encoder_error |= EncoderError(dials.encoder_error)
        if dials.motor_error:
            self.motor_error |= MotorError(dials.motor_error)
        self._watch_inputs()
        self._summarise()

    def _watch_inputs(self) -> None:
        get = self._parameters
        works = self._dials.watchdog_works
        works = self._firmware < MIT_RANGES if works is None else works
        if works and get["axis0.config.enable_watchdog"]:
            timeout = get["axis0.config.watchdog_timeout"]
            if timeout > 0.0 and self._since_input > timeout + 1e-9:
                self.error |= AxisError.WATCHDOG_TIMER_EXPIRED
        silence = get["can.config.break_timeout"] / 1000.0 or self._dials.break_when_zero
        if silence > 0.0 and self._since_input > silence + 1e-9:
            self.error |= AxisError.CAN_BUS_FAILED

    def _summarise(self) -> None:
        """Set the bits of the axis's word for the other words that are not 0."""
        if self.system_error:
            self.motor_error |= MotorError.SYSTEM_LEVEL
        if self.motor_error:
            self.error |= AxisError.MOTOR_FAILED
        if self.encoder_error:
            self.error |= AxisError.ENCODER_FAILED
        if self.controller_error:
            self.error |= AxisError.CONTROLLER_FAILED

    # States.

    def _start(self) -> None:
        if self.faulty or self._dials.wont_start:
            return
        if not self._is_calibrated:
            self.error |= AxisError.INVALID_STATE
            self._release()
            return
        self._sequence = []
        self.state = AxisState.CLOSED_LOOP
        self.controller.start()

    def _release(self) -> None:
        self._sequence = []
        self.state = AxisState.IDLE
        self.controller.stop()

    def _calibrate(self, state: AxisState) -> None:
        if self.faulty:
            return
        self.controller.stop()
        self._sequence = list(_CALIBRATIONS[state])
        self._enter_part()

    def _enter_part(self) -> None:
        self.state, self._time = self._sequence[0][0], 0.0
        self._place = self.shaft.seize()

    def _calibrating(self, dt: float) -> None:
        state, duration = self._sequence[0]
        duration *= self._dials.calibration_time
        self._time += dt
        if state == AxisState.ENCODER_CALIBRATION:
            way = math.pi if self._dials.calibration_one_way else 2.0 * math.pi
            turned = 0.5 - 0.5 * math.cos(way * min(1.0, self._time / duration))
            self.shaft.lead(self._place + _TURNED * turned, dt, self._torque_limit)
        else:
            self.shaft.lead(self._place, dt, self._torque_limit)
        if self._time < duration:
            return
        self._sequence.pop(0)
        self._judge(state)
        if self._sequence and not self.faulty:
            self._enter_part()
        else:
            self._release()

    def _judge(self, state: AxisState) -> None:
        """End a part of a calibration: mark the part as failed, or as valid until the next start."""
        if state == AxisState.MOTOR_CALIBRATION:
            self.motor_error |= MotorError(self._dials.calibration_motor_error)
        else:
            self.encoder_error |= EncoderError(self._dials.calibration_encoder_error)
        self._summarise()
        if not self.faulty:
            self._calibrated.add(state)

    @property
    def _is_calibrated(self) -> bool:
        parts = (AxisState.MOTOR_CALIBRATION, AxisState.ENCODER_CALIBRATION)
        flags = (bool(self._parameters[path]) for path in CALIBRATED)
        return all(flag or part in self._calibrated for part, flag in zip(parts, flags, strict=True))

    @property
    def _torque_constant(self) -> float:
        """Torque constant in N·m/A at the rotor; an invalid one counts as 1, so that 1 A is 1 N·m (manual 3.1.3)."""
        constant = self._parameters["axis0.motor.config.torque_constant"]
        return constant if 0.0 < constant < math.inf else 1.0

    @property
    def _torque_limit(self) -> float:
        current = self._parameters["axis0.motor.config.current_lim"]
        return min(current * self._torque_constant, 1e6) if current > 0.0 else 0.0
