"""The messages of CAN Simple as one table (manual v2.2, 4.1.2), from which they are encoded, decoded and documented."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from axisbus.drives.gim6010.can_simple.fields import (
    BIT,
    BYTES4,
    FLOAT32,
    INT16,
    INT32,
    MIT8,
    MIT12,
    MIT16,
    UINT8,
    UINT16,
    UINT32,
    UINT64,
    FieldType,
    GearSide,
    MessageField,
)
from axisbus.drives.gim6010.can_simple.identifier import NODES
from axisbus.drives.gim6010.can_simple.states import REQUESTED_STATES
from axisbus.errors import ArgumentError

LENGTH = 8  # bytes of every data frame sent (4.1.1)


class Direction(Enum):
    """Sender of a message."""

    TO_MODULE = "to the module"
    FROM_MODULE = "from the module"
    BOTH = "both ways"


class MessageRequestMethod(Enum):
    """How a master requests a message."""

    NEVER = ""  # it never sends it, or only unasked
    EMPTY = "by a remote frame, or by eight bytes of 0"
    WITH_DATA = "by a data frame that names the requested value"


class Effect(Enum):
    """Side effect of a message that a user must know beforehand."""

    NONE = ""
    STOPS = "stops the axis"
    TURNS = "may turn the motor without a set-point"
    REBOOTS = "restarts the module"
    SHIFTS_ZERO = "shifts the position"
    MOVES_IDENTIFIER = "changes the identifiers that the module answers to"


class MessageSupport(Enum):
    """Whether owners report that a module accepts or answers the message over CAN."""

    YES = "owners saw it work"
    NO_REPORT = "not reported by owners"
    SILENT = "owners got no answer"
    OTHERWISE = "owners' reports contradict the manual"


@dataclass(frozen=True, slots=True, repr=False)
class Message:
    """One message: the fields that the master sends, those that the module sends, and its meaning.

    ``shortest`` is the minimum number of data bytes of an answer, if it may omit fields.
    """

    command: int
    name: str
    meaning: str
    sent: tuple[MessageField, ...] = ()
    answer: tuple[MessageField, ...] = ()
    asked: MessageRequestMethod = MessageRequestMethod.NEVER
    effect: Effect = Effect.NONE
    heard: MessageSupport = MessageSupport.NO_REPORT
    shortest: int = 0

    def __repr__(self) -> str:
        return f"<{self.command:02X}h {self.name}>"

    @property
    def direction(self) -> Direction:
        """Direction of its data; a request without data does not count."""
        if not self.answer:
            return Direction.TO_MODULE
        return Direction.BOTH if self.sent else Direction.FROM_MODULE

    @property
    def answer_bytes(self) -> int:
        """Minimum number of data bytes of an answer."""
        return self.shortest or max(((each.end + 7) // 8 for each in self.answer), default=0)

    @property
    def sent_bytes(self) -> int:
        """Number of data bytes of the master's fields; all sent frames have ``LENGTH``."""
        return max(((each.end + 7) // 8 for each in self.sent), default=0)


_ROTOR, _OUTPUT = GearSide.ROTOR, GearSide.OUTPUT
_FLAGS = 5 * 8

# The newest layout; ``heartbeat`` has those of other firmware.
HEARTBEAT_FIELDS = (
    MessageField("Axis_Error", UINT32, path="axis0.error"),
    MessageField("Axis_State", UINT8, 4 * 8, path="axis0.current_state"),
    MessageField("Motor_Fault", BIT, _FLAGS, path="axis0.motor.error"),
    MessageField("Encoder_Fault", BIT, _FLAGS + 1, path="axis0.encoder.error"),
    MessageField("Controller_Fault", BIT, _FLAGS + 2, path="axis0.controller.error"),
    MessageField("System_Fault", BIT, _FLAGS + 3, path="error"),
    MessageField("Traj_Done", BIT, _FLAGS + 7, path="axis0.controller.trajectory_done"),
    MessageField("Life", UINT8, 7 * 8),
)
ERROR_TYPES = {0: "motor", 1: "encoder", 3: "controller", 4: "system"}
CONTROL_MODES = {0: "voltage", 1: "torque", 2: "velocity", 3: "position"}
INPUT_MODES = {
    0: "inactive",
    1: "direct",
    2: "velocity ramp",
    3: "position filter",
    5: "trapezoidal trajectory",
    6: "torque ramp",
    9: "motion control (MIT)",
}
OPCODES = {0: "read", 1: "write"}
HIGHEST_CURRENT = 50.0  # A (3.1.3)
_COUNTS = 16384  # per turn of the rotor


def _float(
    name: str, byte: int, unit: str, path: str, side: GearSide = _ROTOR, *, low: float = -math.inf
) -> MessageField:
    return MessageField(name, FLOAT32, 8 * byte, unit, side=side, low=low, path=path)


def _positive(name: str, byte: int, unit: str, path: str) -> MessageField:
    return _float(name, byte, unit, path, low=0.0)


def _mit(name: str, kind: FieldType, start: int, unit: str, side: GearSide = _OUTPUT) -> MessageField:
    """Return a field whose value is a number of steps over a range; the range is a setting, which ``mit`` knows."""
    return MessageField(name, kind, start, f"steps of {unit}" if unit else "", side=side)


_ENDPOINT_FIELDS = (
    MessageField("opcode", UINT8, values=OPCODES),
    MessageField("Endpoint_ID", UINT16, 8),
    MessageField("Value", BYTES4, 4 * 8),
)
_CONFIG = "axis0.controller.config"
_TRAJECTORY = "axis0.traj_traj.config"  # as the manual writes it

MESSAGES = (
    Message(
        0x01,
        "Heartbeat",
        "state and faults, sent without a request",
        answer=HEARTBEAT_FIELDS,
        heard=MessageSupport.YES,
    ),
    Message(
        0x02,
        "Estop",
        "emergency stop; the axis then reports ESTOP_REQUESTED, which latches",
        effect=Effect.STOPS,
    ),
    Message(
        0x03,
        "Get_Error",
        "one error word; the answer does not say which, so one word is requested at a time",
        (MessageField("Error_Type", UINT8, values=ERROR_TYPES),),
        (MessageField("Error", UINT64),),
        MessageRequestMethod.WITH_DATA,
        heard=MessageSupport.SILENT,
        shortest=4,
    ),
    Message(
        0x04,
        "RxSdo",
        "reads or writes a parameter by its endpoint",
        _ENDPOINT_FIELDS,
        _ENDPOINT_FIELDS,
        MessageRequestMethod.WITH_DATA,
        heard=MessageSupport.SILENT,
    ),
    Message(
        0x05,
        "TxSdo",
        "as RxSdo when it writes; answers may come here too",
        _ENDPOINT_FIELDS,
        _ENDPOINT_FIELDS,
        MessageRequestMethod.WITH_DATA,
        heard=MessageSupport.SILENT,
    ),
    Message(
        0x06,
        "Set_Axis_Node_ID",
        "sets the node ID",
        (
            MessageField(
                "Axis_Node_ID", UINT32, low=NODES.start, high=NODES.stop - 1, path="axis0.config.can.node_id"
            ),
        ),
        effect=Effect.MOVES_IDENTIFIER,
    ),
    Message(
        0x07,
        "Set_Axis_State",
        "requests a state of the axis: 8 enables, 1 takes the power off, 3, 4 and 7 calibrate",
        (
            MessageField(
                "Axis_Requested_State", UINT32, values=REQUESTED_STATES, path="axis0.requested_state"
            ),
        ),
        effect=Effect.TURNS,
        heard=MessageSupport.YES,
    ),
    Message(
        0x08,
        "Mit_Control",
        "position, velocity, gains and torque at once",
        (
            _mit("Position", MIT16, 0, "rad"),
            _mit("Velocity", MIT12, 16, "rad/s"),
            _mit("KP", MIT12, 28, "N·m per turn", _ROTOR),
            _mit("KD", MIT12, 40, "N·m per turn/s", _ROTOR),
            _mit("Torque", MIT12, 52, "N·m"),
        ),
        (
            _mit("Node_ID", MIT8, 0, "", GearSide.NONE),
            _mit("Position", MIT16, 8, "rad"),
            _mit("Velocity", MIT12, 24, "rad/s"),
            _mit("Torque", MIT12, 36, "N·m"),
        ),
        MessageRequestMethod.WITH_DATA,
    ),
    Message(
        0x09,
        "Get_Encoder_Estimates",
        "position and velocity; invalid until closed loop",
        answer=(
            _float("Pos_Estimate", 0, "turns", "axis0.encoder.pos_estimate"),
            _float("Vel_Estimate", 4, "turns/s", "axis0.encoder.vel_estimate"),
        ),
        asked=MessageRequestMethod.EMPTY,
        heard=MessageSupport.YES,
    ),
    Message(
        0x0A,
        "Get_Encoder_Count",
        "the encoder's counts; also valid in idle",
        answer=(
            MessageField(
                "Shadow_Count", INT32, unit="counts", side=_ROTOR, path="axis0.encoder.shadow_count"
            ),
            MessageField("Count_In_Cpr", INT32, 32, "counts", side=_ROTOR, path="axis0.encoder.count_in_cpr"),
        ),
        asked=MessageRequestMethod.EMPTY,
        heard=MessageSupport.YES,
    ),
    Message(
        0x0B,
        "Set_Controller_Mode",
        "control mode (the controlled quantity) and input mode (how the module approaches a set-point)",
        (
            MessageField("Control_Mode", UINT32, values=CONTROL_MODES, path=f"{_CONFIG}.control_mode"),
            MessageField("Input_Mode", UINT32, 32, values=INPUT_MODES, path=f"{_CONFIG}.input_mode"),
        ),
        heard=MessageSupport.YES,
    ),
    Message(
        0x0C,
        "Set_Input_Pos",
        "target position, with feed-forward of velocity and torque",
        (
            _float("Input_Pos", 0, "turns", "axis0.controller.input_pos"),
            MessageField("Vel_FF", INT16, 32, "turns/s", 1000, _ROTOR, path="axis0.controller.input_vel"),
            MessageField("Torque_FF", INT16, 48, "N·m", 1000, _ROTOR, path="axis0.controller.input_torque"),
        ),
        heard=MessageSupport.YES,
    ),
    Message(
        0x0D,
        "Set_Input_Vel",
        "target velocity, with feed-forward of torque",
        (
            _float("Input_Vel", 0, "turns/s", "axis0.controller.input_vel"),
            _float("Torque_FF", 4, "N·m", "axis0.controller.input_torque"),
        ),
        heard=MessageSupport.YES,
    ),
    Message(
        0x0E,
        "Set_Input_Torque",
        "target torque",
        (_float("Input_Torque", 0, "N·m", "axis0.controller.input_torque"),),
    ),
    Message(
        0x0F,
        "Set_Limits",
        "limits of velocity and motor current",
        (
            _positive("Velocity_Limit", 0, "turns/s", f"{_CONFIG}.vel_limit"),
            MessageField(
                "Current_Limit",
                FLOAT32,
                32,
                "A",
                low=0.0,
                high=HIGHEST_CURRENT,
                path="axis0.motor.config.current_lim",
            ),
        ),
        heard=MessageSupport.YES,
    ),
    Message(0x10, "Start_Anticogging", "measures the torque ripple", effect=Effect.TURNS),
    Message(
        0x11,
        "Set_Traj_Vel_Limit",
        "velocity of trapezoidal trajectories",
        (_positive("Traj_Vel_Limit", 0, "turns/s", f"{_TRAJECTORY}.vel_limit"),),
    ),
    Message(
        0x12,
        "Set_Traj_Accel_Limits",
        "acceleration and deceleration of trapezoidal trajectories",
        (
            _positive("Traj_Accel_Limit", 0, "turns/s²", f"{_TRAJECTORY}.accel_limit"),
            _positive("Traj_Decel_Limit", 4, "turns/s²", f"{_TRAJECTORY}.decel_limit"),
        ),
    ),
    Message(
        0x13,
        "Set_Traj_Inertia",
        "inertia, for the feed-forward of torque",
        (_positive("Traj_Inertia", 0, "N·m per turn/s²", f"{_CONFIG}.inertia"),),
    ),
    Message(
        0x14,
        "Get_Iq",
        "torque-producing current, demanded and measured",
        answer=(
            _float("Iq_Setpoint", 0, "A", "axis0.motor.current_control.Idq_setpoint", GearSide.NONE),
            _float("Iq_Measured", 4, "A", "axis0.motor.current_control.Iq_measured", GearSide.NONE),
        ),
        asked=MessageRequestMethod.EMPTY,
        heard=MessageSupport.YES,
    ),
    Message(0x16, "Reboot", "reboot", effect=Effect.REBOOTS),
    Message(
        0x17,
        "Get_Bus_Voltage_Current",
        "supply voltage and current",
        answer=(
            _float("Bus_Voltage", 0, "V", "vbus_voltage", GearSide.NONE),
            _float("Bus_Current", 4, "A", "ibus", GearSide.NONE),
        ),
        asked=MessageRequestMethod.EMPTY,
        heard=MessageSupport.YES,
    ),
    Message(0x18, "Clear_Errors", "clears all errors", heard=MessageSupport.YES),
    Message(
        0x19,
        "Set_Linear_Count",
        "sets the encoder's position, in counts",
        (
            MessageField(
                "Linear_Count",
                INT32,
                unit="counts",
                side=_ROTOR,
                low=1 - _COUNTS,
                high=_COUNTS - 1,
                path="axis0.encoder.set_linear_count",
            ),
        ),
        effect=Effect.SHIFTS_ZERO,
    ),
    Message(
        0x1A,
        "Set_Pos_Gain",
        "proportional gain of the position loop",
        (_positive("Pos_Gain", 0, "(turns/s)/turn", f"{_CONFIG}.pos_gain"),),
        heard=MessageSupport.YES,
    ),
    Message(
        0x1B,
        "Set_Vel_Gains",
        "proportional and integral gain of the velocity loop",
        (
            _positive("Vel_Gain", 0, "N·m per turn/s", f"{_CONFIG}.vel_gain"),
            _positive("Vel_Integrator_Gain", 4, "N·m per turn", f"{_CONFIG}.vel_integrator_gain"),
        ),
        heard=MessageSupport.YES,
    ),
    Message(
        0x1C,
        "Get_Torques",
        "torque, demanded and actual",
        answer=(
            _float("Torque_Setpoint", 0, "N·m", "axis0.controller.torque_setpoint"),
            _float("Torque", 4, "N·m", ""),
        ),
        asked=MessageRequestMethod.EMPTY,
    ),
    Message(
        0x1D,
        "Get_Powers",
        "electrical and mechanical power",
        answer=(
            _float("Electrical_Power", 0, "W", "axis0.controller.electrical_power", GearSide.NONE),
            _float("Mechanical_Power", 4, "W", "axis0.controller.mechanical_power", GearSide.NONE),
        ),
        asked=MessageRequestMethod.EMPTY,
    ),
    Message(
        0x1E,
        "Disable_Can",
        "switches CAN off; afterwards the module is reachable over USB only",
        effect=Effect.REBOOTS,
    ),
    Message(0x1F, "Save_Configuration", "copies the configuration from RAM to flash", effect=Effect.REBOOTS),
)

BY_COMMAND = {each.command: each for each in MESSAGES}
BY_NAME = {each.name: each for each in MESSAGES}


def named(name: str) -> Message:
    """Return a message by its name in the manual.

    Raises:
        ArgumentError: no message has this name.
    """
    if name not in BY_NAME:
        raise ArgumentError(f"CAN Simple has no message {name!r}", remedy=f"there are {', '.join(BY_NAME)}")
    return BY_NAME[name]
