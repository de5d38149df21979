"""The nodes of a command: those of a machine that runs on this computer, by its core, else on a bus opened for the command."""

from __future__ import annotations

from collections.abc import Iterable
from contextlib import ExitStack
from typing import Protocol

from axisbus.bus.sdo.access import ByObjects, decoded
from axisbus.bus.sdo.transfer import Progress
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType, Value
from axisbus.cli.shared.joining import join
from axisbus.cli.shared.nodes import Asked, Files, Session, require_bus
from axisbus.eds.dictionary import Dictionary, Entry
from axisbus.eds.model import Eds
from axisbus.errors import SdoAbort, SdoError, StateError
from axisbus.machine.machine import Machine
from axisbus.machine.node_access import NodeAccess


class Nodes(Protocol):
    """Nodes by their IDs."""

    def node(self, node_id: int) -> ByObjects:
        """Return a node."""


def open_nodes(stack: ExitStack, asked: Asked, files: Files, node_ids: Iterable[int]) -> Nodes:
    """Return the nodes that are to be looked at; ``stack`` closes what is opened for it.

    Raises:
        StateError: a machine of the cell runs, and has no such node.
        And what ``joined`` and ``nodes.Session`` raise.
    """
    return joined(stack, asked, command=False) or Session(stack, asked, files, node_ids)


def joined(stack: ExitStack, asked: Asked, *, command: bool, take: bool = False) -> JoinedNodes | None:
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

    def node(self, node_id: int) -> JoinedNode:
        """Return a node; raises StateError where the machine has no such."""
        return JoinedNode(self.machine.node(node_id))


class JoinedNode:
    """A node by what the core that has its bus reads and writes for this command."""

    def __init__(self, access: NodeAccess) -> None:
        self.access = access
        self.node_id = access.node_id
        self.eds: Eds | None = access.eds
        self.sdo = JoinedSdo(access)

    def answers_sdo(self) -> bool:
        """Try whether its SDO server answers, a refusal included; blocks."""
        try:
            self.sdo.upload(o.DEVICE_TYPE)
        except SdoAbort:
            return True
        except SdoError:
            return False
        return True

    def require_not_cyclic(self, entry: Entry) -> None:
        """Check that the machine does not send the object by PDO.

        Raises:
            StateError: it does: what is written would be overwritten at once.
        """
        if (entry.index, entry.subindex) in self.access.sdo.cyclic:
            raise StateError(
                f"node {self.node_id}: {entry} is sent by PDO in every cycle of the machine that runs; nothing was sent",
                observed="a value written by SDO would be overwritten at once",
                remedy="use the axis's commands for it (axisbus move, home, enable)",
            )


class JoinedSdo:
    """The objects of such a node."""

    def __init__(self, access: NodeAccess) -> None:
        self.node_id = access.node_id
        self.dictionary = Dictionary(access.eds, access.node_id)
        self._objects = access.parts.objects

    def upload(self, index: int, subindex: int = 0, *, progress: Progress | None = None) -> bytes:
        """Read an object's bytes; blocks. ``progress`` is told when all have come."""
        data = self._objects.upload(index, subindex)
        if progress is not None:
            progress(len(data), len(data))
        return data

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object's bytes; blocks. For who has the command of the machine."""
        self._objects.download(index, subindex, data)

    def read(self, key: int | str, subindex: int = 0, *, data_type: DataType | None = None) -> Value:
        """Read an object as the value that its data type says; blocks."""
        entry = self.dictionary.resolve(key, subindex)
        return decoded(self.upload(entry.index, entry.subindex), data_type or entry.data_type)
