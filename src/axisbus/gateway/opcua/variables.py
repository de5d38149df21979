"""The variables of an axis: the names of OPC 40400-2 8.2 (IDriveAxis, IServoDriveAxis), and the source of each."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum

from axisbus.cell.model import AxisConfig
from axisbus.gateway import values
from axisbus.gateway.opcua import states
from axisbus.gateway.opcua.states import States
from axisbus.gateway.opcua.status_code import Number
from axisbus.gateway.opcua.units import CELSIUS, Unit, position_unit, torque_unit, velocity_unit
from axisbus.motion.parameters import Units
from axisbus.motion.snapshot import Snapshot


class Type(Enum):
    """The data type of a variable."""

    DOUBLE = "Double"
    FLOAT = "Float"
    UINT16 = "UInt16"


Value = Callable[[Snapshot, Units], Number | None]
Stamp = Callable[[Snapshot], float]


def _cycle(snapshot: Snapshot) -> float:
    """Return the time of the cycle in which the value was within its maximum age."""
    return snapshot.now


@dataclass(frozen=True, slots=True)
class OpcuaVariable:
    """A variable: ``value`` returns it from a process image, None if unknown; without ``value`` it is read by other means.

    ``source`` is the input that carries it (``Capabilities.inputs``); "" if the master itself knows it, even for a lost node.
    """

    name: str
    type: Type
    words: str
    value: Value | None = None
    source: str = ""
    unit: Callable[[AxisConfig], Unit] | None = None
    states: States | None = None
    stamp: Stamp = _cycle


def _mode(snapshot: Snapshot, _: Units) -> int | None:
    return None if snapshot.mode is None else states.control_mode(snapshot.mode)


AXIS_TYPE, MOTOR_TEMPERATURE = "AxisType", "MotorTemperature"
ROWS = (
    OpcuaVariable(
        "ControlMode",
        Type.UINT16,
        "Mode of operation (6061h).",
        _mode,
        "mode",
        states=states.CONTROL_MODES,
    ),
    OpcuaVariable(
        "AxisState",
        Type.UINT16,
        "PLCopen's state.",
        lambda snapshot, _: states.axis_state(snapshot.state),
        states=states.AXIS_STATES,
    ),
    OpcuaVariable(
        "HomingState",
        Type.UINT16,
        "Whether the position is confirmed (homed).",
        lambda snapshot, _: states.homing_state(snapshot.homed),
        states=states.HOMING_STATES,
    ),
    OpcuaVariable(
        "PositionActualValue",
        Type.DOUBLE,
        "Actual position (6064h).",
        values.position,
        "position",
        lambda axis: position_unit(axis.unit),
        stamp=lambda snapshot: snapshot.position_stamp,
    ),
    OpcuaVariable(
        "PositionFollowingError",
        Type.FLOAT,
        "Demand minus actual position (6062h minus 6064h).",
        values.following_error,
        "demand",
        lambda axis: position_unit(axis.unit),
    ),
    OpcuaVariable(
        "VelocityActualValue",
        Type.FLOAT,
        "Actual velocity (606Ch).",
        values.velocity,
        "velocity",
        lambda axis: velocity_unit(axis.unit),
    ),
    OpcuaVariable(
        "TorqueForceActualValue",
        Type.FLOAT,
        "Actual torque (6077h).",
        values.torque,
        "torque",
        lambda axis: torque_unit(axis.rated_torque),
    ),
    OpcuaVariable(
        MOTOR_TEMPERATURE,
        Type.FLOAT,
        "Temperature of the motor, read by SDO.",
        unit=lambda _: CELSIUS,
    ),
)
