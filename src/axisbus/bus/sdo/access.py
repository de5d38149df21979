"""Access to a node's objects for commands and configuration, independent of whether this process or another core owns the bus."""

from __future__ import annotations

from typing import Protocol

from axisbus.bus.sdo.transfer import Progress
from axisbus.cia301 import abort
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType, Value, decode
from axisbus.eds.dictionary import Dictionary
from axisbus.eds.model import Eds
from axisbus.errors import SdoAbort, SdoError, SdoTimeout


class SdoUploads(Protocol):
    """The objects of one node as bytes; implemented by ``SdoClient``."""

    def upload(self, index: int, subindex: int = 0) -> bytes:
        """Read an object's bytes."""


class SdoObjectAccess(Protocol):
    """The objects of one node by SDO; implemented by ``SdoClient``, whose blocking and exceptions apply."""

    @property
    def node_id(self) -> int:
        """The node's ID."""

    @property
    def dictionary(self) -> Dictionary:
        """The known objects of the node."""

    def upload(self, index: int, subindex: int = 0, *, progress: Progress | None = None) -> bytes:
        """Read an object's bytes."""

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object's bytes."""

    def read(self, key: int | str, subindex: int = 0, *, data_type: DataType | None = None) -> Value:
        """Read an object as a value of its data type."""


class ByObjects(Protocol):
    """A node that is read and configured only through its objects; implemented by ``CanopenNode``."""

    @property
    def node_id(self) -> int:
        """The node's ID."""

    @property
    def eds(self) -> Eds | None:
        """Its EDS; None if no file is given."""

    @property
    def sdo(self) -> SdoObjectAccess:
        """Its objects."""


def decoded(data: bytes, known: DataType | None) -> Value:
    """Return an object's bytes as a value.

    If the type is not known, up to 4 or exactly 8 bytes are an unsigned integer, and other lengths remain bytes.
    """
    if known is not None:
        return decode(data, known)
    return int.from_bytes(data, "little") if len(data) in (1, 2, 3, 4, 8) else data


def try_upload(sdo: SdoUploads, index: int, subindex: int = 0) -> bytes | SdoError:
    """Return an object's bytes, or the reason why this one object cannot be read; blocks as ``upload``.

    The node may refuse the object, send an invalid answer, or be silent for it while it answers for others.

    Raises:
        SdoTimeout: the node answers for no object. AdapterError: the channel failed.
    """
    try:
        return sdo.upload(index, subindex)
    except SdoError as error:
        require_answering(sdo, error)
        return error


def require_answering(sdo: SdoUploads, error: SdoError) -> None:
    """Raise ``error`` again if its node answers for no object; blocks for a transfer if it was a time-out."""
    if isinstance(error, SdoTimeout) and not _answers(sdo, error):
        raise error


def _answers(sdo: SdoUploads, error: SdoTimeout) -> bool:
    mandatory = o.ERROR_REGISTER if error.index == o.DEVICE_TYPE else o.DEVICE_TYPE
    try:
        sdo.upload(mandatory)
    except SdoTimeout:
        return False
    except SdoError:
        return True
    return True


def why_unread(error: SdoError) -> str:
    """Return the text why ``try_upload`` has no value."""
    if isinstance(error, SdoAbort):
        return f"the device refuses it: {abort.describe(error.code)}"
    if isinstance(error, SdoTimeout):
        return "the device does not answer for it, and answers for others"
    return f"the device's answer for it is not a value: {error.observed}"
