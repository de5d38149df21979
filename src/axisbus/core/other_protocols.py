"""The nodes of a cell that use a protocol other than CANopen, on the channel of the core, by the part of a drive plug-in.

A plug-in names a ``CorePart`` in the ``parts`` of its ``Extension``. It is loaded only for a cell that names one of the plug-in's
protocols, or its interface.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple, Protocol

from axisbus.boot.report import Booted
from axisbus.bus.cycle import CycleSender
from axisbus.bus.link.channel import Channel
from axisbus.bus.node.events import NodeEvents
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.parallel import in_parallel
from axisbus.cell.model import CellConfig
from axisbus.cell.other_protocols import parts_for
from axisbus.cia402.port import Port
from axisbus.core.node_access_parts import NodeParts
from axisbus.core.node_stop import stop_nodes
from axisbus.core.simulated_nodes import SimulatedNode
from axisbus.link import StopResult
from axisbus.sim.node.network import ForeignNode

Lock = AbstractContextManager[object]


class OtherNodes(Protocol):
    """The nodes of a plug-in's protocols on a channel, from the opening of the bus on."""

    @property
    def senders(self) -> Sequence[CycleSender]:
        """The booted nodes, for the cycle."""

    @property
    def events(self) -> Sequence[NodeEvents]:
        """Their events; available after ``begin``."""

    def __contains__(self, node_id: int) -> bool:
        """Whether the node with this ID is one of them."""

    def boot(self, node_id: int, find_time: float) -> Booted:
        """As ``CellConnection.boot``, before the scan begins; ``find_time`` (s) is the limit for the first frame of the node."""

    def begin(self) -> None:
        """Process the frames received so far before the scan begins, so that no node counts as unknown, or as lost."""

    def ports(self, node_id: int) -> dict[str, Port]:
        """As ``CellConnection.ports``."""

    def parts(self, node_id: int) -> NodeParts:
        """As ``CellConnection.parts``."""

    def close(self) -> None:
        """Stop listening."""


class SimulatedForeignNode(NamedTuple):
    """A simulated node of another protocol; ``access`` makes the user's access to it, from the lock of its network."""

    foreign_node: ForeignNode
    access: Callable[[Lock], SimulatedNode]


@dataclass(frozen=True, slots=True)
class CorePart:
    """The actions of a plug-in for the nodes of its protocols.

    ``nodes`` begins to listen to them. ``stop`` stops those of their axes that have one of these names, without the scan, and
    blocks until standstill; ``holding`` are the axes whose stop leaves them enabled. ``simulated`` makes the simulated nodes of
    a cell, by node-ID.
    """

    nodes: Callable[[CellConfig, Channel], OtherNodes]
    stop: Callable[[CellConfig, Channel, Collection[str]], list[StopResult]]
    holding: Callable[[CellConfig], frozenset[str]]
    simulated: Callable[[CellConfig], Mapping[int, SimulatedForeignNode]]


def parts_of(cell: CellConfig) -> list[CorePart]:
    """Return the parts of the plug-ins whose protocols a cell names."""
    return parts_for(cell, "core")


class AllOtherNodes:
    """The nodes of all other protocols of a cell, as ``OtherNodes``."""

    def __init__(self, cell: CellConfig, channel: Channel) -> None:
        """Begin to listen; nothing is sent."""
        self._all = [part.nodes(cell, channel) for part in parts_of(cell)]

    def __contains__(self, node_id: int) -> bool:
        return any(node_id in each for each in self._all)

    def of(self, node_id: int) -> OtherNodes:
        """Return those that the node belongs to."""
        return next(each for each in self._all if node_id in each)

    @property
    def senders(self) -> list[CycleSender]:
        """As ``OtherNodes.senders``."""
        return [sender for each in self._all for sender in each.senders]

    @property
    def events(self) -> list[NodeEvents]:
        """As ``OtherNodes.events``."""
        return [events for each in self._all for events in each.events]

    def begin(self) -> None:
        """As ``OtherNodes.begin``."""
        for each in self._all:
            each.begin()

    def close(self) -> None:
        """Stop listening."""
        for each in self._all:
            each.close()


# -- stop without the scan ---------------------------------------------------------------------------------------------


def stop_drives(
    cell: CellConfig, channel: Channel, nodes: Iterable[CanopenNode], names: Collection[str]
) -> list[StopResult]:
    """Stop the axes of these names, of ``nodes`` and of other protocols; blocks until standstill, at most about 8 s.

    If there is no other thread for the other protocols, they come first, because their stop sequence is shorter.
    """
    works: list[Callable[[], list[StopResult]]] = []
    if any(cell.nodes[axis.node].module is not None for name, axis in cell.driven.items() if name in names):
        works += stops_of(cell, channel, names)
    works.append(partial(stop_nodes, channel.clock, cell, list(nodes), names))
    return [stopped for each in in_parallel(channel.clock, lambda work: work(), works) for stopped in each]


def stops_of(
    cell: CellConfig, channel: Channel, names: Collection[str]
) -> list[Callable[[], list[StopResult]]]:
    """Return, for each plug-in, the function that stops the axes of these names."""
    return [partial(part.stop, cell, channel, names) for part in parts_of(cell)]


def holding(cell: CellConfig) -> frozenset[str]:
    """Return the axes of other protocols whose stop without the scan leaves them enabled."""
    return frozenset(name for part in parts_of(cell) for name in part.holding(cell))


# -- simulated nodes ---------------------------------------------------------------------------------------------------


def simulated_foreign_nodes(cell: CellConfig) -> dict[int, SimulatedForeignNode]:
    """Make the simulated nodes of other protocols of a cell, by node-ID; raises as ``CellPart.parameters``."""
    return {node_id: made for part in parts_of(cell) for node_id, made in part.simulated(cell).items()}


def foreign_nodes_of(made: Mapping[int, SimulatedForeignNode]) -> list[ForeignNode]:
    """Return the nodes, for their network."""
    return [each.foreign_node for each in made.values()]


def accesses_of(made: Mapping[int, SimulatedForeignNode], lock: Lock) -> dict[int, SimulatedNode]:
    """Return the user's access to each node; ``lock`` is that of their network."""
    return {node_id: each.access(lock) for node_id, each in made.items()}
