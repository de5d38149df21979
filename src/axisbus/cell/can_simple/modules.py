"""The modules of a cell: which of its nodes they are, and what the port of each has to be told."""

from __future__ import annotations

from collections.abc import Collection

from axisbus.bus.link.interfaces import MODBUS
from axisbus.cell.model import BusConfig, CellConfig
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.errors import StateError

NO_REMOTE = ("socketcand",)  # interfaces whose protocol has no remote frames


def carries_remote(bus: BusConfig) -> bool:
    """Whether remote frames pass the adapter of a bus."""
    return bus.interface not in NO_REMOTE


def is_line(bus: BusConfig) -> bool:
    """Whether a bus is a serial line, of which the modules are asked one after the other."""
    return bus.interface == MODBUS


def modules_of(cell: CellConfig) -> list[int]:
    """Return the node IDs of the modules of a cell."""
    return sorted(node.node_id for node in cell.nodes.values() if node.module is not None)


def canopen_nodes(cell: CellConfig) -> list[int]:
    """Return the node IDs of all others."""
    return [node.node_id for node in cell.nodes.values() if node.module is None]


def no_objects(node_id: int, what: str = "it has no object dictionary") -> StateError:
    """Return the refusal of what only a CANopen node has."""
    return StateError(
        f"node {node_id} speaks CAN Simple or Modbus, and not CANopen: {what}",
        remedy="use its axis; its own parameters are read and written by axisbus gim6010 params",
    )


def require_objects(cell: CellConfig | None, node_id: int) -> None:
    """Refuse a node of the cell that is a module, for what has to do with objects or NMT.

    Raises:
        StateError: it is one.
    """
    if cell is not None and node_id in cell.nodes and cell.nodes[node_id].module is not None:
        raise no_objects(node_id)


def settings_of(cell: CellConfig, node_id: int) -> ModuleSettings:
    """Return what the port of a module has to be told; its axis is the only one of its node.

    Raises:
        ArgumentError, LimitError: a value is none that a module takes, which ``axisbus check`` tells with its line.
    """
    module = cell.nodes[node_id].module
    assert module is not None
    axis = next(iter(cell.axes_of(node_id)), None)
    return module.settings(
        node_id,
        None if axis is None else axis.rated_torque,
        cell.bus.scan_period,
        None if axis is None else axis.stop.quick_stop,
        remote=carries_remote(cell.bus),
        relayed=is_line(cell.bus),
    )


def settings_by_axis(cell: CellConfig, names: Collection[str]) -> dict[str, ModuleSettings]:
    """Return the settings of those modules whose axes are among ``names``, by axis."""
    return {
        axis.name: settings_of(cell, node_id)
        for node_id in modules_of(cell)
        for axis in cell.axes_of(node_id)
        if axis.name in names
    }
