"""A node whose objects are read with a pause between two transfers, until cancelled; writing needs an extra class."""

from __future__ import annotations

import threading

from axisbus.bus.sdo.access import decoded
from axisbus.bus.sdo.transfer import Progress
from axisbus.cia301.datatypes import DataType, Value
from axisbus.configuration import preconditions
from axisbus.errors import StateError, Stopped
from axisbus.machine.machine_node import MachineNode

PACE = 0.02  # seconds between two transfers


class PacedSdo:
    """The objects of a node, with the interface of ``bus.sdo.access.SdoObjectAccess``."""

    def __init__(self, node: MachineNode, cancelled: threading.Event, what: str) -> None:
        """``what`` names the activity in the error that is raised once ``cancelled`` is set."""
        self.node_id = node.node_id
        self._node = node
        self.dictionary = node.sdo.dictionary
        self._sdo = node.sdo
        self._cancelled = cancelled
        self._what = what

    def upload(self, index: int, subindex: int = 0, *, progress: Progress | None = None) -> bytes:
        """Read an object's bytes; raises Stopped if the activity was cancelled."""
        if self._cancelled.wait(PACE):
            raise Stopped(f"{self._what} of node {self.node_id} was cancelled")
        return self._sdo.upload(index, subindex, progress=progress)

    def download(self, index: int, subindex: int, data: bytes) -> None:  # noqa: ARG002  # signature of the interface
        """Refuse to write: raises StateError."""
        raise StateError(
            f"node {self.node_id}: {self._what} only reads; {index:04X}h:{subindex:02X} was not written"
        )

    def read(self, key: int | str, subindex: int = 0, *, data_type: DataType | None = None) -> Value:
        """Read an object as the value of its data type."""
        entry = self.dictionary.resolve(key, subindex)
        return decoded(self.upload(entry.index, entry.subindex), data_type or entry.data_type)


class WritingSdo(PacedSdo):
    """Objects that may be written while no drive of the node is energised; this is checked before each write."""

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object's bytes; raises Stopped if the activity was cancelled, StateError if a drive is energised."""
        preconditions.require_not_energised(self._node)
        if self._cancelled.wait(PACE):
            raise Stopped(f"{self._what} of node {self.node_id} was cancelled")
        self._sdo.download(index, subindex, data)


class PacedNode:
    """A node with paced transfers, with the interface of ``bus.sdo.access.ByObjects``."""

    def __init__(self, node: MachineNode, sdo: PacedSdo) -> None:
        self.node_id = node.node_id
        self.eds = node.eds
        self.sdo = sdo
