"""A node of a core in another process, for direct access: each access is a request to the core."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

from axisbus.boot.objects import Progress
from axisbus.bus.node.events import NodeEvent
from axisbus.bus.pdo.tpdo_timeout import PdoEvent
from axisbus.cia301.datatypes import Value
from axisbus.cia301.emcy import Emcy
from axisbus.cia301.incident import Incident
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.sdo import SdoTransferType
from axisbus.core.process.rpc_client import RpcClient


class _OfNode:
    """A part of a node; its values are requested from the core."""

    def __init__(self, calls: RpcClient, node_id: int) -> None:
        self._calls = calls
        self._node_id = node_id

    def _ask(self, what: str, *arguments: Any) -> Any:
        return self._calls.ask(what, self._node_id, *arguments)


class RemoteObjects(_OfNode):
    """The objects of a node, by SDO transfers that the core makes (``boot.objects.NodeObjects``)."""

    @property
    def node_id(self) -> int:
        """The node's ID."""
        return self._node_id

    def read(self, key: int, subindex: int = 0) -> Value:
        """Return an object's value; blocks, raises as ``SdoClient.read``."""
        value: Value = self._ask("read", key, subindex)
        return value

    def write(self, key: int, subindex: int, value: Value) -> None:
        """Set an object's value; blocks, raises as ``SdoClient.write``."""
        self._ask("write", key, subindex, value)

    def write_unchecked(self, key: int, subindex: int, value: int) -> None:
        """Set an integer without checking the limits of the EDS; blocks."""
        self._ask("write_unchecked", key, subindex, value)

    def upload(self, index: int, subindex: int = 0) -> bytes:
        """Return an object's bytes; blocks, raises as ``SdoClient.upload``."""
        data: bytes = self._ask("upload", index, subindex)
        return data

    def download(
        self,
        index: int,
        subindex: int,
        data: bytes,
        *,
        way: SdoTransferType = SdoTransferType.AUTO,
        progress: Progress | None = None,
    ) -> None:
        """Set an object's bytes; blocks. ``progress`` is called when all have arrived."""
        self._ask("download", index, subindex, bytes(data), way)
        if progress is not None:
            progress(len(data), len(data))


class RemoteNmt(_OfNode):
    """The NMT state of a node by its heartbeats."""

    @property
    def state(self) -> NmtState:
        """The NMT state that it reported last."""
        state: NmtState = self._ask("nmt")
        return state

    @property
    def reports(self) -> int:
        """The number of its reports."""
        reports: int = self._ask("reports")
        return reports


class RemoteEmcy(_OfNode):
    """A node's emergency messages, and their incidents (``cia301.incident.EmcyLog``)."""

    @property
    def history(self) -> deque[Emcy]:
        """The newest 64 messages, oldest first."""
        return deque(self._ask("emcy"))

    @property
    def incidents(self) -> Iterable[Incident]:
        """The newest incidents, oldest first."""
        found: Iterable[Incident] = self._ask("incidents")
        return found


class RemoteNode(_OfNode):
    """A node as ``NodeParts.node``."""

    def __init__(self, calls: RpcClient, node_id: int) -> None:
        super().__init__(calls, node_id)
        self.node_id = node_id
        self.nmt = RemoteNmt(calls, node_id)
        self.emcy = RemoteEmcy(calls, node_id)

    def command(self, command: NmtCommand, timeout: float = 2.0) -> None:
        """Send an NMT command and wait until it is confirmed; blocks, raises as ``CanopenNode.command``."""
        self._ask("command", command, timeout)

    @property
    def pdo_events(self) -> list[PdoEvent]:
        """TPDOs that timed out, and returned."""
        found: list[PdoEvent] = self._ask("pdo_events")
        return found


class RemoteEvents(_OfNode):
    """The events of error control for a node; holds its listeners."""

    def __init__(self, calls: RpcClient, node_id: int) -> None:
        super().__init__(calls, node_id)
        self._hear: tuple[Callable[[NodeEvent], None], ...] = ()

    @property
    def events(self) -> list[NodeEvent]:
        """As ``NodeEvents.events``."""
        found: list[NodeEvent] = self._ask("events")
        return found

    def hear(self, call: Callable[[NodeEvent], None]) -> None:
        """Call ``call`` with every event from now on, in the thread of this program that delivers events."""
        if not self._hear:
            self._ask("watch")
        self._hear = (*self._hear, call)

    def tell(self, event: NodeEvent) -> None:
        """Deliver an event to all listeners."""
        for hear in self._hear:
            hear(event)
