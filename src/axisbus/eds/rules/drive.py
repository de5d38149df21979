"""The axes of a drive in a file, and the modes of operation of each axis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from axisbus.cia301.objects import DEVICE_TYPE
from axisbus.cia402 import modes
from axisbus.cia402 import objects as o
from axisbus.cia402.axes import COUNT, PROFILE_AREA, indices_of, offset
from axisbus.cia402.dictionary import StandardObject
from axisbus.cia402.modes import FACTS, ModeOfOperation
from axisbus.eds.rules import standard
from axisbus.eds.rules.context import RuleContext

_M = ModeOfOperation

# Objects that belong to one mode of operation, or to one and its cyclic counterpart: without any of them, the mode is not intended.
MODE_OBJECTS: Mapping[ModeOfOperation, tuple[int, ...]] = {
    _M.PROFILE_POSITION: (o.TARGET_POSITION, o.PROFILE_VELOCITY),
    _M.VELOCITY: (0x6042, 0x6043, 0x6044, 0x6046, 0x6048),
    _M.PROFILE_VELOCITY: (o.TARGET_VELOCITY, o.PROFILE_ACCELERATION, 0x606D, 0x606F, 0x60F8),
    _M.PROFILE_TORQUE: (o.TARGET_TORQUE, o.TORQUE_SLOPE),
    _M.HOMING: (o.HOMING_METHOD, o.HOMING_SPEEDS, o.HOMING_ACCELERATION),
    _M.INTERPOLATED_POSITION: (0x60C0, 0x60C1, 0x60C4),
    _M.CYCLIC_SYNC_POSITION: (o.TARGET_POSITION, o.INTERPOLATION_TIME_PERIOD, 0x60B0),
    _M.CYCLIC_SYNC_VELOCITY: (o.TARGET_VELOCITY, o.INTERPOLATION_TIME_PERIOD, 0x60B1),
    _M.CYCLIC_SYNC_TORQUE: (o.TARGET_TORQUE, o.INTERPOLATION_TIME_PERIOD, 0x60B2),
    _M.CYCLIC_SYNC_TORQUE_ANGLE: (0x60EA,),
}
# Objects that belong to only one mode, without a cyclic counterpart.
REQUIRED_OBJECTS: Mapping[ModeOfOperation, tuple[int, ...]] = {
    _M.PROFILE_POSITION: (o.PROFILE_VELOCITY,),
    _M.VELOCITY: (0x6042, 0x6043, 0x6044, 0x6046, 0x6048),
    _M.PROFILE_TORQUE: (o.TORQUE_SLOPE,),
    _M.HOMING: (o.HOMING_METHOD, o.HOMING_SPEEDS, o.HOMING_ACCELERATION),
    _M.INTERPOLATED_POSITION: (0x60C1,),
}
# Targets, each with the modes of which one must be complete.
TARGETS: Mapping[int, tuple[ModeOfOperation, ...]] = {
    o.TARGET_POSITION: (_M.PROFILE_POSITION, _M.CYCLIC_SYNC_POSITION),
    o.TARGET_VELOCITY: (_M.PROFILE_VELOCITY, _M.CYCLIC_SYNC_VELOCITY),
    o.TARGET_TORQUE: (_M.PROFILE_TORQUE, _M.CYCLIC_SYNC_TORQUE),
}
# Objects whose presence indicates a mode; the cyclic modes have none of their own.
SHOWING: Mapping[ModeOfOperation, tuple[int, ...]] = {
    mode: facts.required
    for mode, facts in FACTS.items()
    if not facts.cyclic or mode is _M.INTERPOLATED_POSITION
}


@dataclass(frozen=True, slots=True)
class EdsAxis:
    """One axis: its number from 1, and the offset of its indices from those of the first axis."""

    number: int

    @property
    def offset(self) -> int:
        """800h for each preceding axis."""
        return offset(self.number)

    def owns(self, index: int) -> bool:
        """Whether an object belongs to this axis."""
        return index in indices_of(self.number)


def axes(context: RuleContext) -> tuple[EdsAxis, ...]:
    """Return the axes that the file describes; none if the device is no drive."""
    found = tuple(axis for axis in map(EdsAxis, range(1, COUNT + 1)) if _is_axis(context, axis))
    return found or ((EdsAxis(1),) if declares_drive(context) else ())


def row(context: RuleContext, index: int, subindex: int) -> StandardObject | None:
    """Return the standard's row for an entry; rows of CiA 402 only if the file describes the axis of the entry."""
    if index < PROFILE_AREA.start or any(axis.owns(index) for axis in axes(context)):
        return standard.row(index, subindex)
    return None


def declares_drive(context: RuleContext) -> bool:
    """Whether the device type is that of a drive."""
    device_type = context.number(DEVICE_TYPE)
    return device_type is not None and device_type & 0xFFFF == o.PROFILE_NUMBER


def _is_axis(context: RuleContext, axis: EdsAxis) -> bool:
    """Whether the file has the objects that every drive has; other profiles use some of these indices."""
    there = [
        axis.offset + index in context.eds for index in (o.CONTROLWORD, o.STATUSWORD, o.MODES_OF_OPERATION)
    ]
    return all(there) or (declares_drive(context) and any(there))


def claimed(context: RuleContext, axis: EdsAxis) -> tuple[ModeOfOperation, ...] | None:
    """Return the modes that 6502h lists, None if the file gives it no value."""
    word = context.number(axis.offset + o.SUPPORTED_DRIVE_MODES)
    return None if word is None else tuple(modes.supported(word))


def shown(context: RuleContext, axis: EdsAxis) -> tuple[ModeOfOperation, ...]:
    """Return the modes (without the cyclic ones) of which all mandatory objects are described."""
    return tuple(
        mode
        for mode, needed in SHOWING.items()
        if all(axis.offset + index in context.eds for index in needed)
    )


def missing(context: RuleContext, axis: EdsAxis, mode: ModeOfOperation) -> tuple[int, ...]:
    """Return the mandatory objects of a mode (indices on the first axis) that the file does not describe."""
    return tuple(index for index in FACTS[mode].required if axis.offset + index not in context.eds)


def meant(context: RuleContext, axis: EdsAxis, mode: ModeOfOperation) -> bool:
    """Whether at least one object that belongs to the mode is described."""
    return any(axis.offset + index in context.eds for index in MODE_OBJECTS[mode])
