"""Translates each CAN Simple command for a serial line: registers and values, in the order of writing."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum

from axisbus.drives.gim6010.can_simple.codec import DecodedMessage
from axisbus.drives.gim6010.can_simple.fields import Number
from axisbus.drives.gim6010.can_simple.states import CLOSED_LOOP, IDLE
from axisbus.drives.gim6010.modbus.motion.driver import BRAKE

Writes = tuple[tuple[str, Number], ...]
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
}
_FED_FORWARD = ("Vel_FF", "Torque_FF")
_ACTS = {"Estop": "emergency_stop", "Clear_Errors": "clear_errors"}


class RegisterCommandKind(Enum):
    """Execution of a command; stops come before all others, and cancel waiting commands."""

    STOP = "written at once, whether it is answered or not"
    MODES = "written in idle only, and read back"
    VALUES = "written and read back"
    ACT = "written once more if no answer came"
    POWER = "written once, in idle only"


@dataclass(frozen=True, slots=True)
class RegisterCommand:
    """One command: its registers with their values."""

    kind: RegisterCommandKind
    writes: Writes


def order(told: DecodedMessage) -> RegisterCommand | None:
    """Return the register command for a message to a module; None if the relay does not support the message."""
    name, values = told.message.name, told.values
    if name == "Set_Controller_Mode":
        return _modes(int(values["Control_Mode"]), int(values["Input_Mode"]))
    if name == "Set_Axis_State":
        return _state(int(values["Axis_Requested_State"]))
    if name in _ACTS:
        kind = RegisterCommandKind.STOP if name == "Estop" else RegisterCommandKind.ACT
        return RegisterCommand(kind, ((_ACTS[name], 1),))
    if name not in _VALUES or any(values.get(each) for each in _FED_FORWARD):
        return None
    return RegisterCommand(
        RegisterCommandKind.VALUES, tuple((register, values[field]) for register, field in _VALUES[name])
    )


def _modes(control: int, inputs: int) -> RegisterCommand:
    if (control, inputs) == _BRAKED:
        return RegisterCommand(RegisterCommandKind.STOP, BRAKE)
    return RegisterCommand(RegisterCommandKind.MODES, (("control_mode", control), ("input_mode", inputs)))


def _state(state: int) -> RegisterCommand | None:
    """Return the command for idle or closed loop; None for all other states, which could move the motor."""
    kinds = {IDLE: RegisterCommandKind.STOP, CLOSED_LOOP: RegisterCommandKind.POWER}
    return RegisterCommand(kinds[state], (("state_control", state),)) if state in kinds else None
