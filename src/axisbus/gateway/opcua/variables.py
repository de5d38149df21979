"""The variables of an axis: the names of OPC 40400-2 8.2 (IDriveAxis, IServoDriveAxis), and the source of each."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum

from axisbus.cell.model import AxisConfig
from axisbus.cia402.modes import ModeOfOperation
from axisbus.gateway import values
from axisbus.motion.parameters import Units
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import AxisState
from axisbus.units import LENGTHS, TURNS

Number = float | int

# -- The values of variables that represent states: numbers and names of OPC 40400-2 if it defines them, else of axisbus ---

States = Mapping[int, str]

# OPC 40400-2 10.10, PtHomingStateVariableType.
HOMING_STATES: States = {0: "NOT_REFERENCED", 1: "REFERENCED"}
# The words and their order are those of OPC 30145 9.1, AxisTypeVariableType.
LINEAR, ROTATORY, ROTATORY_MODULO = 0, 1, 2
AXIS_TYPES: States = {LINEAR: "LINEAR", ROTATORY: "ROTATORY", ROTATORY_MODULO: "ROTATORY_MODULO"}
# PLCopen's states, numbered in the order of ``AxisState``.
AXIS_STATES: States = {number: state.value for number, state in enumerate(AxisState)}
# The modes of CiA 402 by their value of 6061h, and one number for all manufacturer-specific modes.
MANUFACTURER_SPECIFIC = 255
CONTROL_MODES: States = {
    **{int(mode): mode.text for mode in ModeOfOperation},
    MANUFACTURER_SPECIFIC: "a manufacturer-specific mode",
}

_AXIS_STATE_NUMBERS = {state: number for number, state in enumerate(AxisState)}


def axis_state(state: AxisState) -> int:
    """Return the number of a PLCopen state."""
    return _AXIS_STATE_NUMBERS[state]


def control_mode(mode: int) -> int:
    """Return the number of a mode of operation (6061h)."""
    return mode if mode in CONTROL_MODES else MANUFACTURER_SPECIFIC


def homing_state(homed: bool) -> int:
    """Return the number for whether the position is confirmed by homing."""
    return int(homed)


def axis_type(axis: AxisConfig) -> int | None:
    """Return the kind of axis by the unit in its cell file; None if the unit does not define it, such as increments."""
    if axis.unit in TURNS:
        return ROTATORY if axis.modulo is None else ROTATORY_MODULO
    return LINEAR if axis.unit in LENGTHS and axis.modulo is None else None


# -- The units of an axis for OPC UA: UNECE's common codes (Recommendation 20), and the numbers derived from them ------

NAMESPACE = "http://www.opcfoundation.org/UA/units/un/cefact"
_UNKNOWN = -1  # OPC 10000-8 5.6.4.3: a unit without a number


@dataclass(frozen=True, slots=True)
class Unit:
    """A unit: its common code ("" if no UNECE code is known), its symbol, and its name."""

    code: str
    symbol: str
    name: str

    @property
    def number(self) -> int:
        """The unitId of OPC 10000-8 5.6.4.3: the characters of the code, eight bits each; -1 without a code."""
        return int.from_bytes(self.code.encode("ascii"), "big") if self.code else _UNKNOWN


_DEGREE = ("DD", "degree"), ("E96", "degree per second")
_TURN = ("M44", "revolution"), ("RPS", "revolutions per second")
_MICRO = ("4H", "micrometre"), ("", "micrometre per second")
_INCH = ("INH", "inch"), ("IU", "inch per second")
# By the word of the cell file: code and name of the unit, and of the unit per second.
_POSITIONS: Mapping[str, tuple[tuple[str, str], tuple[str, str]]] = {
    "deg": _DEGREE,
    "degree": _DEGREE,
    "degrees": _DEGREE,
    "°": _DEGREE,
    "arcmin": (("D61", "minute of angle"), ("", "minute of angle per second")),
    "arcsec": (("D62", "second of angle"), ("", "second of angle per second")),
    "rad": (("C81", "radian"), ("2A", "radian per second")),
    "mrad": (("C25", "milliradian"), ("", "milliradian per second")),
    "rev": _TURN,
    "turn": _TURN,
    "turns": _TURN,
    "m": (("MTR", "metre"), ("MTS", "metre per second")),
    "dm": (("DMT", "decimetre"), ("", "decimetre per second")),
    "cm": (("CMT", "centimetre"), ("2M", "centimetre per second")),
    "mm": (("MMT", "millimetre"), ("C16", "millimetre per second")),
    "um": _MICRO,
    "\u00b5m": _MICRO,
    "\u03bcm": _MICRO,
    "nm": (("C45", "nanometre"), ("", "nanometre per second")),
    "in": _INCH,
    "inch": _INCH,
    "mil": (("77", "milli-inch"), ("", "milli-inch per second")),
    "ft": (("FOT", "foot"), ("FS", "foot per second")),
    "%": (("P1", "percent"), ("", "percent per second")),
    "l": (("LTR", "litre"), ("", "litre per second")),
    "ml": (("MLT", "millilitre"), ("", "millilitre per second")),
}
CELSIUS = Unit("CEL", "°C", "degree Celsius")
TORQUE = Unit("NU", "N·m", "newton metre")
PART_OF_RATED = Unit("C62", "", "part of the rated torque")


def position_unit(unit: str) -> Unit:
    """Return the unit of positions for the ``unit`` of a cell file; a unit without UNECE code keeps its name."""
    found = _POSITIONS.get(unit)
    return Unit("", unit, unit) if found is None else Unit(found[0][0], unit, found[0][1])


def velocity_unit(unit: str) -> Unit:
    """Return the unit of its velocities."""
    found, symbol = _POSITIONS.get(unit), f"{unit}/s"
    return Unit("", symbol, f"{unit} per second") if found is None else Unit(found[1][0], symbol, found[1][1])


def torque_unit(rated_torque: float | None) -> Unit:
    """Return the unit of torques: N·m if the cell file has the rated torque, else fractions of it."""
    return PART_OF_RATED if rated_torque is None else TORQUE


# -- The variables -----------------------------------------------------------------------------------------------------


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
    return None if snapshot.mode is None else control_mode(snapshot.mode)


AXIS_TYPE, MOTOR_TEMPERATURE = "AxisType", "MotorTemperature"
ROWS = (
    OpcuaVariable(
        "ControlMode",
        Type.UINT16,
        "Mode of operation (6061h).",
        _mode,
        "mode",
        states=CONTROL_MODES,
    ),
    OpcuaVariable(
        "AxisState",
        Type.UINT16,
        "PLCopen's state.",
        lambda snapshot, _: axis_state(snapshot.state),
        states=AXIS_STATES,
    ),
    OpcuaVariable(
        "HomingState",
        Type.UINT16,
        "Whether the position is confirmed (homed).",
        lambda snapshot, _: homing_state(snapshot.homed),
        states=HOMING_STATES,
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
