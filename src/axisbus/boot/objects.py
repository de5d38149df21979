"""Access to a node's objects for boot-up, for nodes on a bus and for simulated nodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from axisbus.cia301.datatypes import Value
from axisbus.cia301.sdo import SdoTransferType, if_served

Progress = Callable[[int, int | None], None]  # bytes done, bytes in all (None: unknown)


class NodeObjects(Protocol):
    """Typed reads and writes; blocks; raises ``SdoAbort``, ``SdoTimeout`` and the errors of the bus."""

    @property
    def node_id(self) -> int:
        """The node's ID."""

    def read(self, key: int, subindex: int = 0) -> Value:
        """Return an object's value."""

    def write(self, key: int, subindex: int, value: Value) -> None:
        """Set an object's value."""

    def write_unchecked(self, key: int, subindex: int, value: int) -> None:
        """Set an integer without checking the limits of the EDS."""

    def upload(self, index: int, subindex: int = 0) -> bytes:
        """Return an object's bytes."""

    def download(
        self,
        index: int,
        subindex: int,
        data: bytes,
        *,
        transfer_type: SdoTransferType = SdoTransferType.AUTO,
        progress: Progress | None = None,
    ) -> None:
        """Set an object's bytes; ``progress`` is called with the number of bytes that have arrived."""


def read_int(objects: NodeObjects, index: int, subindex: int = 0) -> int | None:
    """Return an integer, None if the node has no such object, refuses to read it, or is silent for this object only.

    Raises:
        SdoTimeout, BusError: the node does not answer.
    """
    value = if_served(objects.read, index, subindex)
    return value if isinstance(value, int) else None
