"""The values of variables that represent states: numbers and names of OPC 40400-2 if it defines them, else of axisbus."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.cell.model import AxisConfig
from axisbus.cia402.modes import ModeOfOperation
from axisbus.motion.states import AxisState
from axisbus.units import LENGTHS, TURNS

States = Mapping[int, str]

# OPC 40400-2 10.10, PtHomingStateVariableType.
HOMING_STATES: States = {0: "NOT_REFERENCED", 1: "REFERENCED"}
# The words and their order are those of OPC 30145 9.1, AxisTypeVariableType.
LINEAR, ROTATORY, ROTATORY_MODULO = 0, 1, 2
AXIS_TYPES: States = {LINEAR: "LINEAR", ROTATORY: "ROTATORY", ROTATORY_MODULO: "ROTATORY_MODULO"}
# PLCopen's states, numbered in the order of ``AxisState``.
AXIS_STATES: States = {number: state.value for number, state in enumerate(AxisState)}
# The modes of CiA 402 by their value of 6061h, and one number for all manufacturer-specific modes.
MAKERS_OWN = 255
CONTROL_MODES: States = {
    **{int(mode): mode.text for mode in ModeOfOperation},
    MAKERS_OWN: "a manufacturer-specific mode",
}

_AXIS_STATE_NUMBERS = {state: number for number, state in enumerate(AxisState)}


def axis_state(state: AxisState) -> int:
    """Return the number of a PLCopen state."""
    return _AXIS_STATE_NUMBERS[state]


def control_mode(mode: int) -> int:
    """Return the number of a mode of operation (6061h)."""
    return mode if mode in CONTROL_MODES else MAKERS_OWN


def homing_state(homed: bool) -> int:
    """Return the number for whether the position is confirmed by homing."""
    return int(homed)


def axis_type(axis: AxisConfig) -> int | None:
    """Return the kind of axis by the unit in its cell file; None if the unit does not define it, such as increments."""
    if axis.unit in TURNS:
        return ROTATORY if axis.modulo is None else ROTATORY_MODULO
    return LINEAR if axis.unit in LENGTHS and axis.modulo is None else None
