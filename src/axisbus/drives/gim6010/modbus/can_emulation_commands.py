"""Translates each CAN Simple command for a serial line: registers and values, in the order of writing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from axisbus.drives.gim6010.calibration import CalibrationKind
from axisbus.drives.gim6010.can_simple.codec import DecodedMessage
from axisbus.drives.gim6010.can_simple.fields import Number
from axisbus.drives.gim6010.can_simple.messages import CLOSED_LOOP, IDLE

Writes = tuple[tuple[str, Number], ...]
# In this order, each write alone brakes or changes nothing; a torque set-point may be added to the output of the velocity loop.
BRAKE: Writes = (("velocity_setpoint", 0.0), ("control_mode", 2), ("input_mode", 2), ("torque_setpoint", 0.0))
_BRAKED = (2, 2)  # velocity control by ramp
# Each field of a message with its register; feed-forward values have none, and must be 0.
_VALUES: Mapping[str, tuple[tuple[str, str], ...]] = {
    "Set_Limits": (("velocity_limit", "Velocity_Limit"), ("current_limit", "Current_Limit")),
    "Set_Traj_Vel_Limit": (("trajectory_velocity", "Traj_Vel_Limit"),),
    "Set_Traj_Accel_Limits": (
        ("trajectory_acceleration", "Traj_Accel_Limit"),
        ("trajectory_deceleration", "Traj_Decel_Limit"),
    ),
    "Set_Input_Pos": (("position_setpoint", "Input_Pos"),),
    "Set_Input_Vel": (("velocity_setpoint", "Input_Vel"),),
    "Set_Input_Torque": (("torque_setpoint", "Input_Torque"),),
}
_STREAMED = ("Set_Input_Vel", "Set_Input_Torque")  # sent in every cycle of a ramp
_FED_FORWARD = ("Vel_FF", "Torque_FF")
_ACTS = {"Estop": "emergency_stop", "Clear_Errors": "clear_errors"}
_CALIBRATIONS = frozenset(kind.value for kind in CalibrationKind)


class RegisterCommandKind(Enum):
    """Execution of a command; stops come before all others, and cancel waiting commands."""

    STOP = "written at once, whether it is answered or not"
    MODES = "written in idle only, and read back"
    VALUES = "written and read back"
    SETPOINT = "as a value, in turn with the readings; a newer one replaces it"
    ACT = "written once more if no answer came"
    POWER = "written once, in idle only, after its modes were read back"
    CALIBRATION = "written once, in idle only"


@dataclass(frozen=True, slots=True)
class RegisterCommand:
    """One command: its registers with their values."""

    kind: RegisterCommandKind
    writes: Writes


def order(told: DecodedMessage, *, calibrates: bool = False) -> RegisterCommand | None:
    """Return the register command for a message to a module; None if the relay does not support the message.

    ``calibrates``: calibrations are supported too, which may turn the motor.
    """
    name, values = told.message.name, told.values
    if name == "Set_Controller_Mode":
        return _modes(int(values["Control_Mode"]), int(values["Input_Mode"]))
    if name == "Set_Axis_State":
        return _state(int(values["Axis_Requested_State"]), calibrates)
    if name in _ACTS:
        kind = RegisterCommandKind.STOP if name == "Estop" else RegisterCommandKind.ACT
        return RegisterCommand(kind, ((_ACTS[name], 1),))
    if name not in _VALUES or any(values.get(each) for each in _FED_FORWARD):
        return None
    kind = RegisterCommandKind.SETPOINT if name in _STREAMED else RegisterCommandKind.VALUES
    return RegisterCommand(kind, tuple((register, values[field]) for register, field in _VALUES[name]))


def _modes(control: int, inputs: int) -> RegisterCommand:
    if (control, inputs) == _BRAKED:
        return RegisterCommand(RegisterCommandKind.STOP, BRAKE)
    return RegisterCommand(RegisterCommandKind.MODES, (("control_mode", control), ("input_mode", inputs)))


def _state(state: int, calibrates: bool) -> RegisterCommand | None:
    """Return the command for idle, closed loop or a supported calibration; None for all other states, which may move it."""
    kinds = {IDLE: RegisterCommandKind.STOP, CLOSED_LOOP: RegisterCommandKind.POWER}
    if calibrates:
        kinds |= dict.fromkeys(_CALIBRATIONS, RegisterCommandKind.CALIBRATION)
    return RegisterCommand(kinds[state], (("state_control", state),)) if state in kinds else None
