"""The nodes of a command: those of a machine that runs on this computer, by its core, else on a bus opened for the command."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from typing import Protocol

from axisbus.bus.sdo.access import ByObjects
from axisbus.cli.shared.attach_or_open import join
from axisbus.cli.shared.nodes import NodeFiles, NodeOptions, NodeSession, require_bus
from axisbus.machine.machine import Machine
from axisbus.machine.machine_node import MachineNode


class NodeLookup(Protocol):
    """Nodes by their IDs."""

    def node(self, node_id: int) -> ByObjects:
        """Return a node."""


def open_nodes(stack: ExitStack, asked: NodeOptions, files: NodeFiles, node_ids: Iterable[int]) -> NodeLookup:
    """Return the nodes that are to be looked at; ``stack`` closes what is opened for it.

    Raises:
        StateError: a machine of the cell runs, and has no such node.
        And what ``joined`` and ``nodes.NodeSession`` raise.
    """
    return joined(stack, asked, command=False) or NodeSession(stack, asked, files, node_ids)


def joined(stack: ExitStack, asked: NodeOptions, *, command: bool, take: bool = False) -> JoinedNodes | None:
    """Return the nodes of the machine that runs already, where --cell says which; None where none does.

    Raises:
        UsageError: neither --cell nor -i is given.
        OwnershipError: it is to be commanded, and another program does.
    """
    require_bus(asked)
    if asked.cell is None or asked.interface is not None:
        return None
    machine = join(asked.cell, command=command, take=take)
    return None if machine is None else JoinedNodes(stack.enter_context(machine))


class JoinedNodes:
    """The nodes of a machine that runs."""

    def __init__(self, machine: Machine) -> None:
        self.machine = machine

    def node(self, node_id: int) -> MachineNode:
        """Return a node; raises StateError where the machine has no such."""
        return MachineNode(self.machine.node(node_id))
