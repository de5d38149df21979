"""A module as a node for direct access: state, faults and restarts by its heartbeats; no objects and no NMT commands."""

from __future__ import annotations

from typing import NoReturn

from axisbus.boot.objects import Progress
from axisbus.bus.pdo.tpdo_timeout import PdoEvent
from axisbus.cell.can_simple.modules import no_objects
from axisbus.cia301.datatypes import Value
from axisbus.cia301.incident import EmcyLog
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.sdo import SdoTransferType
from axisbus.drives.gim6010.can_simple.port.port import ModulePort


class NoObjects:
    """The objects of a module (``boot.objects.NodeObjects``), which has none. Each access is refused, and nothing is sent."""

    def __init__(self, node_id: int) -> None:
        self._node_id = node_id

    @property
    def node_id(self) -> int:
        """The node's ID."""
        return self._node_id

    def read(self, key: int, subindex: int = 0) -> Value:
        """Refuse; raises StateError."""
        self._refuse(key, subindex)

    def write(self, key: int, subindex: int, value: Value) -> None:  # noqa: ARG002
        """Refuse; raises StateError."""
        self._refuse(key, subindex)

    def write_unchecked(self, key: int, subindex: int, value: int) -> None:  # noqa: ARG002
        """Refuse; raises StateError."""
        self._refuse(key, subindex)

    def upload(self, index: int, subindex: int = 0) -> bytes:
        """Refuse; raises StateError."""
        self._refuse(index, subindex)

    def download(
        self,
        index: int,
        subindex: int,
        data: bytes,  # noqa: ARG002
        *,
        way: SdoTransferType = SdoTransferType.AUTO,  # noqa: ARG002
        progress: Progress | None = None,  # noqa: ARG002
    ) -> None:
        """Refuse; raises StateError."""
        self._refuse(index, subindex)

    def _refuse(self, index: int, subindex: int) -> NoReturn:
        raise no_objects(
            self._node_id, f"it has no object dictionary, so it has no {index:04X}h:{subindex:02X}"
        )


class ModuleMonitor:
    """The state of a module by its heartbeats (``bus.node.events.Monitored``); times in s, monotonic."""

    guarded = False

    def __init__(self, port: ModulePort) -> None:
        self._port = port

    @property
    def node_id(self) -> int:
        """The node's ID."""
        return self._port.settings.node

    @property
    def state(self) -> NmtState:
        """The NMT state that a CANopen node in this situation would report."""
        return self._port.nmt

    @property
    def reports(self) -> int:
        """The number of received heartbeats."""
        return self._port.hearing.beats

    @property
    def stamp(self) -> float | None:
        """The time of the last heartbeat."""
        return None if self._port.hearing.beat is None else self._port.hearing.beat_at

    @property
    def bootups(self) -> int:
        """The number of restarts."""
        return self._port.hearing.restarts

    @property
    def bootup_stamp(self) -> float | None:
        """The time of the last restart that was seen."""
        return self._port.hearing.restarted_at

    @property
    def duplicate(self) -> str:
        """Empty: a second module with this node-ID cannot be detected."""
        return ""

    @property
    def deadline(self) -> float:
        """The time at which the next heartbeat is overdue."""
        return self._port.hearing.silent_from

    def overdue(self, now: float) -> bool:
        """Whether the next heartbeat is overdue."""
        return self._port.hearing.is_silent(now)


class ModuleNode:
    """One module (``core.node_access_parts.NodeParts.node``); holds the log of its faults, as emergency messages."""

    def __init__(self, port: ModulePort) -> None:
        self.node_id = port.settings.node
        self.nmt = ModuleMonitor(port)
        self.emcy = EmcyLog()
        self.pdo_events: list[PdoEvent] = []  # it has no PDOs

    def command(self, command: NmtCommand, timeout: float = 2.0) -> None:  # noqa: ARG002
        """Refuse; raises StateError."""
        raise no_objects(
            self.node_id,
            f"it has no NMT states, so it does not accept {command.name.lower().replace('_', ' ')}",
        )
