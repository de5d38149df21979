"""The nodes of a cell that use a protocol other than CANopen: the part of a drive plug-in that reads and describes them.

A plug-in names a ``CellPart`` in the ``parts`` of its ``Extension``. It is loaded only for a cell that names one of the plug-in's
protocols, or its interface.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple

from axisbus.cell.model import CellConfig, ProtocolSettings
from axisbus.drives import registry
from axisbus.eds.model import Eds
from axisbus.errors import StateError
from axisbus.motion.parameters import AxisParameters
from axisbus.toml.tables import Keys

PACKAGE = "cell"
_NO_DICTIONARY = "it has no object dictionary"


class NodeFrame(NamedTuple):
    """Frames of one kind: ``rate`` per second at worst, while the axis is enabled; ``to_node``: whether the master sends them."""

    node: int
    can_id: int
    kind: str
    name: str
    rate: float
    data_bytes: int
    to_node: bool


@dataclass(frozen=True, slots=True)
class CellPart:
    """The knowledge of a plug-in about the nodes of its protocols.

    ``keys`` are those of the table ``[nodes.N.PROTOCOL]``, ``descriptions`` their texts, ``tables`` the text of each table by
    protocol; ``settings`` makes the settings of a table from its protocol and its fields. ``dictionaries`` returns the EDS that
    describes the axis of each node, and ``parameters`` those of the axis with this name. ``frames`` are those of the nodes while
    the cell runs. ``sent_by`` and ``commands_to`` are the identifiers that a node uses, by its node-ID: those that it sends, and
    those of commands to it. ``adapter_options`` are options for opening the bus, beside ``[bus.options]``. ``no_objects`` returns
    the error for the use of a node as one of CANopen, and ``no_virtual_time`` that for running a cell in virtual time (None: it
    can).

    ``settings``, ``dictionaries``, ``parameters`` and ``frames`` raise ArgumentError and LimitError for values that are not valid.
    """

    keys: Keys
    descriptions: Mapping[str, str]
    tables: Mapping[str, str]
    settings: Callable[[str, Mapping[str, Any]], ProtocolSettings]
    dictionaries: Callable[[CellConfig], dict[int, Eds]]
    parameters: Callable[[CellConfig, str], AxisParameters]
    frames: Callable[[CellConfig], Iterator[NodeFrame]]
    sent_by: Callable[[int], frozenset[int]]
    commands_to: Callable[[int], frozenset[int]]
    adapter_options: Callable[[CellConfig], Mapping[str, object]]
    no_objects: Callable[[int, str], StateError]
    no_virtual_time: Callable[[CellConfig], StateError | None]


def part_for(protocol: str) -> CellPart:
    """Return the part of the plug-in that has a protocol. Blocks while it is imported."""
    (part,) = registry.parts(PACKAGE, protocol)
    found: CellPart = part
    return found


def keys_of(protocol: str) -> Keys:
    """Return the keys of the table of a protocol, ``[nodes.N.PROTOCOL]``."""
    return part_for(protocol).keys


def words_of(cell: CellConfig) -> frozenset[str]:
    """Return the protocols other than CANopen, and the interface, that a cell names."""
    found = {node.module.protocol for node in cell.nodes.values() if node.module is not None}
    return frozenset(found | ({cell.bus.interface} & registry.interfaces().keys()))


def parts_for(cell: CellConfig, package: str) -> list[Any]:
    """Return the parts that extend a package, of the plug-ins whose protocol or interface a cell names."""
    words = words_of(cell)
    return registry.parts(package, *words) if words else []


def canopen_nodes(cell: CellConfig) -> list[int]:
    """Return the node-IDs of the nodes that use CANopen."""
    return [node.node_id for node in cell.nodes.values() if node.module is None]


def other_nodes(cell: CellConfig) -> list[int]:
    """Return the node-IDs of all other nodes."""
    return sorted(node.node_id for node in cell.nodes.values() if node.module is not None)


def with_dictionaries(cell: CellConfig, dictionaries: Mapping[int, Eds]) -> dict[int, Eds]:
    """Return ``dictionaries`` together with the descriptions of the nodes of other protocols."""
    found = dict(dictionaries)
    for part in _parts(cell):
        found |= part.dictionaries(cell)
    return found


def node_frames(cell: CellConfig) -> Iterator[NodeFrame]:
    """Return the frames of all nodes of other protocols while the cell runs."""
    for part in _parts(cell):
        yield from part.frames(cell)


def parameters_of(cell: CellConfig, name: str) -> AxisParameters:
    """Return the parameters of the axis ``name``, whose node uses another protocol."""
    return _of_node(cell, cell.axes[name].node).parameters(cell, name)


def sent_by(cell: CellConfig, node_id: int) -> frozenset[int]:
    """Return the identifiers of the frames that a node of another protocol sends."""
    return _of_node(cell, node_id).sent_by(node_id)


def commands_to(cell: CellConfig, node_id: int) -> frozenset[int]:
    """Return the identifiers of commands to a node of another protocol."""
    return _of_node(cell, node_id).commands_to(node_id)


def adapter_options(cell: CellConfig) -> dict[str, object]:
    """Return options for opening the bus, beside ``[bus.options]``.

    Raises:
        ArgumentError: a file that a node names is unusable; ``axisbus check`` reports it with its line.
    """
    return {key: value for part in _parts(cell) for key, value in part.adapter_options(cell).items()}


def has_own_interface(cell: CellConfig) -> bool:
    """Whether the bus has an interface of a plug-in, which is no CAN adapter."""
    return cell.bus.interface in registry.interfaces()


def require_virtual_time(cell: CellConfig) -> None:
    """Check that a cell can run in virtual time.

    Raises:
        StateError: it cannot.
    """
    for part in _parts(cell):
        error = part.no_virtual_time(cell)
        if error is not None:
            raise error


def objects_refused(cell: CellConfig, node_id: int) -> Callable[[str], StateError] | None:
    """Return the function that makes the error for an access to objects of a node, from its reason; None for a CANopen node."""
    if cell.nodes[node_id].module is None:
        return None
    part = _of_node(cell, node_id)
    return lambda why: part.no_objects(node_id, why or _NO_DICTIONARY)


def require_objects(cell: CellConfig | None, node_id: int) -> None:
    """Refuse a node of the cell that does not use CANopen, before an access to objects or NMT.

    Raises:
        StateError: the node uses another protocol.
    """
    refused = None if cell is None or node_id not in cell.nodes else objects_refused(cell, node_id)
    if refused is not None:
        raise refused(_NO_DICTIONARY)


def _parts(cell: CellConfig) -> list[CellPart]:
    return parts_for(cell, PACKAGE)


def _of_node(cell: CellConfig, node_id: int) -> CellPart:
    module = cell.nodes[node_id].module
    assert module is not None
    return part_for(module.protocol)
