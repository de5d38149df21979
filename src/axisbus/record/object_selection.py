"""The objects to record in addition to the axes, as users name them."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.cell.can_simple.modules import require_objects
from axisbus.cell.io_signals import all_points
from axisbus.cell.model import CellConfig
from axisbus.cia301.datatypes import DataType, Value
from axisbus.cia401.signal import IoPoint
from axisbus.cia402.axes import own_index
from axisbus.eds.dictionary import Dictionary
from axisbus.errors import ArgumentError, UnknownNameError
from axisbus.record.events import Watched


@dataclass(frozen=True, slots=True)
class WantedObject:
    """One object of a node; ``label`` is the name that the user gave, the index is the device's own.

    ``point``: the name of the input or output, if the object was requested as one.
    """

    label: str
    node: int
    index: int
    subindex: int
    name: str
    data_type: DataType | None
    point: IoPoint | None = None

    def json_type(self, *, carried: bool) -> str:
        """Return the JSON type of its values; ``carried``: by a PDO, whose untyped bits become a number.

        Bytes become hexadecimal digits.
        """
        if self.point is not None:
            return "number" if self.point.bit is None else "boolean"
        kind = self.data_type
        if kind is None:
            return "number" if carried else "string"
        return "number" if kind.integer or kind in (DataType.REAL32, DataType.REAL64) else "string"

    def means(self, value: Value | None) -> Value | None:
        """Return the meaning of a value of the object: for an input or output, True or False, or a number in its unit."""
        if self.point is None or not isinstance(value, int):
            return value
        return self.point.shown(self.point.of(value))


def wanted_object(machine: Watched, text: str) -> WantedObject:
    """Return the object for ``x:6074``, ``x:6099:01`` or ``3:1001`` (axis or node, index or name), or for ``lamp``.

    Raises:
        ArgumentError, StateError: no such object, axis, node, input or output.
    """
    if text in machine.cell.io:
        return _point(machine, text)
    where, colon, key = text.partition(":")
    if not colon or not key:
        raise ArgumentError(
            f"{text!r} names no object to record",
            remedy="write it as x:6074, x:6099:01 or 3:1001, or as the name of an input or output",
        )
    node_id, drive_axis = _place(machine.cell, where)
    require_objects(machine.cell, node_id)
    entry = Dictionary(machine.node(node_id).eds, node_id).resolve(key)
    index = own_index(entry.index, drive_axis)
    return WantedObject(text, node_id, index, entry.subindex, entry.name, entry.data_type)


def _point(machine: Watched, name: str) -> WantedObject:
    """Return the object of an input or output."""
    node_id = machine.cell.io[name].node
    eds = machine.node(node_id).eds
    point = all_points(machine.cell, {node_id: eds})[name]
    entry = Dictionary(eds, node_id).resolve(f"{point.index:04X}:{point.subindex:02X}")
    unit = f" ({point.unit})" if point.unit else ""
    return WantedObject(
        name, node_id, *point.address, f"{point.object_text} of node {node_id}{unit}", entry.data_type, point
    )


def _place(cell: CellConfig, where: str) -> tuple[int, int]:
    if where in cell.axes and cell.axes[where].virtual:
        raise cell.axes[where].no_drive("no objects")
    if where in cell.axes:
        return cell.axes[where].node, cell.axes[where].drive_axis
    if where.isdecimal() and len(where) <= 3 and int(where) in cell.nodes:
        return int(where), 1
    if where.isdecimal():
        raise UnknownNameError(
            f"the cell has no node {where}", observed=f"it has {', '.join(map(str, cell.nodes))}"
        )
    raise cell.no_axis(where)
