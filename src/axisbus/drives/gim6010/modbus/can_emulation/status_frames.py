"""Converts register values of a module on a serial line into the CAN frames that it would send on a bus."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.drives.gim6010.can_simple.codec import pack_places
from axisbus.drives.gim6010.can_simple.fields import Number
from axisbus.drives.gim6010.can_simple.heartbeat import COMMAND
from axisbus.drives.gim6010.can_simple.identifier import can_id
from axisbus.drives.gim6010.can_simple.messages import HEARTBEAT_FIELDS, named
from axisbus.drives.gim6010.modbus.registers import ERROR_FLAGS, OTHER_FLAGS

Told = tuple[int, bytes]
FIRST_LIFE = 0x10  # a life counter from here on cannot be mistaken for the flags of older firmware
_FAULTS = {"motor": "Motor_Fault", "encoder": "Encoder_Fault", "controller": "Controller_Fault"}


def heartbeat(node: int, state: int, flags: int, axis_error: int, life: int) -> Told:
    """Return a heartbeat in the newest firmware's layout; flags that the manual reserves count as a system fault."""
    parts = {category for bit, (_, category) in ERROR_FLAGS.items() if flags >> bit & 1}
    system = "system" in parts or bool(flags & OTHER_FLAGS)
    # the axis's flag is a fault even if its word is 0
    system = system or ("axis" in parts and not axis_error)
    values: dict[str, Number] = {
        "Axis_Error": axis_error,
        "Axis_State": state & 0xFF,
        "System_Fault": int(system),
        "Traj_Done": 0,
        "Life": life,
        **{field: int(part in parts) for part, field in _FAULTS.items()},
    }
    return can_id(node, COMMAND), pack_places(each.place(values[each.name]) for each in HEARTBEAT_FIELDS)


def message(node: int, name: str, values: Mapping[str, Number]) -> Told:
    """Return a module's message with all of its fields."""
    found = named(name)
    return can_id(node, found.command), pack_places(each.place(values[each.name]) for each in found.answer)


def error_word(node: int, word: int) -> Told:
    """Return the answer to Get_Error."""
    return can_id(node, named("Get_Error").command), word.to_bytes(8, "little")
