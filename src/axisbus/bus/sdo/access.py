"""A node by its objects: what commands and configuration need of one, whether its bus is this program's or another core's."""

from __future__ import annotations

from typing import Protocol

from axisbus.bus.sdo.transfer import Progress
from axisbus.cia301.datatypes import DataType, Value, decode
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds


class Sdo(Protocol):
    """The objects of one node by SDO; calls block and raise as those of ``SdoClient``, which is one."""

    @property
    def node_id(self) -> int:
        """The node's ID."""

    @property
    def dictionary(self) -> Dictionary:
        """What is known of its objects."""

    def upload(self, index: int, subindex: int = 0, *, progress: Progress | None = None) -> bytes:
        """Read an object's bytes."""

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object's bytes."""

    def read(self, key: int | str, subindex: int = 0, *, data_type: DataType | None = None) -> Value:
        """Read an object as the value that its data type says."""


class ByObjects(Protocol):
    """A node that is looked at and set by its objects alone; ``bus.node.Node`` is one."""

    @property
    def node_id(self) -> int:
        """The node's ID."""

    @property
    def eds(self) -> Eds | None:
        """Its EDS; None where no file is given."""

    @property
    def sdo(self) -> Sdo:
        """Its objects."""


def decoded(data: bytes, known: DataType | None) -> Value:
    """Return an object's bytes as a value.

    Where its type is not known, up to 4 or exactly 8 bytes are an unsigned integer, and other lengths stay bytes.
    """
    if known is not None:
        return decode(data, known)
    return int.from_bytes(data, "little") if len(data) in (1, 2, 3, 4, 8) else data
