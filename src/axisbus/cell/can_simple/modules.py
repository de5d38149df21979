"""The modules among a cell's nodes, and the settings of their ports."""

from __future__ import annotations

from collections.abc import Collection

from axisbus.bus.link.interfaces import MODBUS
from axisbus.cell.model import BusConfig, CellConfig
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.errors import StateError

NO_REMOTE = ("socketcand",)  # interfaces whose protocol has no remote frames


def carries_remote(bus: BusConfig) -> bool:
    """Whether the adapter of a bus can send remote frames."""
    return bus.interface not in NO_REMOTE


def is_line(bus: BusConfig) -> bool:
    """Whether a bus is a serial line, on which the master polls the modules one after the other."""
    return bus.interface == MODBUS


def modules_of(cell: CellConfig) -> list[int]:
    """Return the node-IDs of a cell's modules."""
    return sorted(node.node_id for node in cell.nodes.values() if node.module is not None)


def canopen_nodes(cell: CellConfig) -> list[int]:
    """Return the node-IDs of all other nodes."""
    return [node.node_id for node in cell.nodes.values() if node.module is None]


def no_objects(node_id: int, what: str = "it has no object dictionary") -> StateError:
    """Return the error for using a module as a CANopen node."""
    return StateError(
        f"node {node_id} uses CAN Simple or Modbus, not CANopen: {what}",
        remedy="use its axis; its own parameters are read and written by axisbus gim6010 params",
    )


def require_objects(cell: CellConfig | None, node_id: int) -> None:
    """Refuse a node of the cell that is a module, before an access to objects or NMT.

    Raises:
        StateError: the node is a module.
    """
    if cell is not None and node_id in cell.nodes and cell.nodes[node_id].module is not None:
        raise no_objects(node_id)


def settings_of(cell: CellConfig, node_id: int) -> ModuleSettings:
    """Return the settings of a module's port; a module has only one axis.

    Raises:
        ArgumentError, LimitError: a value is not valid for a module; ``axisbus check`` reports it with its line.
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
    """Return the settings of the modules whose axes are among ``names``, by axis."""
    return {
        axis.name: settings_of(cell, node_id)
        for node_id in modules_of(cell)
        for axis in cell.axes_of(node_id)
        if axis.name in names
    }
