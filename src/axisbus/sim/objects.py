"""Connects the objects of one axis with the values of its drive."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Protocol

from axisbus.sim.axis import Axis
from axisbus.sim.control_bits import as_int8, as_int16, as_int32
from axisbus.sim.dictionary import Dictionary
from axisbus.sim.settings import AXIS_SPAN, object_key
from axisbus.sim.touch_probe import FALLING, RISING, TouchProbe


class Drive(Protocol):
    """The members of a drive that its objects read, write and call."""

    axis: Axis
    touch_probe: TouchProbe
    axis_number: int
    dictionary: Dictionary
    modes: frozenset[int]
    controlword: int
    mode: int
    target_position: int
    target_velocity: int
    target_torque: int
    statusword: int
    mode_display: int
    position: int
    position_demand: int
    velocity: int
    torque: int
    error_code: int
    maker_bits: int

    def evaluate_controlword(self) -> None:
        """Evaluate the controlword now."""

    def write_mode(self, mode: int) -> None:
        """Process a write to 6060h."""

    def check_mode(self, value: int) -> None:
        """Reject a mode that the drive does not have."""


# Read-only objects: index to value. An object that the file does not contain is omitted.
SHOWN: dict[int, Callable[[Drive], int]] = {
    0x603F: lambda drive: drive.error_code,
    0x6041: lambda drive: drive.statusword,
    0x6061: lambda drive: drive.mode_display,
    0x6062: lambda drive: drive.position_demand,
    0x6063: lambda drive: drive.position,
    0x6064: lambda drive: drive.position,
    0x6069: lambda drive: drive.velocity,
    0x606B: lambda drive: drive.axis.user_velocity(drive.axis.velocity),
    0x606C: lambda drive: drive.velocity,
    0x6074: lambda drive: round(drive.axis.torque_demand),
    0x6077: lambda drive: drive.torque,
    0x6078: lambda drive: drive.torque,
    0x60B9: lambda drive: drive.touch_probe.status,
    0x60BA: lambda drive: drive.touch_probe.positions[1, RISING],
    0x60BB: lambda drive: drive.touch_probe.positions[1, FALLING],
    0x60BC: lambda drive: drive.touch_probe.positions[2, RISING],
    0x60BD: lambda drive: drive.touch_probe.positions[2, FALLING],
    0x60D5: lambda drive: drive.touch_probe.counts[1, RISING],
    0x60D6: lambda drive: drive.touch_probe.counts[1, FALLING],
    0x60D7: lambda drive: drive.touch_probe.counts[2, RISING],
    0x60D8: lambda drive: drive.touch_probe.counts[2, FALLING],
    0x60F4: lambda drive: round(drive.axis.position - drive.axis.motor.position),
    0x60FC: lambda drive: drive.position_demand,
    0x60FD: lambda drive: drive.axis.digital_inputs,
}
# The manufacturer's error bits, of the first axis only: low and high 32 bits.
MAKER_SHOWN: dict[int, Callable[[Drive], int]] = {
    0x203F: lambda drive: drive.maker_bits & 0xFFFF_FFFF,
    0x203E: lambda drive: drive.maker_bits >> 32,
}


def _controlword(drive: Drive, value: int) -> None:
    if value & 0xFFFF != drive.controlword:
        drive.controlword = value & 0xFFFF
        drive.evaluate_controlword()


def _mode(drive: Drive, value: int) -> None:
    drive.write_mode(as_int8(value))


def _target_position(drive: Drive, value: int) -> None:
    drive.target_position = as_int32(value)


def _target_velocity(drive: Drive, value: int) -> None:
    drive.target_velocity = as_int32(value)


def _target_torque(drive: Drive, value: int) -> None:
    drive.target_torque = as_int16(value)


def _probe_function(drive: Drive, value: int) -> None:
    drive.touch_probe.take(value & 0xFFFF)


# Objects that the master writes: index to (value, write function). Signed as in the standard, regardless of the file.
TAKEN: dict[int, tuple[Callable[[Drive], int], Callable[[Drive, int], None]]] = {
    0x6040: (lambda drive: drive.controlword, _controlword),
    0x6060: (lambda drive: drive.mode, _mode),
    0x607A: (lambda drive: drive.target_position, _target_position),
    0x60FF: (lambda drive: drive.target_velocity, _target_velocity),
    0x6071: (lambda drive: drive.target_torque, _target_torque),
    0x60B8: (lambda drive: drive.touch_probe.function, _probe_function),
}


def connect(drive: Drive) -> None:
    """Connect the axis's values with its node's dictionary."""
    dictionary = drive.dictionary
    offset = drive.axis_number * AXIS_SPAN
    for index, value in SHOWN.items():
        _show(drive, index + offset, value)
    if drive.axis_number == 0:
        for index, value in MAKER_SHOWN.items():
            _show(drive, index, value)
    for index, (shown, take) in TAKEN.items():
        key = object_key(dictionary, index + offset)
        if index != 0x6040:
            take(drive, dictionary.get_int(key >> 8, key & 0xFF))
        dictionary.on_write(key, partial(take, drive))
        _show(drive, index + offset, shown)
    dictionary.check_write((0x6060 + offset) << 8, lambda value: drive.check_mode(as_int8(value)))
    modes = sum(1 << mode - 1 for mode in drive.modes)
    dictionary.give_default(0x6502 + offset, 0, modes)


def _show(drive: Drive, index: int, value: Callable[[Drive], int]) -> None:
    if drive.dictionary.has(index):
        drive.dictionary.live[object_key(drive.dictionary, index)] = lambda: value(drive)
