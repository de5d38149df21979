"""The known configuration of a bus before its first frame: nodes, dictionaries, PDOs, and the axes' units."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from axisbus.cell import pdo_tables
from axisbus.cell.model import CellConfig, NodeConfig
from axisbus.cell.pdo_plan import travelling
from axisbus.cell.quantities import Quantities
from axisbus.check.context import CheckContext
from axisbus.cia301.pdo import PdoConfiguration
from axisbus.drives.plugin import GENERIC, DrivePlugin
from axisbus.drives.registry import make_of
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds


@dataclass(frozen=True, slots=True)
class DirectedPdo:
    """A PDO with its direction, seen from the node."""

    receive: bool
    pdo: PdoConfiguration


@dataclass(frozen=True)
class KnownNode:
    """One node: ``name`` has the names of its axes (empty if unknown), ``pdos`` are those that may be sent."""

    node_id: int
    name: str = ""
    dictionary: Dictionary = field(default_factory=Dictionary)
    pdos: tuple[DirectedPdo, ...] = ()
    make: DrivePlugin = GENERIC


class OtherNode(NamedTuple):
    """A node with a protocol other than CANopen, and the names of its axes."""

    protocol: str
    name: str


@dataclass(frozen=True)
class TraceContext:
    """A bus as its files describe it; all of it may be empty. ``others`` are nodes of other protocols."""

    nodes: Mapping[int, KnownNode] = field(default_factory=dict)
    quantities: Quantities = field(default_factory=Quantities)
    master_id: int | None = None
    others: Mapping[int, OtherNode] = field(default_factory=dict)


NOTHING = TraceContext()


def of_eds(files: Mapping[int, Eds]) -> TraceContext:
    """Return the contents of each node's EDS or DCF; its PDOs are those that the file switches on."""
    return TraceContext({node_id: _node(NodeConfig(node_id), eds) for node_id, eds in files.items()})


def of_cell(cell: CellConfig, files: Mapping[int, Eds]) -> TraceContext:
    """Return the contents of a cell file: PDOs as configured at boot, then those that the EDS switches on."""
    case = CheckContext(cell, files)
    nodes = {}
    for node, eds, dictionary in case.nodes:
        planned = tuple(DirectedPdo(*each) for each in travelling(cell, node, eds, dictionary))
        nodes[node.node_id] = _node(node, eds, _axes(cell, node.node_id), planned)
    others = {
        node_id: OtherNode(node.module.protocol, _axes(cell, node_id))
        for node_id, node in cell.nodes.items()
        if node.module is not None
    }
    return TraceContext(nodes, Quantities(cell), cell.bus.master_id, others)


def _axes(cell: CellConfig, node_id: int) -> str:
    return ",".join(axis.name for axis in cell.axes_of(node_id))


def _node(node: NodeConfig, eds: Eds, name: str = "", planned: tuple[DirectedPdo, ...] = ()) -> KnownNode:
    device = pdo_tables.device_pdos(node, eds)
    own = [DirectedPdo(True, pdo) for pdo in device.rpdos] + [DirectedPdo(False, pdo) for pdo in device.tpdos]
    return KnownNode(
        node.node_id,
        name,
        Dictionary(eds, node.node_id),
        tuple(_merged(planned, own)),
        make_of(eds, node.makes),
    )


def _merged(planned: Iterable[DirectedPdo], own: Iterable[DirectedPdo]) -> Iterable[DirectedPdo]:
    """Prefer the planned PDOs to those of the EDS: a plan has more information about the PDOs that it contains."""
    numbers = set()
    for each in planned:
        numbers.add((each.receive, each.pdo.number))
        yield each
    for each in own:
        if (each.receive, each.pdo.number) not in numbers:
            yield each
