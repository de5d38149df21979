"""The nodes of a command: through the core of a machine that runs on this computer, else on a bus opened for the command."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from typing import TYPE_CHECKING, Protocol

from axisbus.bus.sdo.access import ByObjects
from axisbus.cli.shared.attach_or_open import join
from axisbus.cli.shared.nodes import NodeFiles, NodeOptions, NodeSession, require_bus
from axisbus.machine.machine import Machine
from axisbus.machine.machine_node import MachineNode

if TYPE_CHECKING:
    pass


class NodeLookup(Protocol):
    """Nodes by their IDs."""

    def node(self, node_id: int) -> ByObjects:
        """Return a node."""


def open_nodes(
    stack: ExitStack, options: NodeOptions, files: NodeFiles, node_ids: Iterable[int]
) -> NodeLookup:
    """Return access to nodes; ``stack`` closes everything opened for it.

    Raises:
        StateError: a machine of the cell runs, and has no such node.
        Other errors as ``attach_to_nodes`` and ``nodes.NodeSession``.
    """
    return attach_to_nodes(stack, options, command=False) or NodeSession(stack, options, files, node_ids)


def attach_to_nodes(
    stack: ExitStack, options: NodeOptions, *, command: bool, take: bool = False
) -> AttachedNodes | None:
    """Return the nodes of the running machine of --cell; None if none runs.

    Raises:
        UsageError: neither --cell nor -i is given.
        OwnershipError: control is needed, and another program has it.
    """
    require_bus(options)
    if options.cell is None or options.interface is not None:
        return None
    machine = join(options.cell, command=command, take=take)
    return None if machine is None else AttachedNodes(stack.enter_context(machine))


class AttachedNodes:
    """The nodes of a running machine."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine

    def node(self, node_id: int) -> MachineNode:
        """Return a node; raises StateError if the machine does not have it."""
        return MachineNode(self.machine.node(node_id))
