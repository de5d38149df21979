"""The program's representation of a core in a process of its own (``core.core.CoreInterface``)."""

from __future__ import annotations

import logging
import math
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from axisbus.boot.objects import Progress
from axisbus.boot.program_facts import ProgramOrder, ProgramRunState, ProgramWritten
from axisbus.boot.report import Booted
from axisbus.bus.node.events import NodeEvent
from axisbus.bus.pdo.tpdo_timeout import PdoEvent
from axisbus.cell.model import CellConfig
from axisbus.cell.other_protocols import objects_refused, with_dictionaries
from axisbus.cia301.datatypes import Value
from axisbus.cia301.emcy import Emcy
from axisbus.cia301.incident import Incident
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.cia301.sdo import SdoTransferType
from axisbus.clock import REAL, Clock
from axisbus.configuration.replacement_order import FoundDrive, ReplacementOrder, ReplacementOutcome, Tell
from axisbus.core.files import load_dictionaries
from axisbus.core.node_access_parts import NodeParts
from axisbus.core.process.launch import Processes
from axisbus.core.process.remote_proxy import SimulatedDrivesHandle
from axisbus.core.process.rpc_client import RpcClient, unanswered
from axisbus.core.process.session import Errors, RemoteSession
from axisbus.core.process.shared_counters import SharedCounters
from axisbus.core.process.trajectory_feeder import Feeder
from axisbus.drives.registry import make_of
from axisbus.eds.model import Eds
from axisbus.errors import AxisbusError
from axisbus.ipc import messages as m
from axisbus.ipc.image import ImageReader
from axisbus.ipc.io_image import IoImage
from axisbus.ipc.stream import MessageStream
from axisbus.link import StopResult

if TYPE_CHECKING:
    from axisbus.core.core import Joined
    from axisbus.core.process.listener import ClientConnection


log = logging.getLogger("axisbus")
_SLICE = 0.1  # seconds; waiting in slices lets signal handlers run on every platform
_CLOSE_MARGIN = 5.0  # seconds for leaving, in addition to the stop sequences
_RESCUE_TIMEOUT = 10.0  # seconds until the watchdog process has stopped every drive
# seconds until the watchdog process has killed a core that hangs, and stopped every drive
_KILL_TIMEOUT = 45.0
_CLOSE_TIME = 1.0
_CHUNK = 1 << 16  # bytes of a program in one message
_PROGRESS_PERIOD = 0.1  # seconds between two requests for the progress of a write
_JOIN_TIMEOUT = 30.0  # seconds until a core has answered, and halted moving axes if control is taken


class RemoteCore:
    """Holds the process, the connection to it, and the facts about its nodes."""

    realtime = outlives_program = True
    clock: Clock = REAL
    real_time_status = ""
    process = 0  # the core's ID
    commanded_by = ""  # the program with control when this program joined
    in_cycle: Callable[[], bool] | None = None

    def __init__(
        self, cell: CellConfig, process: Processes | ClientConnection, opening_request: m.OpenCell | m.Attach
    ) -> None:
        """Make ``process`` open ``cell``, or join it if it is open; blocks until that is done. Raises as ``Machine.open``."""
        self._cell = cell
        self._opening_request = opening_request
        self.joined = isinstance(opening_request, m.Attach)
        self._process = process
        self._dictionaries: Mapping[int, Eds] = {}
        self._opened: m.CellOpened | m.NotOpened | None = None
        self._changed = threading.Event()  # of opening, and of leaving
        self._left: m.Left | None = None
        self._joined: Joined = lambda _: None
        self._events: dict[int, RemoteEvents] = {}
        self.booted: dict[int, Booted] = {}
        self.nodes: dict[int, NodeParts] = {}
        self._errors = Errors()
        stream = MessageStream(process.line, m.CODEC.pack, "axisbus asks")
        self._rpc = RpcClient(stream, self._immediate_handlers(), self._deferred_handlers(), self._core_ended)
        image = ImageReader(process.memory, tuple(cell.axes), self._errors.of)
        io = IoImage(process.memory, len(cell.axes), tuple(cell.io))
        counters = SharedCounters(process.memory, len(cell.axes), len(cell.io))
        self.session = RemoteSession(
            self._rpc,
            image,
            io,
            counters,
            self._errors,
            {},
            cell.bus.scan_period,
            joined=process.watchdog is None,
        )
        self._watchdog_over = threading.Event()
        if process.watchdog is None:  # a joined program has none, and learns only that the core is gone
            self._watchdog_over.set()
        control = process.control
        self._control = None if control is None else SimulatedDrivesHandle(control)
        self.simulated_nodes = {} if self._control is None else self._control.simulated_nodes(cell.nodes)
        self._rpc.start()  # the core may end at once: all objects needed then exist now
        self._watchdog = self._monitor_watchdog(process.watchdog)
        try:
            self._open()
        except BaseException:
            self._end()
            raise

    def begin(self, joined: Joined, after_cycle: Callable[[], None] = lambda: None) -> None:  # noqa: ARG002  # of virtual time
        """As ``CoreInterface.begin``; the scan already runs."""
        self._joined = joined

    def await_values(self) -> None:
        """As ``CoreInterface.await_values``; the core has already done that."""

    def boot_node(self, node_id: int, on_step: Callable[[str], None] = lambda _: None) -> Booted:
        """As ``CoreInterface.boot_node``; the core boots the node."""
        self._rpc.ask("boot", node_id, progress=on_step)
        return self.booted[node_id]

    def reconnect(self) -> list[StopResult]:
        """As ``CoreInterface.reconnect``; the core opens the adapter again."""
        found: list[StopResult] = self._rpc.ask("reconnect")
        return found

    def find_replacement(self, node_id: int) -> list[FoundDrive]:
        """As ``CoreInterface.find_replacement``."""
        found: list[FoundDrive] = self._rpc.ask("find_replacement", node_id)
        return found

    def replace_drive(self, order: ReplacementOrder, on_step: Tell = lambda _: None) -> ReplacementOutcome:
        """As ``CoreInterface.replace_drive``; the core does it, also if this program ends meanwhile."""
        outcome: ReplacementOutcome = self._rpc.ask("replace_drive", order.node_id, order, progress=on_step)
        return outcome

    def write_program(
        self, node_id: int, order: ProgramOrder, progress: Progress | None = None
    ) -> ProgramWritten:
        """As ``CoreInterface.write_program``; the core continues if this program ends."""
        for offset in range(0, max(1, len(order.data)), _CHUNK):
            self._rpc.ask("program_data", node_id, offset, order.data[offset : offset + _CHUNK])
        self._rpc.ask("program_write", node_id, order.identification, order.deadline)
        shown = -1
        while True:
            state: ProgramRunState = self._rpc.ask("program_state", node_id)
            if progress is not None and state.done > shown and not state.ended:
                shown = state.done
                progress(state.done, state.total)
            if state.error is not None:
                raise state.error
            if state.written is not None:
                if progress is not None:
                    progress(state.written.size, state.written.size)
                return state.written
            time.sleep(_PROGRESS_PERIOD)

    def require_unclaimed(self, node_id: int, what: str) -> None:
        """As ``CoreInterface.require_unclaimed``; the core itself checks each request."""

    def leave(self, reason: str) -> list[AxisbusError]:
        """As ``CoreInterface.leave``; afterwards the process has ended."""
        began = time.monotonic()
        self._rpc.send(m.Leave(reason))
        times = [facts.parameters.stop_times.stop_sequence for facts in self.session.axes.values()]
        interruption = self._wait(
            lambda: self._left is not None or self._rpc.over, max(times, default=0.0) + _CLOSE_MARGIN
        )
        if self._left is None:
            # The core has died, or hangs: wait for its watchdog process, and do not interrupt it.
            seconds = _RESCUE_TIMEOUT if self._rpc.over else _KILL_TIMEOUT
            interruption = self._wait(self._watchdog_over.is_set, seconds) or interruption
        over, failed = self._rpc.over, self.session.failed
        self._end()
        if interruption is not None:
            raise interruption
        if self._left is not None:
            return list(self._left.failures)
        if not over:
            return [unanswered("the machine was closed", time.monotonic() - began)]
        if self.joined and not failed:
            return []  # the program that opened the machine has closed it meanwhile
        return [self._rpc.ended_error("the machine was closed")]

    def _wait(self, done: Callable[[], bool], seconds: float) -> BaseException | None:
        """Wait for an event; return the exception that interrupts this, to be raised when all axes are at standstill."""
        interruption: BaseException | None = None
        until = time.monotonic() + seconds
        while not done() and time.monotonic() < until:
            try:
                self._changed.wait(_SLICE)
                self._changed.clear()
            except BaseException as error:  # noqa: BLE001  # a user's own handler
                interruption = error
        return interruption

    def disown(self) -> None:
        """As ``CoreInterface.disown``."""
        for rpc in self._connections:
            rpc.disown()
        if self._control is not None:
            self._control.disown()
        self._process.disown()
        self.session.disown()

    @property
    def _feeder(self) -> Feeder:
        return self.session.trajectories.feeder

    def _end(self) -> None:
        self._feeder.close()
        for rpc in self._connections:
            rpc.close(_CLOSE_TIME)
        self._process.end()

    def _monitor_watchdog(self, line: socket.socket | None) -> RpcClient | None:
        """Start receiving the messages of the watchdog process."""
        if line is None:
            return None
        stream = MessageStream(line, m.CODEC.pack, "axisbus asks watchdog")
        watchdog = RpcClient(stream, {m.Rescued: self._take_rescued}, {}, self._watchdog_gone)
        watchdog.start()
        return watchdog

    @property
    def _connections(self) -> list[RpcClient]:
        return [self._rpc] if self._watchdog is None else [self._rpc, self._watchdog]

    # -- opening -------------------------------------------------------------------------------------------------------

    def _open(self) -> None:
        self._rpc.send(self._opening_request)
        self._dictionaries = with_dictionaries(self._cell, load_dictionaries(self._cell))  # meanwhile
        until = time.monotonic() + (_JOIN_TIMEOUT if self.joined else math.inf)
        while self._opened is None and not self._rpc.over and time.monotonic() < until:
            self._changed.wait(_SLICE)
        what = "the machine was being joined" if self.joined else "the machine was being opened"
        if self._opened is None and not self._rpc.over:
            raise unanswered(what, _JOIN_TIMEOUT)
        if self._opened is None:
            self._await_report()
            raise self._rpc.ended_error(what)
        if isinstance(self._opened, m.NotOpened):
            raise _open_error(self._opened)
        for node_id, facts in self._opened.nodes.items():
            self._take_node(node_id, facts)
        self.session.join(self._opened.axes)
        self.real_time_status, self.process = self._opened.real_time_status, self._opened.process
        self.commanded_by = self._opened.commanded_by if self.joined else ""
        self._process.watch_core(self.process)
        self._changed.clear()

    def _await_report(self) -> None:
        """Wait for the report of the watchdog process about the end of the core."""
        until = time.monotonic() + _RESCUE_TIMEOUT
        while not self._watchdog_over.wait(_SLICE) and time.monotonic() < until:
            pass

    def _take_node(self, node_id: int, facts: m.NodeFacts) -> None:
        self.booted[node_id] = Booted(facts.report, facts.parameters)
        events = RemoteEvents(self._rpc, node_id) if facts.watched else None
        if events is not None:
            self._events[node_id] = events
        objects = RemoteObjects(self._rpc, node_id)
        node = RemoteNode(self._rpc, node_id)
        self.nodes[node_id] = NodeParts(
            node_id,
            self._dictionaries[node_id],
            objects,
            node,
            REAL,
            facts.plans,
            events,
            objects_refused=objects_refused(self._cell, node_id),
            make=make_of(self._dictionaries[node_id], self._cell.nodes[node_id].makes),
        )

    # -- messages of the core ------------------------------------------------------------------------------------------

    def _immediate_handlers(self) -> dict[type, Callable[..., None]]:
        return {
            m.CellOpened: self._take_opened,
            m.NotOpened: self._take_opened,
            m.ErrorMessage: self._errors.take,
            m.CoreCondition: lambda condition: self.session.take(condition),
            m.Left: self._take_left,
            m.WantSamples: lambda want: self._feeder.request(want.stream, want.first, want.count),
            m.StreamOver: lambda over: self._feeder.drop(over.stream),
        }

    def _deferred_handlers(self) -> dict[type, Callable[..., None]]:
        return {
            m.CommandEvents: lambda message: self.session.deliver(message),
            m.CycleImages: lambda cycles: self.session.deliver_images(cycles),
            m.Frames: lambda frames: self.session.deliver_frames(frames),
            m.NodeEventMessage: self._deliver_event,
            m.NodeJoined: self._join,
        }

    def _take_opened(self, opened: m.CellOpened | m.NotOpened) -> None:
        self._opened = opened
        self._changed.set()

    def _take_left(self, left: m.Left) -> None:
        self._left = left
        self._rpc.last, self._rpc.has_left = left.last, True
        self._changed.set()

    def _deliver_event(self, message: m.NodeEventMessage) -> None:
        self._events[message.event.node].deliver(message.event)

    def _join(self, joined: m.NodeJoined) -> None:
        self._take_node(joined.node, joined.facts)
        self.session.join(joined.axes)
        self._joined(self.booted[joined.node])

    def _take_rescued(self, rescued: m.Rescued) -> None:
        self._rpc.rescued = rescued

    def _watchdog_gone(self) -> None:
        self._watchdog_over.set()
        self._changed.set()

    def _core_ended(self) -> None:
        """Handle the end of the core. If it had not left, wait for the result of its watchdog process."""
        if self._left is None:
            self._watchdog_over.wait(_RESCUE_TIMEOUT)
        if self._rpc.lost:
            log.error("%s", self._rpc.ended_error("the machine no longer runs"))
        self.session.end_all()
        self._changed.set()


def _open_error(message: m.NotOpened) -> BaseException:
    """Return the error of an open that failed."""
    if not message.message:
        return message.errors[0]
    return ExceptionGroup(message.message, message.errors)


# -- A node of a core in another process, for direct access: each access is a request to the core ----------------------


class _NodeProxy:
    """A part of a node; its values are requested from the core."""

    def __init__(self, rpc: RpcClient, node_id: int) -> None:
        self._rpc = rpc
        self._node_id = node_id

    def _ask(self, what: str, *arguments: Any) -> Any:
        return self._rpc.ask(what, self._node_id, *arguments)


class RemoteObjects(_NodeProxy):
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
        transfer_type: SdoTransferType = SdoTransferType.AUTO,
        progress: Progress | None = None,
    ) -> None:
        """Set an object's bytes; blocks. ``progress`` is called when all have arrived."""
        self._ask("download", index, subindex, bytes(data), transfer_type)
        if progress is not None:
            progress(len(data), len(data))


class RemoteNmt(_NodeProxy):
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


class RemoteEmcy(_NodeProxy):
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


class RemoteNode(_NodeProxy):
    """A node as ``NodeParts.node``."""

    def __init__(self, rpc: RpcClient, node_id: int) -> None:
        super().__init__(rpc, node_id)
        self.node_id = node_id
        self.nmt = RemoteNmt(rpc, node_id)
        self.emcy = RemoteEmcy(rpc, node_id)

    def command(self, command: NmtCommand, timeout: float = 2.0) -> None:
        """Send an NMT command and wait until it is confirmed; blocks, raises as ``CanopenNode.command``."""
        self._ask("command", command, timeout)

    @property
    def pdo_events(self) -> list[PdoEvent]:
        """TPDOs that timed out, and returned."""
        found: list[PdoEvent] = self._ask("pdo_events")
        return found


class RemoteEvents(_NodeProxy):
    """The events of error control for a node; holds its listeners."""

    def __init__(self, rpc: RpcClient, node_id: int) -> None:
        super().__init__(rpc, node_id)
        self._callbacks: tuple[Callable[[NodeEvent], None], ...] = ()

    @property
    def events(self) -> list[NodeEvent]:
        """As ``NodeEvents.events``."""
        found: list[NodeEvent] = self._ask("events")
        return found

    def subscribe(self, callback: Callable[[NodeEvent], None]) -> None:
        """Call ``callback`` with every event from now on, in the thread of this program that delivers events."""
        if not self._callbacks:
            self._ask("watch")
        self._callbacks = (*self._callbacks, callback)

    def deliver(self, event: NodeEvent) -> None:
        """Deliver an event to all listeners."""
        for callback in self._callbacks:
            callback(event)
