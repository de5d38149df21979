"""The objects that are wanted beside the axes of a recording, as people name them."""

from __future__ import annotations

from dataclasses import dataclass

from axisbus.cell.model import CellConfig
from axisbus.cia301.datatypes import DataType
from axisbus.cia402.axes import own_index
from axisbus.eds.dictionary import Dictionary
from axisbus.errors import ArgumentError, StateError
from axisbus.record.happenings import Watched


@dataclass(frozen=True, slots=True)
class WantedObject:
    """One object of a node; ``label`` is what it was asked for by, the index the device's own."""

    label: str
    node: int
    index: int
    subindex: int
    name: str
    data_type: DataType | None


def wanted_object(machine: Watched, text: str) -> WantedObject:
    """Return the object that ``x:6074``, ``x:6099:01`` or ``3:1001`` means: of an axis or a node, by index or name.

    Raises:
        ArgumentError, StateError: no such object, axis or node.
    """
    where, colon, key = text.partition(":")
    if not colon or not key:
        raise ArgumentError(
            f"{text!r} names no object to record", remedy="write it as x:6074, x:6099:01 or 3:1001"
        )
    node_id, drive_axis = _place(machine.cell, where)
    entry = Dictionary(machine.node(node_id).eds, node_id).resolve(key)
    index = own_index(entry.index, drive_axis)
    return WantedObject(text, node_id, index, entry.subindex, entry.name, entry.data_type)


def _place(cell: CellConfig, where: str) -> tuple[int, int]:
    if where in cell.axes and cell.axes[where].virtual:
        raise cell.axes[where].no_drive("no objects")
    if where in cell.axes:
        return cell.axes[where].node, cell.axes[where].drive_axis
    if where.isdecimal() and int(where) in cell.nodes:
        return int(where), 1
    if where.isdecimal():
        raise StateError(
            f"the cell has no node {where}", observed=f"it has {', '.join(map(str, cell.nodes))}"
        )
    raise cell.no_axis(where)
