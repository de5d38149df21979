"""Decide by the EDS which objects a client may read or write while a machine runs.

Theory of operation
-------------------
A client may read the objects that ``axisbus od dump`` reads: the EDS permits reading, the ObjFlags do not refuse a scan, and the
object is no DOMAIN, because a DOMAIN could take minutes. A client may write the objects that ``axisbus od write`` writes in a
running machine, except DOMAINs. This module asks the node nothing; ``configuration.guarded_write`` does that.
"""

from __future__ import annotations

from axisbus.bus.node.verify import is_domain, may_read
from axisbus.configuration import guarded_write
from axisbus.eds.dictionary import DictionaryEntry
from axisbus.eds.model import Variable
from axisbus.errors import ArgumentError
from axisbus.machine.machine import Machine
from axisbus.machine.machine_node import MachineNode


def node_of(machine: Machine, node_id: int) -> MachineNode:
    """Return the node with this node-ID, for access to its objects.

    Raises:
        StateError: the cell has no such node, or the node speaks CAN Simple.
    """
    access = machine.node(node_id)
    if access.parts.objects_refused is not None:
        raise access.parts.objects_refused("")
    return MachineNode(access)


def require_readable(node: MachineNode, entry: DictionaryEntry) -> None:
    """Check that a client may read an object while the machine runs.

    Raises:
        ArgumentError: the EDS does not have the object, the object is not readable, it is a DOMAIN, or its ObjFlags refuse a scan.
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
            f"node {node.node_id}: {entry} is not read automatically",
            observed="it is a DOMAIN, or its ObjFlags refuse a scan",
            remedy="read it at the machine: axisbus od read",
        )


def require_writable(node: MachineNode, entry: DictionaryEntry) -> None:
    """Check that a client may write an object while the machine runs.

    Raises:
        ArgumentError: as ``guarded_write.require_writable``, or the object is a DOMAIN.
        StateError: as ``MachineNode.require_not_cyclic``.
    """
    guarded_write.require_writable(node.eds, node.node_id, entry, None)
    variable = _variable(node, entry)
    if variable is not None and is_domain(variable):
        raise ArgumentError(
            f"node {node.node_id}: {entry} is not written automatically",
            observed="it is a DOMAIN, which would be read before and after",
            remedy="write it at the machine: axisbus od write",
        )
    node.require_not_cyclic(entry)


def _variable(node: MachineNode, entry: DictionaryEntry) -> Variable | None:
    return None if node.eds is None else node.eds.get(entry.index, entry.subindex)
