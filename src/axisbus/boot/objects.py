"""Access to a node's objects for boot-up, for nodes on a bus and for simulated nodes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Protocol

from axisbus.cia301.datatypes import DataType, Value, decode, encode
from axisbus.cia301.sdo import SdoTransferType
from axisbus.errors import SdoAbort, SdoTimeout

if TYPE_CHECKING:  # programs with drives on a bus need no simulated ones
    from axisbus.sim.device import Device

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
        way: SdoTransferType = SdoTransferType.AUTO,
        progress: Progress | None = None,
    ) -> None:
        """Set an object's bytes; ``progress`` is called with the number of bytes that have arrived."""


class DeviceObjects:
    """The objects of a simulated node, accessed without a bus."""

    def __init__(self, device: Device) -> None:
        self._device = device

    @property
    def node_id(self) -> int:
        """The node's ID."""
        return self._device.node_id

    def read(self, key: int, subindex: int = 0) -> Value:
        """Return an object's value; raises ``SdoAbort`` or ``SdoTimeout``."""
        self._require_answer(key, subindex)
        variable = self._device.eds.get(key, subindex)
        if variable is None or variable.data_type.integer:
            return self._device.read(key, subindex)
        return decode(self._device.dictionary.upload(key, subindex), variable.data_type)

    def write(self, key: int, subindex: int, value: Value) -> None:
        """Set an object's value; raises ``SdoAbort`` or ``SdoTimeout``."""
        self._require_answer(key, subindex)
        variable = self._device.eds.get(key, subindex)
        if isinstance(value, int) and (variable is None or variable.data_type.integer):
            self._device.write(key, subindex, value)
            return
        data_type = variable.data_type if variable is not None else DataType.OCTET_STRING
        self._device.dictionary.download(key, subindex, encode(value, data_type))

    def write_unchecked(self, key: int, subindex: int, value: int) -> None:
        """Set an integer without checking the limits of the EDS; raises ``SdoAbort`` or ``SdoTimeout``."""
        self._require_answer(key, subindex)
        self._device.write(key, subindex, value)

    def upload(self, index: int, subindex: int = 0) -> bytes:
        """Return an object's bytes; raises ``SdoAbort`` or ``SdoTimeout``."""
        self._require_answer(index, subindex)
        return self._device.upload(index, subindex)

    def download(
        self,
        index: int,
        subindex: int,
        data: bytes,
        *,
        way: SdoTransferType = SdoTransferType.AUTO,  # noqa: ARG002 - nothing travels here
        progress: Progress | None = None,
    ) -> None:
        """Set an object's bytes; raises ``SdoAbort`` or ``SdoTimeout``."""
        self._require_answer(index, subindex)
        self._device.download(index, subindex, data)
        if progress is not None:
            progress(len(data), len(data))

    def _require_answer(self, index: int, subindex: int) -> None:
        if not self._device.answers_sdo:
            raise SdoTimeout(
                f"node {self.node_id}: no answer to the SDO request for {index:04X}h:{subindex:02X}",
                node=self.node_id,
                index=index,
                subindex=subindex,
                remedy="check its supply, cable, node ID and bit rate (axisbus scan lists the nodes)",
            )


def read_int(objects: NodeObjects, index: int, subindex: int = 0) -> int | None:
    """Return an integer, None if the node has no such object or refuses to read it.

    Raises:
        SdoTimeout, BusError: the node does not answer.
    """
    try:
        value = objects.read(index, subindex)
    except SdoAbort:
        return None
    return value if isinstance(value, int) else None
