"""The requests of one client to a core, and the messages to it; each kind of message has one function."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from axisbus.cia301.frame import CanFrame
from axisbus.core.node_access_parts import NodeParts
from axisbus.core.process.publisher import ClientOutbox
from axisbus.core.process.trajectory_feeder import Streams
from axisbus.errors import AxisbusError, OwnershipError, ScanError, StateError, Stopped, one_line
from axisbus.ipc import messages as m
from axisbus.ipc.messages import CoreCondition
from axisbus.ipc.stream import MessageStream
from axisbus.motion import commands as c
from axisbus.motion.command_status import ENDED, Status
from axisbus.motion.group.commands import ForEach
from axisbus.session import AnyCommand, CommandEvent, MachineSession

if TYPE_CHECKING:
    from axisbus.core.process.clients import Clients


log = logging.getLogger("axisbus")
STOPS = (c.Halt, c.QuickStop)  # commands that every client may give
NUMBERS = 1 << 32  # command numbers of one client
_MAX_REQUESTS = 64  # requests of one client that may wait for their answers


Command = AnyCommand


# -- The requests of a program to its core, apart from commands: one row for each, answered by plain values ------------


# Of the core itself; in the order of ``MachineSession``.
CORE_REQUESTS: Mapping[str, Callable[[MachineSession], Any]] = {
    "node_events": lambda session: session.node_events,
    "bus_events": lambda session: session.bus_events,
    "commands": lambda session: session.commands,
    "drops": lambda session: session.drops,
    "sdo_counts": lambda session: session.sdo_counts,
    "programs": lambda session: session.programs,  # while the core runs, ``clients`` answers this
    "bus_time": lambda session: session.bus_time,
}


# Of one node; the further parameters are the arguments of the request.
NODE_REQUESTS: Mapping[str, Callable[..., Any]] = {
    "read": lambda parts, *key: parts.objects.read(*key),
    "write": lambda parts, *what: parts.objects.write(*what),
    "write_unchecked": lambda parts, *what: parts.objects.write_unchecked(*what),
    "upload": lambda parts, *key: parts.objects.upload(*key),
    "download": lambda parts, index, subindex, data, transfer_type: parts.objects.download(
        index, subindex, data, transfer_type=transfer_type
    ),
    "nmt": lambda parts: parts.node.nmt.state,
    "reports": lambda parts: parts.node.nmt.reports,
    "command": lambda parts, command, timeout: _command_node(parts, command, timeout),
    "emcy": lambda parts: list(parts.node.emcy.history),
    "incidents": lambda parts: list(parts.node.emcy.incidents),
    "pdo_events": lambda parts: list(parts.node.pdo_events),
    "events": lambda parts: [] if parts.events is None else parts.events.events,
}


# Requests that change something, as messages name them: only for the client with control.
COMMANDING = {
    "write": "a value",
    "write_unchecked": "a value",
    "download": "a value",
    "command": "an NMT command",
}


# Requests about a node that are still of interest after the core has ended.
_CACHED_REQUESTS = ("nmt", "reports", "emcy", "incidents", "pdo_events", "events")


def last_answers(session: MachineSession, nodes: Mapping[int, NodeParts]) -> dict[tuple[int, str], Any]:
    """Return the present answers to all requests without a transfer, by node (0: the core) and request."""
    found: dict[tuple[int, str], Any] = {(0, what): answer(session) for what, answer in CORE_REQUESTS.items()}
    for node_id, parts in nodes.items():
        found.update({(node_id, what): NODE_REQUESTS[what](parts) for what in _CACHED_REQUESTS})
    return found


def _command_node(parts: NodeParts, command: object, timeout: float) -> None:
    parts.node.command(command, timeout)


def condition_of(session: MachineSession) -> CoreCondition:
    """Return the present condition of a core."""
    return CoreCondition(session.dead, session.ended, session.failed, session.left)


def sendable(error: BaseException) -> AxisbusError:
    """Return an error that can be sent: one outside the tree becomes the cause of a ScanError."""
    if isinstance(error, AxisbusError):
        return error
    made = ScanError(
        "the core aborted the request",
        observed=one_line(error),
        remedy="this is a mistake in axisbus: please report it",
    )
    made.__cause__ = error
    return made


# -- client handler ----------------------------------------------------------------------------------------------------


class ClientHandler:
    """One client of a core; holds the connection, its trajectories, and why its commands are refused. For one thread."""

    def __init__(
        self,
        clients: Clients,
        client_number: int,
        stream: MessageStream,
        outbox: ClientOutbox,
        client_name: str,
    ) -> None:
        """``client_number``: 0 for the program that opened the cell; ``client_name``: for messages."""
        self.stream = stream
        self.outbox = outbox
        self.name = client_name  # for messages
        self.watched: set[int] = set()  # nodes whose events it wants
        self.leaving_because: str | None = None  # why its commands are no longer accepted
        self._clients = clients
        self.client_number = client_number
        self._tapped = False
        self._streams = Streams(stream.send)
        self._request_slots = threading.Semaphore(_MAX_REQUESTS)

    def take(self, message: object) -> bool:
        """Execute a message; return whether that was possible."""
        try:
            _TAKES[type(message)](self, message)
        except Exception:  # its other messages, possibly a stop, must still be executed
            # messages of joined programs do not belong in the opener's log
            level = logging.INFO if self.client_number else logging.ERROR
            log.log(
                level,
                "a message of %s could not be processed: %s",
                self.name,
                type(message).__name__,
                exc_info=True,
            )
            return False
        return True

    def poll(self) -> None:
        """Request the samples that will be needed, and send the frames since the last call; called every few milliseconds."""
        self._streams.poll()
        if self._tapped:
            self.outbox.flush_frames()

    def warn(self, text: str) -> None:
        """Write a warning to the client's log."""
        self.stream.send(m.Logged(log.name, logging.WARNING, text))

    def send_event(self, event: CommandEvent) -> None:
        """Send a status change of this client's command. Ends caused by the end of the scan are sent after that end itself."""
        if self._clients.core.session.ended:
            self.outbox.add(event)
        else:
            self._clients.publisher.send_event(self.outbox, event)

    def _submit(self, message: m.Submit) -> None:
        if not 0 < message.number < NUMBERS:
            raise ValueError(message.number)
        try:
            with self._clients.command_lock:
                end_event = self._submit_command(message)
        except AxisbusError as error:
            end_event = CommandEvent(message.number, Status.ERROR, error, "")
        if end_event is not None:
            self.send_event(end_event._replace(number=message.number))

    def _submit_command(self, message: m.Submit) -> CommandEvent | None:
        refused = self._refusal(message.command, message.name)
        if refused is not None:
            raise refused
        command = self._streams.take(message)
        name = f"{message.name} by {self.name}" if self.client_number else message.name
        return self._clients.submit(
            self.client_number * NUMBERS + message.number, message.target, command, name
        )

    def _refusal(self, command: Command, name: str) -> AxisbusError | None:
        if is_stop(command):
            return None
        if self.leaving_because is not None:
            return Stopped(f"{name} did not begin", observed=self.leaving_because)
        return self._clients.refusal(self, name)

    def _ask(self, message: m.CoreQuery) -> None:
        if self.client_number and not self._request_slots.acquire(blocking=False):
            error = StateError(f"{message.what} was not requested", observed="too many requests at a time")
            self.stream.send(m.CoreReply(message.number, None, error))
            return
        self._clients.pool.submit(self._answer, message)

    def _answer(self, message: m.CoreQuery) -> None:
        try:
            answer = m.CODEC.pack(m.CoreReply(message.number, self._answer_of(message)))
        except BaseException as error:  # noqa: BLE001  # whatever it was, a caller waits for the answer
            self.stream.send(m.CoreReply(message.number, None, sendable(error)))
        else:
            self.stream.send(answer)
        finally:
            if self.client_number:
                self._request_slots.release()

    def _answer_of(self, message: m.CoreQuery) -> object:
        core = self._clients.core
        if not message.node and message.what in CLIENT_REQUESTS:
            return CLIENT_REQUESTS[message.what](self)
        if not message.node:
            return CORE_REQUESTS[message.what](core.session)
        if message.what in _BOOT_REQUESTS:
            return self._boot_up(message)
        if message.what in PROGRAM_REQUESTS:
            return PROGRAM_REQUESTS[message.what](self, message.node, *message.arguments)
        if message.what == "watch":
            self._clients.watch(message.node)
            self.watched.add(message.node)
            return None
        if message.what in COMMANDING:
            self._require_control(message.what)
            core.require_unclaimed(message.node, COMMANDING[message.what])
        return NODE_REQUESTS[message.what](core.nodes[message.node], *message.arguments)

    def _boot_up(self, message: m.CoreQuery) -> object:
        """Execute a request that boots a node; the node's facts are sent to every client by ``NodeJoined``."""
        title, work = _BOOT_REQUESTS[message.what]
        self._require_control(f"{title} node {message.node}")

        def on_step(step: object) -> None:
            self.stream.send(m.CoreProgress(message.number, step))

        return work(self._clients.core, on_step, message.node, *message.arguments)

    def _take_program_data(self, node_id: int, offset: int, data: bytes) -> None:
        self._require_control(f"writing the program of node {node_id}")
        self._clients.program_runs.take_data(self.client_number, node_id, offset, data)

    def _write_program(self, node_id: int, identification: int | None, deadline: float | None) -> None:
        """Begin to write the program that the client has sent; its end is found by ``_program_state``."""
        self._require_control(f"writing the program of node {node_id}")
        runs = self._clients.program_runs
        self._clients.pool.submit(
            runs.run, node_id, runs.begin(self.client_number, node_id, identification, deadline)
        )

    def _program_state(self, node_id: int) -> object:
        return self._clients.program_runs.state(node_id)

    def _require_control(self, what: str) -> None:
        refused = self._clients.refusal(self, what)
        if refused is not None:
            raise refused

    def _programs(self) -> object:
        return self._clients.programs

    def _has_control(self) -> bool:
        return self._clients.refusal(self, "") is None

    def _take_control(self) -> None:
        self._clients.give_control(self, take=True)

    def _reconnect(self) -> object:
        self._require_control("opening the adapter again")
        return self._clients.core.reconnect()

    def _observe(self, message: m.Observe) -> None:
        self.outbox.observed = message.wanted

    def _tap(self, message: m.Tap) -> None:
        self.outbox.frames.select(message.can_ids)
        if message.wanted == self._tapped:
            return
        self._tapped = message.wanted
        session = self._clients.core.session
        if message.wanted:
            session.tap(self._queue_frames)
        else:
            session.untap(self._queue_frames)

    def _queue_frames(self, frames: Sequence[CanFrame]) -> None:
        for frame in frames:
            self.outbox.frames.put(frame)

    def release(self) -> None:
        """Release the client's data: it is gone, and gets no control any more."""
        self.leaving_because = self.leaving_because or "it is gone"
        self._tap(m.Tap(False))

    def _add_group(self, message: m.AddGroup) -> None:
        self._clients.core.session.add_group(message.key, message.members)

    def _feed(self, message: m.TrajectorySamples) -> None:
        self._streams.feed(message)

    def _fail(self, message: m.NoSamples) -> None:
        self._streams.fail(message)

    def _request_stop(self, message: m.RequestStop) -> None:
        self._clients.request_stop(self, message.reason, message.quick)

    def _request_halt(self, message: m.RequestHalt) -> None:
        self._clients.request_halt(self, message.reason, message.number)

    def _hold_to_run(self, message: m.HoldToRunMessage) -> None:
        self._clients.hold_to_run(self, message.seconds, message.continuous)

    def _leave(self, message: m.Leave) -> None:
        """Leave: only for a joined program, because the program that opened the cell closes the whole machine."""
        self.leaving_because = message.reason
        self._clients.give_up(self, f"{self.name} left: {message.reason}")
        core = self._clients.core
        self.stream.send(m.Left((), last_answers(core.session, core.nodes)))


_TAKES: dict[type, Callable[[ClientHandler, Any], None]] = {
    m.Submit: ClientHandler._submit,
    m.AddGroup: ClientHandler._add_group,
    m.Observe: ClientHandler._observe,
    m.Tap: ClientHandler._tap,
    m.CoreQuery: ClientHandler._ask,
    m.TrajectorySamples: ClientHandler._feed,
    m.NoSamples: ClientHandler._fail,
    m.RequestStop: ClientHandler._request_stop,
    m.RequestHalt: ClientHandler._request_halt,
    m.HoldToRunMessage: ClientHandler._hold_to_run,
    m.Leave: ClientHandler._leave,
}


# Requests that boot a node, or find its new drive: only for the client with control. Each with its title; the second
# argument of the function sends each step to the client.
_BOOT_REQUESTS: dict[str, tuple[str, Callable[..., object]]] = {
    "boot": ("booting", lambda core, on_step, node: _none(core.boot_node(node, on_step))),
    "find_replacement": ("replacing", lambda core, _, node: core.find_replacement(node)),
    "replace_drive": ("replacing", lambda core, on_step, _, order: core.replace_drive(order, on_step)),
}


def _none(_: object) -> None:
    """Return no answer: a boot-up result is not sent."""


# Requests about the clients, and not about the core.
CLIENT_REQUESTS: dict[str, Callable[[ClientHandler], object]] = {
    "programs": ClientHandler._programs,
    "has_control": ClientHandler._has_control,
    "take_control": ClientHandler._take_control,
    "reconnect": ClientHandler._reconnect,
}


# Requests about the program of a node; it is sent in parts.
PROGRAM_REQUESTS: dict[str, Callable[..., object]] = {
    "program_data": ClientHandler._take_program_data,
    "program_write": ClientHandler._write_program,
    "program_state": ClientHandler._program_state,
}


def is_stop(command: Command) -> bool:
    """Whether a command only stops axes, so that any client may give it."""
    each = command.commands.values() if isinstance(command, ForEach) else [command]
    return all(isinstance(one, STOPS) for one in each)


def no_control(name: str, holder: str, *, joined: bool, handing_over: bool = False) -> OwnershipError:
    """Return the error of a request that needs control; ``holder`` has control (empty: no client).

    ``handing_over``: control is being passed from one client to another.
    """
    has = f"{holder or 'no program'} has control"
    if handing_over:
        has, remedy = "control is being handed over: moving axes are being halted", "try again in a moment"
    elif not joined:
        remedy = "control returns when that program leaves" if holder else "join it with Machine.attach"
    elif holder:
        remedy = (
            "wait until it leaves; or halt the moving axes and take control: Machine.attach(cell, command=True, "
            "force=True)"
        )
    else:
        remedy = "join the machine with control: Machine.attach(cell, command=True)"
    return OwnershipError(
        f"{name}: this program does not have control of the machine; it may only read, halt and quick-stop",
        observed=has,
        remedy=remedy,
    )


# -- Commands that are identical to a queued one: they share its events ------------------------------------------------


_MAX_ENDED = 256  # ended commands


class DuplicateCommands:
    """Holds the identical commands, and the ends of the last commands; for any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._same: dict[int, list[int]] = {}  # by the number of the queued one
        self._ended: dict[int, CommandEvent] = {}

    def join(self, number: int, queued_number: int) -> CommandEvent | None:
        """Make ``number`` share the events of ``queued_number``; return the end of that, if it has ended meanwhile."""
        with self._lock:
            end_event = self._ended.get(queued_number)
            if end_event is not None:
                return end_event._replace(number=number)
            self._same.setdefault(queued_number, []).append(number)
        return None

    def all_of(self, event: CommandEvent) -> list[CommandEvent]:
        """Return the event of a command, and a copy for each command that is identical to it."""
        with self._lock:
            same = self._same.get(event.number, [])
            if event.status in ENDED:
                self._same.pop(event.number, None)
                self._ended[event.number] = event
            if len(self._ended) > _MAX_ENDED:
                del self._ended[next(iter(self._ended))]
        return [event, *(event._replace(number=number) for number in same)]
