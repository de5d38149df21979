"""A module on a channel: a ``cia402.port.Port`` for the scan, and a sender in the cycle of the bus (``bus.cycle.CycleSender``).

Received frames are stored with their stamp, in any thread, and processed at the beginning of a cycle. The frames of a stop are made
together with those of a cycle, so that another thread that finds the scan dead only has to send them.
"""

from __future__ import annotations

from collections import deque
from contextlib import ExitStack
from typing import NoReturn

from axisbus.boot.objects import Progress
from axisbus.bus.link.channel import Channel
from axisbus.bus.pdo.tpdo_timeout import PdoEvent
from axisbus.cia301.datatypes import Value
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.incident import EmcyLog
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.sdo import SdoTransferType
from axisbus.cia402.port import Capabilities, Inputs, Outputs
from axisbus.drives.gim6010.bus.run import frames_of
from axisbus.drives.gim6010.can_simple.port.port import ModulePort
from axisbus.drives.gim6010.can_simple.port.settings import ModuleSettings
from axisbus.drives.gim6010.cell import no_objects
from axisbus.errors import BusError

_LENGTH = 8
_KEPT = 1000  # queued frames: more means that the scan does not run
_Stop = tuple[tuple[tuple[int, bytes], ...], tuple[tuple[int, bytes], ...]]


class ModuleSender:
    """Holds the port of a module, its received frames, and the frames to send in this cycle."""

    asks = True  # requests messages by remote frames

    def __init__(self, channel: Channel, settings: ModuleSettings) -> None:
        """Listen on ``channel`` from now on."""
        self.port = ModulePort(settings)
        self.node = ModuleNode(self.port)
        self._restarts = 0
        self._offs = channel.offs
        self._channel = channel
        self._heard: deque[CanFrame] = deque(maxlen=_KEPT)
        self._listening = ExitStack()
        self._listening.enter_context(frames_of(channel, settings.node, self._heard))
        self._requests: list[tuple[int, int]] = []
        self._stop: _Stop = ((), ())

    @property
    def node_id(self) -> int:
        return self.port.settings.node

    # -- the scan's port ---------------------------------------------------------------------------------------------

    @property
    def capabilities(self) -> Capabilities:
        return self.port.capabilities

    def read(self, now: float) -> Inputs:
        """As ``Port.read``; processes the received frames first."""
        self.prime()
        inputs = self.port.read(now)
        for emcy in inputs.emcy:
            self.node.emcy.note(emcy)
        off = self._bus_off()
        return inputs if off is None else inputs._replace(operational=False, bus=off)

    def prime(self) -> None:
        """Process the received frames, before the first cycle and in each."""
        while self._heard:
            frame = self._heard.popleft()
            self.port.receive(frame, frame.time)
        hearing = self.port.hearing
        if hearing.restarts != self._restarts:
            self._restarts = hearing.restarts
            self.node.emcy.incidents.booted(hearing.restarted_at or 0.0)

    def write(self, outputs: Outputs) -> None:
        self.port.write(outputs)

    # -- the cycle of the bus ----------------------------------------------------------------------------------------

    def take_frames(self) -> list[tuple[int, bytes]]:
        frames = self.port.take_frames()
        self._requests = [(each.can_id, _LENGTH) for each in frames if each.remote]
        self._stop = (tuple((each.can_id, each.data) for each in self.port.stop_frames()), ())
        return [(each.can_id, each.data) for each in frames if not each.remote]

    def drop_frames(self) -> None:
        """As ``CycleSender.drop_frames``: no frame is sent again, so the values given to the module no longer count."""
        self.take_frames()
        self._requests = []
        self.port.forget()

    def take_requests(self, now: float) -> list[tuple[int, int]]:  # noqa: ARG002  # the port has decided that
        requests, self._requests = self._requests, []
        return requests

    def stop_frames(self) -> _Stop:
        """As ``CycleSender.stop_frames``; from any thread."""
        return self._stop

    def close(self) -> None:
        self._listening.close()

    def _bus_off(self) -> BusError | None:
        """Return the reason of a bus-off, at least once for each bus-off, however short it was."""
        offs, self._offs = self._offs, self._channel.offs
        if self._channel.off is None and offs == self._offs:
            return None
        return self._channel.off or self._channel.last_off


# ----------------------------------------------------------------------------------------------------------------------
# A module as a node for direct access: state, faults and restarts by its heartbeats; no objects and no NMT commands.


class NoObjects:
    """The objects of a module (``boot.objects.NodeObjects``), which has none. Each access is refused, and nothing is sent."""

    def __init__(self, node_id: int) -> None:
        self._node_id = node_id

    @property
    def node_id(self) -> int:
        return self._node_id

    def read(self, key: int, subindex: int = 0) -> Value:
        self._refuse(key, subindex)

    def write(self, key: int, subindex: int, value: Value) -> None:  # noqa: ARG002
        self._refuse(key, subindex)

    def write_unchecked(self, key: int, subindex: int, value: int) -> None:  # noqa: ARG002
        self._refuse(key, subindex)

    def upload(self, index: int, subindex: int = 0) -> bytes:
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
        return self._port.settings.node

    @property
    def state(self) -> NmtState:
        """The NMT state that a CANopen node in this situation would report."""
        return self._port.nmt

    @property
    def reports(self) -> int:
        return self._port.hearing.beats

    @property
    def stamp(self) -> float | None:
        return None if self._port.hearing.beat is None else self._port.hearing.beat_at

    @property
    def bootups(self) -> int:
        return self._port.hearing.restarts

    @property
    def bootup_stamp(self) -> float | None:
        return self._port.hearing.restarted_at

    @property
    def duplicate(self) -> str:
        """Empty: a second module with this node-ID cannot be detected."""
        return ""

    @property
    def deadline(self) -> float:
        return self._port.hearing.silent_from

    def overdue(self, now: float) -> bool:
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
