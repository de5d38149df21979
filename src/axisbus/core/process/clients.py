"""The clients of a core: the program that opened it, and programs that have joined. One has control; all may stop.

Theory of operation
-------------------
Each client has a ``ClientHandler``. The scan knows its commands by the client's own numbers and its client number, so that their
ends reach it. Control belongs to the program that opened the cell, or to no client if that program shares the cell. A joined
program gets control if it is free, or takes it. When control passes to another client, or its holder is gone, all moving axes halt
before another client may command.

A program that only wants axes to stop (``listener.StopRequest``) is no client, and counts as none: its request is always accepted,
however many clients there are.

A joined program that is slow, faulty or malicious cannot disturb the scan. Its messages are short and limited in number; if it does
not read its messages, they are dropped with it; and the number of such programs is limited.
"""

from __future__ import annotations

import itertools
import logging
import socket
import struct
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress

from axisbus.bus.link.ownership import described
from axisbus.core.core import Core
from axisbus.core.process.client_handler import (
    NUMBERS,
    ClientHandler,
    Command,
    DuplicateCommands,
    condition_of,
    no_control,
)
from axisbus.core.process.listener import (
    ClientListener,
    StopAnswer,
    StopRequest,
    answer_stop,
    refuse,
    send_images,
)
from axisbus.core.process.program_run import ProgramRuns
from axisbus.core.process.publisher import Publisher
from axisbus.errors import AxisbusError, OwnershipError, StateError
from axisbus.errors import Stopped as StoppedError
from axisbus.ipc import messages as m
from axisbus.ipc.rate import CORE_BURST, CORE_RATE, Bucket
from axisbus.ipc.stream import MessageStream
from axisbus.link import StopResult
from axisbus.motion import commands as c
from axisbus.motion.command_status import ENDED, Status
from axisbus.motion.commands import HandOver, QuickStop
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import MOVING, AxisState
from axisbus.session import ClientProgram, CommandEvent, Target
from axisbus.version import __version__

log = logging.getLogger("axisbus")
_MAX_CLIENTS = 16  # joined programs
_MAX_STOP_REQUESTS = 64  # stop requests that wait for their result at the same time
_OWN_COMMANDS = 1 << 20  # the client number of commands that come from no client
_MAX_MESSAGE = 1 << 18  # bytes of a joined program's message
_HANDSHAKE_TIMEOUT = struct.pack("ll", 5, 0)  # 5 s for the first message, and for sending to the program
_NO_TIMEOUT = struct.pack("ll", 0, 0)
_MARGIN = 2.0  # seconds in addition to the stop sequences
_CLOSE_TIME = 1.0  # seconds


class _CommandEnd:
    """The end of a command that comes from no client: ``has_ended`` is set when it has ended, then ``event``."""

    def __init__(self) -> None:
        self.has_ended = threading.Event()
        self.event: CommandEvent | None = None
        self.event_at = 0.0


_Stop = dict[str, _CommandEnd | None]  # axis -> the end of its stop; None: its node has not come up


class Clients:
    """Holds the client handlers, the client with control, and the pending requests; for any thread."""

    def __init__(self, core: Core, publisher: Publisher, pool: ThreadPoolExecutor) -> None:
        self.core = core
        self.publisher = publisher
        self.pool = pool
        self._lock = threading.Lock()  # of the clients; loops over them use the last complete dictionary
        self.program_runs = ProgramRuns(core)
        self._duplicates = DuplicateCommands()
        self._condition = m.CoreCondition()
        self._handlers: dict[int, ClientHandler] = {}
        self._client_numbers = itertools.count()
        self._numbers = itertools.count(1)
        self._pending_ends: dict[int, _CommandEnd] = {}
        self._watched: set[int] = set()
        self._handover_lock = threading.Lock()  # held while control passes from one client to another
        # of a command: held from the check whether its client may give it until the scan has it
        self.command_lock = threading.Lock()
        self._opener: ClientHandler | None = None
        self._holder: ClientHandler | None = None
        core.session.listen(self._on_event)

    # -- clients -------------------------------------------------------------------------------------------------------

    def admit(self, stream: MessageStream, client_name: str) -> ClientHandler:
        """Add a client."""
        with self._lock:
            handler = ClientHandler(
                self, next(self._client_numbers), stream, self.publisher.admit(stream), client_name
            )
            self._handlers = {**self._handlers, handler.client_number: handler}
        return handler

    def open_for(self, program: ClientHandler, shared: bool) -> None:
        """Give control to the program that opened the cell, unless it shares the cell."""
        self._opener = self._holder = None if shared else program

    def dismiss(self, handler: ClientHandler) -> None:
        """Remove a client that is gone. If it had control, moving axes halt. Blocks until that is done."""
        handler.release()
        self.give_up(handler, f"{handler.name}, which had control, has left")
        with self._lock:
            self.publisher.dismiss(handler.outbox)
            self._handlers = {
                client_number: one for client_number, one in self._handlers.items() if one is not handler
            }

    def send_to_all(self, message: m.Message) -> None:
        """Send a message to every client."""
        for handler in self._handlers.values():
            handler.stream.send(message)

    def send_condition(self) -> None:
        """Send the core's condition to every client if it has changed; after the end of the scan, then flush the command events."""
        now = condition_of(self.core.session)
        if now != self._condition:
            self.send_to_all(now)
            self._condition = now
        if now.ended:  # afterwards, so that a client that sees the end of a command knows the reason
            self.publisher.flush()

    def poll(self) -> None:
        """Do the work that is due every few milliseconds."""
        for handler in self._handlers.values():
            handler.poll()

    def watch(self, node_id: int) -> None:
        """Send the events of a node to the clients that requested them."""
        if node_id in self._watched:
            return
        self._watched.add(node_id)
        events = self.core.nodes[node_id].events
        assert events is not None
        events.subscribe(lambda event: self._send_node_event(node_id, m.NodeEventMessage(event)))

    def _send_node_event(self, node_id: int, message: m.NodeEventMessage) -> None:
        for handler in self._handlers.values():
            if node_id in handler.watched:
                handler.stream.send(message)

    # -- control -------------------------------------------------------------------------------------------------------

    @property
    def commanded_by(self) -> str:
        """The client with control, as text; empty if there is none."""
        return "" if self._holder is None else self._holder.name

    @property
    def programs(self) -> tuple[ClientProgram, ...]:
        """The clients: the program that opened the cell first, then the joined ones in their order."""
        return tuple(
            ClientProgram(
                handler.name, handler is self._holder, handler.outbox.lost, handler.outbox.frames.lost
            )
            for handler in self._handlers.values()
        )

    def refusal(self, handler: ClientHandler, name: str) -> OwnershipError | None:
        """Return why a client may not command, None if it may."""
        if handler is self._holder:
            return None
        return no_control(
            name,
            self.commanded_by,
            joined=handler.client_number != 0,
            handing_over=self._handover_lock.locked(),
        )

    def give_control(self, handler: ClientHandler, take: bool) -> None:
        """Give control to a client. If it is taken from another client, moving axes halt first. Blocks until that is done.

        Harmless if the client has control. Raises:
            OwnershipError: another client has control, and ``take`` is not set.
            StateError: the halt of an axis is not confirmed. Stopped: the client is gone, or is leaving.
        """
        with self._handover_lock:
            if handler is self._holder:
                return
            if handler.leaving_because is not None:
                raise StoppedError("control was not granted", observed=handler.leaving_because)
            if self._holder is not None and not take:
                raise no_control("control is requested", self.commanded_by, joined=True)
            if self._holder is not None:
                self._holder.warn(f"{handler.name} took control of the machine: moving axes halt")
            self._withdraw_control()
            # After the end of the scan no axis can be commanded, and the client may open the adapter again.
            ended = self.core.session.ended
            moving = [] if ended else self.halt(f"{handler.name} took control of the machine")
            self._holder = self._opener if moving else handler
        if moving:
            raise StateError(
                "control was not granted: an axis does not come to standstill",
                observed="; ".join(moving),
                remedy="stop the machine: axisbus stop CELL",
            )

    def give_up(self, handler: ClientHandler, reason: str, quick: bool = False) -> None:
        """Take control from a client that must not have it any more; moving axes halt first. Blocks until that is done."""
        with self._handover_lock:
            if handler is not self._holder or handler is self._opener:
                return
            self._withdraw_control()
            self.halt(reason, quick)
            self._holder = self._opener

    def _withdraw_control(self) -> None:
        with self.command_lock:
            self._holder = None
            self.core.scan.hold_to_run(None, "")

    def halt(self, reason: str, quick: bool = False) -> list[str]:
        """Halt (or quick-stop) every axis that was set in motion; return the axes whose stop is not confirmed, and why. Blocks."""
        ends = {}
        for name, snapshot in self.core.session.snapshots.items():
            moves = snapshot.state in MOVING or snapshot.state is AxisState.STOPPING
            command = QuickStop() if quick and moves else HandOver(reason)
            ends[name] = self._command_axis(name, command, f"{name}.halt")
        until = time.monotonic() + self.stop_within
        reasons = {name: _unconfirmed(end, until) for name, end in ends.items()}
        return [f"{name}: {reason.splitlines()[0]}" for name, reason in reasons.items() if reason]

    @property
    def stop_within(self) -> float:
        """The maximum duration of a stop of all axes, in seconds."""
        times = [facts.parameters.stop_times.stop_sequence for facts in self.core.session.axes.values()]
        return max(times, default=0.0) + _MARGIN

    def begin_stop(self, axes: Sequence[str], quick: bool, client_name: str) -> _Stop:
        """Quick-stop or halt these axes, or all of the cell if ``axes`` is empty, for ``client_name``; does not block."""
        verb, there = "quick_stop" if quick else "halt", self.core.session.axes
        names = list(axes or self.core.cell.axes)
        ends = {
            name: self._command_axis(
                name, c.QuickStop() if quick else c.Halt(), f"{name}.{verb}() by {client_name}"
            )
            for name in names
            if name in there
        }
        return {name: ends.get(name) for name in names}

    def await_stop(self, ends: _Stop, quick: bool) -> list[StopResult]:
        """Return the results of ``begin_stop`` for each axis; blocks."""
        until = time.monotonic() + self.stop_within
        return [self._stop_result(name, end, until, quick) for name, end in ends.items()]

    def _stop_result(self, name: str, end: _CommandEnd | None, until: float, quick: bool) -> StopResult:
        if end is None:
            return StopResult(name, False, "NOT REACHED: its node has not booted in the running machine")
        reason = _unconfirmed(end, until)
        if reason:
            return StopResult(name, False, f"NOT CONFIRMED as stopped by the running machine: {reason}")
        snapshot = self._snapshot_after(name, end.event_at)
        if quick:
            return StopResult(name, True, f"is at standstill, {snapshot.state.value}")
        units, position = self.core.session.axes[name].parameters.units, snapshot.position
        if position is None:
            return StopResult(name, True, "is at standstill at an unknown position")
        at = units.turned(units.position.to_units(position - snapshot.origin))
        return StopResult(name, True, f"is at standstill at {at:.4f} {units.position.unit}")

    def _snapshot_after(self, name: str, since: float) -> Snapshot:
        """Return the snapshot of an axis from the first cycle after ``since``; blocks for a cycle."""
        session = self.core.session
        session.waiter.wait(lambda: session.ended or session.snapshots[name].now > since, _MARGIN)
        return session.snapshots[name]

    def _command_axis(self, name: str, command: Command, text: str) -> _CommandEnd:
        """Give the scan a command that comes from no client."""
        number, end = next(self._numbers), _CommandEnd()
        self._pending_ends[number] = end
        end_event = self.submit(_OWN_COMMANDS * NUMBERS + number, name, command, text)
        if end_event is not None:
            self._note_end(number, end_event)
        return end

    def request_stop(self, handler: ClientHandler, reason: str, quick: bool) -> None:
        """Stop all axes that a client has commanded; the client gives no more commands."""
        if handler.client_number == 0:
            self.core.session.request_stop(reason, quick)
            return
        handler.leaving_because = reason
        if handler is self._holder:
            threading.Thread(
                target=self.halt, args=(f"{handler.name}: {reason}", quick), name="halting"
            ).start()

    def request_halt(self, handler: ClientHandler, reason: str, number: int) -> None:
        """Halt the axes that a client has commanded, because it was interrupted. A client without control has moved none."""
        if handler is self._holder:
            by = f"{handler.name}: {reason}" if handler.client_number else reason
            self.core.session.request_halt(by, handler.client_number * NUMBERS + number)

    def hold_to_run(self, handler: ClientHandler, seconds: float | None, continuous: float | None) -> None:
        """Renew or end a client's promise to call again in time. It has no effect for a client without control."""
        with self.command_lock:
            if handler is self._holder:
                self.core.scan.hold_to_run(seconds, handler.name, continuous)

    # -- commands ------------------------------------------------------------------------------------------------------

    def submit(self, number: int, target: Target, command: Command, name: str) -> CommandEvent | None:
        """Queue a command for the scan; if it is identical to another that has ended meanwhile, return that end."""
        kept = self.core.session.submit(number, target, command, name)
        return None if kept == number else self._duplicates.join(number, kept)

    def _on_event(self, event: CommandEvent) -> None:
        for each in self._duplicates.all_of(event):
            client_number, number = divmod(each.number, NUMBERS)
            if client_number == _OWN_COMMANDS:
                self._note_end(number, each)
            elif (handler := self._handlers.get(client_number)) is not None:
                handler.send_event(each if not client_number else each._replace(number=number))

    def _note_end(self, number: int, event: CommandEvent) -> None:
        if event.status in ENDED:
            end = self._pending_ends.pop(number, None)
            if end is not None:
                end.event, end.event_at = event, time.monotonic()
                end.has_ended.set()


def _unconfirmed(end: _CommandEnd, until: float) -> str:
    """Return why a stop is not confirmed at ``until`` (s, monotonic); empty if it is. Blocks."""
    if not end.has_ended.wait(max(0.0, until - time.monotonic())):
        return "it was not seen at standstill"
    if end.event is not None and end.event.status is Status.DONE:
        return ""
    return str((end.event and end.event.error) or "its stop ended early")


class ClientAcceptor:
    """Admits other programs, each with a thread of its own: those that join, and those that only want axes to stop."""

    def __init__(
        self,
        listener: ClientListener,
        clients: Clients,
        image: int,
        opened: Callable[[], m.CellOpened],
        text: str,
    ) -> None:
        """``image``: the images' descriptor; ``opened``: the message for joined programs; ``text``: as in ``m.Attach``."""
        self._listener = listener
        self._clients = clients
        self._image = image
        self._opened = opened
        self._text = text
        self._client_slots = threading.Semaphore(_MAX_CLIENTS)
        # further requests only wait for their result
        self._stops = ThreadPoolExecutor(_MAX_STOP_REQUESTS, "axisbus stop")

    def start(self) -> None:
        """Begin to admit programs."""
        threading.Thread(target=self._run, name="axisbus acceptor", daemon=True).start()

    def close(self) -> None:
        """Admit no more programs."""
        self._listener.close()

    def _run(self) -> None:
        for caller in self._listener.callers():
            if caller.stop is not None:
                self._accept_stop(caller.line, caller.process, caller.stop)
            elif not self._client_slots.acquire(blocking=False):
                refuse(caller.line)
            else:
                threading.Thread(
                    target=self._serve, args=(caller.line, caller.process), name="axisbus client", daemon=True
                ).start()

    def _accept_stop(self, line: socket.socket, process: int, request: StopRequest) -> None:
        """Give the stop commands at once: waiting for their end, by however many requests, must not delay another one."""
        try:
            started = self._clients.begin_stop(request.axes, request.quick, described(process, kept=True))
        except Exception:  # the next request must still be executed
            log.exception("a stop request could not be processed")
            line.close()
            return
        with suppress(OSError):  # the program may be gone; a new connection has room for these few bytes
            answer_stop(line, self._clients.stop_within)
        self._stops.submit(self._report_stop, line, started, request.quick)

    def _report_stop(self, line: socket.socket, started: _Stop, quick: bool) -> None:
        """Wait until axes have stopped, and report it to the program. A program that is gone, or does not read, changes nothing."""
        with line:
            line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _HANDSHAKE_TIMEOUT)
            stopped = self._clients.await_stop(started, quick)
            with suppress(OSError):
                answer_stop(line, StopAnswer(tuple(stopped), self._text))

    def _serve(self, line: socket.socket, process: int) -> None:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, _HANDSHAKE_TIMEOUT)
        line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _HANDSHAKE_TIMEOUT)
        stream = MessageStream(line, m.CODEC.pack, "axisbus client's", _MAX_MESSAGE)
        try:
            send_images(line, self._image)
            self._serve_client(line, stream, described(process, kept=True))
        except Exception as error:  # noqa: BLE001  # whatever it sent: only this connection ends
            log.info("the connection of process %d was closed: %s", process, error)
        finally:
            stream.close(_CLOSE_TIME)
            stream.finish()
            self._client_slots.release()

    def _serve_client(self, line: socket.socket, stream: MessageStream, client_name: str) -> None:
        messages = map(m.CODEC.unpack, stream.messages())
        wanted = next(messages, None)
        if not isinstance(wanted, m.Attach):
            return
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, _NO_TIMEOUT)
        handler = self._clients.admit(stream, client_name)
        log.info("joined by %s", client_name)
        try:
            if self._attach(handler, wanted):
                _execute_messages(handler, messages)
        finally:
            self._clients.dismiss(handler)
            log.info("left by %s", client_name)

    def _attach(self, handler: ClientHandler, wanted: m.Attach) -> bool:
        try:
            self._require_same(wanted)
            if wanted.command:
                self._clients.give_control(handler, wanted.take)
        except AxisbusError as error:
            handler.stream.send(m.NotOpened((error,)))
            return False
        handler.stream.send(self._opened())
        handler.stream.send(condition_of(self._clients.core.session))
        return True

    def _require_same(self, wanted: m.Attach) -> None:
        if wanted.version != __version__:
            raise StateError(
                f"this program has axisbus {wanted.version}, the running machine {__version__}",
                remedy="both must run the same installation: check PYTHONPATH and the virtual environment",
            )
        if wanted.text != self._text:
            raise StateError(
                "the cell file has changed since the machine was opened",
                remedy="end the machine and open it again; or undo the changes in the file",
            )


def _execute_messages(handler: ClientHandler, messages: map[object]) -> None:
    """Execute a joined program's messages, at a limited rate, until it leaves or sends an invalid one."""
    rate = Bucket(CORE_RATE, CORE_BURST)
    for message in messages:
        if not handler.take(message) or isinstance(message, m.Leave):
            return
        while not rate.take(time.monotonic()):
            time.sleep(1.0 / CORE_RATE)
