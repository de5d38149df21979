"""Objects that somebody reads or writes in passing while a machine runs: what may be, by what the files tell.

Theory of operation
-------------------
What is read is what ``axisbus od dump`` reads: an object that its EDS lets be read, that does not refuse a scan, and that is no
DOMAIN, which could take minutes. What is written is what ``axisbus od write`` writes in a machine that runs, but for a DOMAIN.
Nothing is asked of the node here; what it says of itself is for ``configuration.guarded_write``.
"""

from __future__ import annotations

from axisbus.bus.node.verify import is_domain, may_read
from axisbus.cell.can_simple.modules import no_objects
from axisbus.configuration import guarded_write
from axisbus.eds.dictionary import DictionaryEntry
from axisbus.eds.model import Variable
from axisbus.errors import ArgumentError
from axisbus.machine.machine import Machine
from axisbus.machine.machine_node import MachineNode


def node_of(machine: Machine, node_id: int) -> MachineNode:
    """Return a node by its objects.

    Raises:
        StateError: the cell has no such node, or it speaks CAN Simple.
    """
    access = machine.node(node_id)
    if not access.parts.has_objects:
        raise no_objects(node_id)
    return MachineNode(access)


def require_readable(node: MachineNode, entry: DictionaryEntry) -> None:
    """Check that an object may be read in passing.

    Raises:
        ArgumentError: its EDS does not have it, or it is not to be read, or not like this.
    """
    variable = _variable(node, entry)
    if variable is None:
        raise ArgumentError(f"node {node.node_id} has no object {entry} by its EDS")
    if not variable.readable:
        raise ArgumentError(
            f"node {node.node_id}: {entry} cannot be read", observed=f"its access is {variable.access}"
        )
    if not may_read(variable):
        raise ArgumentError(
            f"node {node.node_id}: {entry} is not read in passing",
            observed="it is a DOMAIN, or its ObjFlags refuse a scan",
            remedy="read it on purpose, at the machine: axisbus od read",
        )


def require_writable(node: MachineNode, entry: DictionaryEntry) -> None:
    """Check that an object may be written in passing.

    Raises:
        ArgumentError: as ``guarded_write.require_writable``, or it is a DOMAIN.
        StateError: as ``MachineNode.require_not_cyclic``.
    """
    guarded_write.require_writable(node.eds, node.node_id, entry, None)
    variable = _variable(node, entry)
    if variable is not None and is_domain(variable):
        raise ArgumentError(
            f"node {node.node_id}: {entry} is not written in passing",
            observed="it is a DOMAIN, which would be read before and after",
            remedy="write it on purpose, at the machine: axisbus od write",
        )
    node.require_not_cyclic(entry)


def _variable(node: MachineNode, entry: DictionaryEntry) -> Variable | None:
    return None if node.eds is None else node.eds.get(entry.index, entry.subindex)
