"""The Modbus RTU registers as one table (manual v2.2, 4.3.2, 4.3.3), from which they are read, written and documented.

If the manual does not document a property of a register, but that of the parameter with the same name over USB and CAN Simple
(unit, side of the gear, bounds), the table uses the latter; docs/gim6010-8.md lists these cases.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from axisbus.drives.gim6010.can_simple.fields import (
    BYTES4,
    FLOAT32,
    UINT16,
    UINT32,
    UINT64,
    FieldType,
    GearSide,
    MessageField,
    Number,
)
from axisbus.drives.gim6010.can_simple.messages import CONTROL_MODES, HIGHEST_CURRENT, INPUT_MODES
from axisbus.errors import ArgumentError

_BITS = 16  # of one register
HIGHEST_NODE_ID = 63  # the node ID is the same as in CAN Simple, where it has six bits
FACTORY_RATE = 115200  # bit/s, also the highest (4.3)
RATES = (9600, 19200, 38400, 57600, FACTORY_RATE)
HIGHEST_DEVICE = 247  # Modbus over serial line, 2.2; 0 is broadcast, without answers


class Bank(Enum):
    """Address space of a register, with the function code that reads it (4.3.1)."""

    INPUT = 0x04
    HOLDING = 0x03


class RegisterKind(Enum):
    """Purpose of a register."""

    MEASURED = "is measured"
    SETTING = "is a setting"
    MODE = "is a control mode"
    TARGET = "is a set-point"
    STATE = "requests a state"
    ADDRESS = "is the address of the module"
    ACT = "acts on any written value"
    ENDPOINT = "accesses parameters by number"


@dataclass(frozen=True, slots=True, repr=False)
class Register:
    """One value: its first address, the manual's ``title``, and the field with its name, type, unit, side of the gear and bounds.

    ``access`` are the requests that the manual shows: r, w or rw. A value of several registers has its highest 16 bits at the
    lowest address, and is always read or written as a whole.
    """

    address: int
    title: str
    field: MessageField
    bank: Bank
    kind: RegisterKind
    access: str
    note: str = ""

    def __repr__(self) -> str:
        return f"<{self.address:02X}h {self.name}>"

    @property
    def name(self) -> str:
        """Name for reading and writing it."""
        return self.field.name

    @property
    def count(self) -> int:
        """Number of registers."""
        return self.field.type.bits // _BITS

    @property
    def readable(self) -> bool:
        """Whether the manual shows a read."""
        return "r" in self.access

    @property
    def writable(self) -> bool:
        """Whether the manual shows a write."""
        return "w" in self.access

    def words(self, value: Number) -> tuple[int, ...]:
        """Return its registers for a value in its unit, most significant first.

        Raises:
            ArgumentError: not a number, not finite, or not in the manual's list of values.
            LimitError: beyond its bounds or its type.
        """
        raw = self.field.raw(value + 0.0 if self.field.type is FLOAT32 else value)  # no negative zero
        return tuple(raw >> _BITS * place & 0xFFFF for place in reversed(range(self.count)))

    def value(self, words: tuple[int, ...]) -> Number:
        """Return the value of its registers, in its unit; a float32 may be NaN or infinite, if the module reports that."""
        raw = 0
        for word in words:
            raw = raw << _BITS | word
        return self.field.take(raw.to_bytes(2 * self.count, "little"))


_ROTOR = GearSide.ROTOR
_CONFIG, _TRAJECTORY = "axis0.controller.config", "axis0.traj_traj.config"
_MODES = {mode: words for mode, words in CONTROL_MODES.items() if mode}  # 4.3.3 lists no voltage control
_INPUTS = {mode: INPUT_MODES[mode] for mode in (1, 2, 3, 5, 6)}  # nor MIT
_FLAG_BITS = "its upper byte is 0; bits 0 to 4: an error of motor, encoder, controller, system, axis"
_ASKED = {1: "idle", 8: "closed loop"}  # the only states requested here: the others move the motor


def _input(
    address: int,
    title: str,
    name: str,
    kind: FieldType,
    path: str,
    unit: str = "",
    side: GearSide = GearSide.NONE,
    note: str = "",
) -> Register:
    return Register(
        address,
        title,
        MessageField(name, kind, unit=unit, side=side, path=path),
        Bank.INPUT,
        RegisterKind.MEASURED,
        "r",
        note,
    )


def _holding(
    address: int, title: str, field: MessageField, kind: RegisterKind, access: str, note: str = ""
) -> Register:
    return Register(address, title, field, Bank.HOLDING, kind, access, note)


def _setting(
    address: int, title: str, name: str, unit: str, path: str, *, high: float = math.inf, note: str = ""
) -> Register:
    side = GearSide.NONE if unit == "A" else _ROTOR
    field = MessageField(name, FLOAT32, unit=unit, side=side, low=0.0, high=high, path=path)
    return _holding(address, title, field, RegisterKind.SETTING, "rw", note)


def _target(address: int, title: str, name: str, unit: str, path: str, note: str = "") -> Register:
    return _holding(
        address,
        title,
        MessageField(name, FLOAT32, unit=unit, side=_ROTOR, path=path),
        RegisterKind.TARGET,
        "rw",
        note,
    )


def _act(address: int, title: str, name: str, note: str) -> Register:
    return _holding(address, title, MessageField(name, UINT16), RegisterKind.ACT, "w", note)


REGISTERS = (
    _input(0x01, "Motor State", "motor_state", UINT16, "axis0.current_state", note="its upper byte is 0"),
    _input(0x02, "Error Flags", "error_flags", UINT16, "", note=_FLAG_BITS),
    _input(0x03, "Driver Error Code", "driver_error", UINT32, "axis0.error"),
    _input(0x05, "Motor Error Code", "motor_error", UINT64, "axis0.motor.error"),
    _input(0x09, "Encoder Error Code", "encoder_error", UINT32, "axis0.encoder.error"),
    _input(0x0B, "Controller Error Code", "controller_error", UINT32, "axis0.controller.error"),
    _input(0x0D, "System Error Code", "system_error", UINT32, "error"),
    _input(
        0x0F,
        "Position Feedback",
        "position_feedback",
        FLOAT32,
        "axis0.encoder.pos_estimate",
        "turns",
        _ROTOR,
        "valid only after closed loop was seen: over CAN the same estimate is invalid in idle",
    ),
    _input(
        0x11,
        "Velocity Feedback",
        "velocity_feedback",
        FLOAT32,
        "axis0.encoder.vel_estimate",
        "turns/s",
        _ROTOR,
    ),
    _input(0x13, "DC-Bus Voltage Feedback", "bus_voltage", FLOAT32, "vbus_voltage", "V"),
    _input(0x15, "DC-Bus Current Feedback", "bus_current", FLOAT32, "ibus", "A"),
    _input(
        0x17,
        "Q-Axis Current Setpoint",
        "iq_setpoint",
        FLOAT32,
        "axis0.motor.current_control.Idq_setpoint",
        "A",
    ),
    _input(
        0x19,
        "Q-Axis Current Feedback",
        "iq_feedback",
        FLOAT32,
        "axis0.motor.current_control.Iq_measured",
        "A",
    ),
    Register(
        0x31,
        "Random Endpoint Access Return Value",
        MessageField("endpoint_return", BYTES4),
        Bank.INPUT,
        RegisterKind.ENDPOINT,
        "r",
        "the value of the parameter whose number is in A1h",
    ),
    _act(
        0x61,
        "Emergency Stop",
        "emergency_stop",
        "takes the power off at once, and the motor coasts; the error latches",
    ),
    _holding(
        0x62,
        "Node ID",
        MessageField("node_id", UINT16, low=1, high=HIGHEST_NODE_ID, path="axis0.config.can.node_id"),
        RegisterKind.ADDRESS,
        "rw",
        "0 is the broadcast address of Modbus, which is not answered",
    ),
    _holding(
        0x63,
        "State Control",
        MessageField("state_control", UINT16, values=_ASKED, path="axis0.requested_state"),
        RegisterKind.STATE,
        "w",
        "motor_state shows the result; homing (11) is never requested, calibrations (3, 4, 7) only by the command calibrate",
    ),
    _holding(
        0x64,
        "Control Mode",
        MessageField("control_mode", UINT16, values=_MODES, path=f"{_CONFIG}.control_mode"),
        RegisterKind.MODE,
        "rw",
    ),
    _holding(
        0x65,
        "Input Mode",
        MessageField("input_mode", UINT16, values=_INPUTS, path=f"{_CONFIG}.input_mode"),
        RegisterKind.MODE,
        "rw",
    ),
    _target(
        0x66,
        "Position-Control Setpoint",
        "position_setpoint",
        "turns",
        "axis0.controller.input_pos",
        "a position is written here; example 2 of 4.3.4 writes one to 68h, which is the velocity",
    ),
    _target(
        0x68,
        "Velocity-Control Setpoint",
        "velocity_setpoint",
        "turns/s",
        "axis0.controller.input_vel",
        "never a position, although example 2 of 4.3.4 writes one",
    ),
    _target(0x6A, "Torque-Control Setpoint", "torque_setpoint", "N·m", "axis0.controller.input_torque"),
    _setting(0x6C, "Velocity Limit", "velocity_limit", "turns/s", f"{_CONFIG}.vel_limit"),
    _setting(
        0x6E, "Current Limit", "current_limit", "A", "axis0.motor.config.current_lim", high=HIGHEST_CURRENT
    ),
    _setting(
        0x70,
        "Trapezoidal Position-Control Velocity Limit",
        "trajectory_velocity",
        "turns/s",
        f"{_TRAJECTORY}.vel_limit",
    ),
    _setting(
        0x72,
        "Trapezoidal Position-Control Acceleration Limit",
        "trajectory_acceleration",
        "turns/s²",
        f"{_TRAJECTORY}.accel_limit",
    ),
    _setting(
        0x74,
        "Trapezoidal Position-Control Deceleration Limit",
        "trajectory_deceleration",
        "turns/s²",
        f"{_TRAJECTORY}.decel_limit",
    ),
    _setting(0x76, "Inertia", "inertia", "N·m per turn/s²", f"{_CONFIG}.inertia"),
    _setting(0x78, "Position Gain", "position_gain", "(turns/s)/turn", f"{_CONFIG}.pos_gain"),
    _setting(0x7A, "Velocity Gain", "velocity_gain", "N·m per turn/s", f"{_CONFIG}.vel_gain"),
    _setting(
        0x7C,
        "Velocity Integrator Gain",
        "velocity_integrator_gain",
        "N·m per turn",
        f"{_CONFIG}.vel_integrator_gain",
    ),
    _act(0x7E, "Reboot", "reboot", "restarts the module"),
    _act(0x7F, "Clear Errors", "clear_errors", "clears all errors"),
    _act(
        0x80,
        "Save Configuration",
        "save_configuration",
        "copies RAM to flash; over USB this restarts the module (3.1.6)",
    ),
    _holding(
        0xA1,
        "Random Endpoint Access — Endpoint Number",
        MessageField("endpoint_number", UINT16),
        RegisterKind.ENDPOINT,
        "w",
        "the number of the parameter that 31h and A2h access",
    ),
    _holding(
        0xA2,
        "Random Endpoint Access Write Value",
        MessageField("endpoint_value", BYTES4),
        RegisterKind.ENDPOINT,
        "w",
        "writes the parameter whose number is in A1h",
    ),
)

BY_NAME = {each.name: each for each in REGISTERS}
BY_PLACE = {(each.bank, each.address): each for each in REGISTERS}
# Bits of error_flags: the error words that are not 0, with their category in the fault table (5.7 calls the axis "driver").
ERROR_FLAGS = {
    0: ("motor_error", "motor"),
    1: ("encoder_error", "encoder"),
    2: ("controller_error", "controller"),
    3: ("system_error", "system"),
    4: ("driver_error", "axis"),
}
ALIVE_IN_CLOSED_LOOP = ("position_feedback", "velocity_feedback")
OTHER_FLAGS = 0xFFE0  # reserved bits, and the upper byte that is always 0


def named(name: str) -> Register:
    """Return a register by its name.

    Raises:
        ArgumentError: no register has this name.
    """
    if name not in BY_NAME:
        raise ArgumentError(f"Modbus has no register {name!r}", remedy=f"there are {', '.join(BY_NAME)}")
    return BY_NAME[name]
