"""A node of a running machine, with only its objects (``bus.sdo.access.ByObjects``); writing needs control of the machine."""

from __future__ import annotations

from axisbus.bus.node.events import NodeEventKind
from axisbus.bus.sdo.access import decoded
from axisbus.bus.sdo.transfer import Progress
from axisbus.cia301 import objects as o
from axisbus.cia301.datatypes import DataType, Value
from axisbus.eds.dictionary import Dictionary, DictionaryEntry
from axisbus.eds.model import Eds
from axisbus.errors import SdoAbort, SdoError, StateError
from axisbus.machine.node_access import NodeAccess


class MachineNode:
    """A node whose objects the core reads and writes for this program."""

    def __init__(self, access: NodeAccess) -> None:
        self.access = access
        self.node_id = access.node_id
        self.eds: Eds | None = access.eds
        self.sdo = MachineSdo(access)

    @property
    def last_restart(self) -> float:
        """The time of its last boot-up message that the machine did not expect, in s, monotonic; 0 if there was none."""
        return max(
            (event.stamp for event in self.access.events if event.kind is NodeEventKind.BOOT_UP), default=0.0
        )

    def answers_sdo(self) -> bool:
        """Return whether its SDO server answers; a refusal counts as an answer. Blocks."""
        try:
            self.sdo.upload(o.DEVICE_TYPE)
        except SdoAbort:
            return True
        except SdoError:
            return False
        return True

    def require_not_cyclic(self, entry: DictionaryEntry) -> None:
        """Check that the machine does not send the object by PDO.

        Raises:
            StateError: it does: a written value would be overwritten at once.
        """
        if (entry.index, entry.subindex) in self.access.sdo.cyclic:
            raise StateError(
                f"node {self.node_id}: {entry} is sent by PDO in every cycle of the running machine; nothing was sent",
                observed="a value written by SDO would be overwritten at once",
                remedy="use the commands of the axis for it (axisbus move, home, enable)",
            )


class MachineSdo:
    """The objects of a ``MachineNode``."""

    def __init__(self, access: NodeAccess) -> None:
        self.node_id = access.node_id
        self.dictionary = Dictionary(access.eds, access.node_id)
        self._objects = access.parts.objects
        self._require_unclaimed = access.require_unclaimed

    def upload(self, index: int, subindex: int = 0, *, progress: Progress | None = None) -> bytes:
        """Read an object's bytes; blocks. ``progress`` is called when all bytes have arrived."""
        data = self._objects.upload(index, subindex)
        if progress is not None:
            progress(len(data), len(data))
        return data

    def download(self, index: int, subindex: int, data: bytes) -> None:
        """Write an object's bytes; blocks. Needs control of the machine, and no boot-up or program download of the node."""
        self._require_unclaimed(f"the value of {index:04X}h:{subindex:02X}")
        self._objects.download(index, subindex, data)

    def read(self, key: int | str, subindex: int = 0, *, data_type: DataType | None = None) -> Value:
        """Read an object as a value of its data type; blocks."""
        entry = self.dictionary.resolve(key, subindex)
        return decoded(self.upload(entry.index, entry.subindex), data_type or entry.data_type)
