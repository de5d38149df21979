"""The nodes of a cell for ``axisbus eds code --c --cell``: all CANopen nodes, or one, with their PDOs."""

from __future__ import annotations

from pathlib import Path

from axisbus.cell.model import CellConfig, NodeConfig
from axisbus.cell.other_protocols import canopen_nodes
from axisbus.cell.pdo_plan import beside_pdos, travelling
from axisbus.check.context import CheckContext
from axisbus.check.run import checked
from axisbus.core.files import load_dictionaries
from axisbus.drives import registry
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.layout import of_pdo
from axisbus.eds.model import Eds
from axisbus.eds.report.header import NodePdos
from axisbus.errors import StateError, UnknownNameError


def nodes_of(file: Path, node: int | None, axis: str | None) -> list[NodePdos]:
    """Return the PDOs of all nodes of a cell, of one, or of the node of an axis, as planned for boot-up. Blocks for its files.

    Raises:
        ConfigError: ``check`` finds an error in the cell.
        StateError: there is no such node or axis, or it has no PDOs.
    """
    cell = checked(file)
    node_ids = _node_ids(cell, node, axis)
    case = CheckContext(cell, load_dictionaries(cell))
    return [_planned(cell, *each) for each in case.nodes if each[0].node_id in node_ids]


def _node_ids(cell: CellConfig, node: int | None, axis: str | None) -> list[int]:
    if axis is not None:
        node = _node_of(cell, axis)
    node_ids_of_cell = canopen_nodes(cell)
    if node is None and node_ids_of_cell:
        return node_ids_of_cell
    remedy = f"name a node that speaks CANopen: --node {node_ids_of_cell[0]}" if node_ids_of_cell else ""
    if node is None:
        raise StateError("the cell has no node that speaks CANopen, so it has no PDOs")
    if node not in cell.nodes:
        known = ", ".join(map(str, cell.nodes)) or "none"
        raise UnknownNameError(f"the cell has no node {node}", observed=f"it has {known}", remedy=remedy)
    if node not in node_ids_of_cell:
        raise StateError(
            f"node {node} speaks {' or '.join(registry.protocols().values())}, and not CANopen: it has no PDOs",
            remedy=remedy,
        )
    return [node]


def _node_of(cell: CellConfig, axis: str) -> int:
    found = cell.axes.get(axis)
    if found is None:
        raise cell.no_axis(axis)
    if found.virtual:
        raise found.no_drive("no PDOs")
    return found.node


def _planned(cell: CellConfig, node: NodeConfig, eds: Eds, dictionary: Dictionary) -> NodePdos:
    layouts = [of_pdo(eds, pdo, receive=receive) for receive, pdo in travelling(cell, node, eds, dictionary)]
    layouts.sort(key=lambda each: (not each.receive, each.number))
    notes = beside_pdos(cell, node, eds, dictionary)
    return NodePdos(node.node_id, _use_of(cell, node.node_id), eds, tuple(layouts), notes)


def _use_of(cell: CellConfig, node_id: int) -> str:
    """Return the use of a node: ``axes x, y``, ``inputs and outputs valve``."""
    axes = [axis.name for axis in cell.axes_of(node_id)]
    points = [each.name for each in cell.io_of(node_id)]
    uses = [
        f"{noun} {', '.join(names)}"
        for noun, names in (("axis" if len(axes) == 1 else "axes", axes), ("inputs and outputs", points))
        if names
    ]
    return "; ".join(uses) or "none of the cell's axes"
