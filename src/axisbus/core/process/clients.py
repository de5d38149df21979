"""The clients of a core: the program that opened it, and programs that have joined. One has control; all may stop.

Theory of operation
-------------------
Each client has a ``ClientHandler``. The scan knows its commands by the client's own numbers and its place, so that their ends reach
it. Control belongs to the program that opened the cell, or to no client if that program shares the cell. A joined program gets
control if it is free, or takes it. When control passes to another client, or its holder is gone, all moving axes halt before
another client may command.

A program that only wants axes to stop (``listener.StopRequest``) is no client, and needs no place: its request is always accepted,
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
    not_commanding,
)
from axisbus.core.process.listener import (
    ClientListener,
    StopAnswer,
    StopRequest,
    answer_stop,
    refuse,
    welcome,
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
_MOST = 16  # joined programs
_MOST_STOPS = 64  # stop requests that wait for their result at the same time
_HOUSE = 1 << 20  # the place of commands that come from no client
_LARGEST = 1 << 18  # bytes of a joined program's message
_SHAKE = struct.pack("ll", 5, 0)  # 5 s for the first message, and for sending to the program
_FOR_EVER = struct.pack("ll", 0, 0)
_MARGIN = 2.0  # seconds in addition to the stop sequences
_FAREWELL = 1.0  # seconds


class _End:
    """The end of a command that comes from no client: ``come`` is set when it has ended, then ``event``."""

    def __init__(self) -> None:
        self.come = threading.Event()
        self.event: CommandEvent | None = None
        self.event_at = 0.0


_Stop = dict[str, _End | None]  # axis -> the end of its stop; None: its node has not come up


class Clients:
    """Holds the client handlers, the client with control, and the pending requests; for any thread."""

    def __init__(self, core: Core, outlet: Publisher, pool: ThreadPoolExecutor) -> None:
        self.core = core
        self.outlet = outlet
        self.pool = pool
        self._lock = threading.Lock()  # of the clients; loops over them use the last complete dictionary
        self.programs_written = ProgramRuns(core)
        self._merging = DuplicateCommands()
        self._condition = m.CoreCondition()
        self._desks: dict[int, ClientHandler] = {}
        self._places = itertools.count()
        self._numbers = itertools.count(1)
        self._waits: dict[int, _End] = {}
        self._watched: set[int] = set()
        self._passing = threading.Lock()  # held while control passes from one client to another
        # of a command: held from the check whether its client may give it until the scan has it
        self.giving = threading.Lock()
        self._opener: ClientHandler | None = None
        self._holder: ClientHandler | None = None
        core.session.listen(self._hear)

    # -- clients -------------------------------------------------------------------------------------------------------

    def admit(self, stream: MessageStream, who: str) -> ClientHandler:
        """Add a client."""
        with self._lock:
            desk = ClientHandler(self, next(self._places), stream, self.outlet.admit(stream), who)
            self._desks = {**self._desks, desk.place: desk}
        return desk

    def open_for(self, program: ClientHandler, shared: bool) -> None:
        """Give control to the program that opened the cell, unless it shares the cell."""
        self._opener = self._holder = None if shared else program

    def dismiss(self, desk: ClientHandler) -> None:
        """Remove a client that is gone. If it had control, moving axes halt. Blocks until that is done."""
        desk.gone()
        self.give_up(desk, f"{desk.name}, which had control, has left")
        with self._lock:
            self.outlet.dismiss(desk.reader)
            self._desks = {place: one for place, one in self._desks.items() if one is not desk}

    def tell(self, message: m.Message) -> None:
        """Send a message to every client."""
        for desk in self._desks.values():
            desk.stream.send(message)

    def tell_condition(self) -> None:
        """Send the core's condition to every client if it has changed; after the end of the scan, then flush the command events."""
        now = condition_of(self.core.session)
        if now != self._condition:
            self.tell(now)
            self._condition = now
        if now.ended:  # afterwards, so that a client that sees the end of a command knows the reason
            self.outlet.flush()

    def look(self) -> None:
        """Do the work that is due every few milliseconds."""
        for desk in self._desks.values():
            desk.look()

    def watch(self, node_id: int) -> None:
        """Send the events of a node to the clients that requested them."""
        if node_id in self._watched:
            return
        self._watched.add(node_id)
        events = self.core.nodes[node_id].events
        assert events is not None
        events.hear(lambda event: self._tell_event(node_id, m.NodeTold(event)))

    def _tell_event(self, node_id: int, message: m.NodeTold) -> None:
        for desk in self._desks.values():
            if node_id in desk.watched:
                desk.stream.send(message)

    # -- control -------------------------------------------------------------------------------------------------------

    @property
    def commanded_by(self) -> str:
        """The client with control, as text; empty if there is none."""
        return "" if self._holder is None else self._holder.name

    @property
    def programs(self) -> tuple[ClientProgram, ...]:
        """The clients: the program that opened the cell first, then the joined ones in their order."""
        return tuple(
            ClientProgram(desk.name, desk is self._holder, desk.reader.lost, desk.reader.frames.lost)
            for desk in self._desks.values()
        )

    def refusal(self, desk: ClientHandler, name: str) -> OwnershipError | None:
        """Return why a client may not command, None if it may."""
        if desk is self._holder:
            return None
        return not_commanding(name, self.commanded_by, guest=desk.place != 0, passing=self._passing.locked())

    def give_command(self, desk: ClientHandler, take: bool) -> None:
        """Give control to a client. If it is taken from another client, moving axes halt first. Blocks until that is done.

        Harmless if the client has control. Raises:
            OwnershipError: another client has control, and ``take`` is not set.
            StateError: the halt of an axis is not confirmed. Stopped: the client is gone, or is leaving.
        """
        with self._passing:
            if desk is self._holder:
                return
            if desk.leaving is not None:
                raise StoppedError("control was not granted", observed=desk.leaving)
            if self._holder is not None and not take:
                raise not_commanding("control is requested", self.commanded_by, guest=True)
            if self._holder is not None:
                self._holder.warn(f"{desk.name} took control of the machine: moving axes halt")
            self._take_away()
            # After the end of the scan no axis can be commanded, and the client may open the adapter again.
            ended = self.core.session.ended
            moving = [] if ended else self.halt(f"{desk.name} took control of the machine")
            self._holder = self._opener if moving else desk
        if moving:
            raise StateError(
                "control was not granted: an axis does not come to standstill",
                observed="; ".join(moving),
                remedy="stop the machine: axisbus stop CELL",
            )

    def give_up(self, desk: ClientHandler, reason: str, quick: bool = False) -> None:
        """Take control from a client that must not have it any more; moving axes halt first. Blocks until that is done."""
        with self._passing:
            if desk is not self._holder or desk is self._opener:
                return
            self._take_away()
            self.halt(reason, quick)
            self._holder = self._opener

    def _take_away(self) -> None:
        with self.giving:
            self._holder = None
            self.core.scan.hold_to_run(None, "")

    def halt(self, reason: str, quick: bool = False) -> list[str]:
        """Halt (or quick-stop) every axis that was set in motion; return the axes whose stop is not confirmed, and why. Blocks."""
        ends = {}
        for name, snapshot in self.core.session.snapshots.items():
            moves = snapshot.state in MOVING or snapshot.state is AxisState.STOPPING
            command = QuickStop() if quick and moves else HandOver(reason)
            ends[name] = self._give(name, command, f"{name}.halt")
        until = time.monotonic() + self.stop_within
        reasons = {name: _unconfirmed(end, until) for name, end in ends.items()}
        return [f"{name}: {reason.splitlines()[0]}" for name, reason in reasons.items() if reason]

    @property
    def stop_within(self) -> float:
        """The maximum duration of a stop of all axes, in seconds."""
        times = [facts.parameters.stop_times.stop_sequence for facts in self.core.session.axes.values()]
        return max(times, default=0.0) + _MARGIN

    def begin_stop(self, axes: Sequence[str], quick: bool, who: str) -> _Stop:
        """Quick-stop or halt these axes, or all of the cell if ``axes`` is empty, for ``who``; does not block."""
        verb, there = "quick_stop" if quick else "halt", self.core.session.axes
        names = list(axes or self.core.cell.axes)
        ends = {
            name: self._give(name, c.QuickStop() if quick else c.Halt(), f"{name}.{verb}() by {who}")
            for name in names
            if name in there
        }
        return {name: ends.get(name) for name in names}

    def await_stop(self, ends: _Stop, quick: bool) -> list[StopResult]:
        """Return the results of ``begin_stop`` for each axis; blocks."""
        until = time.monotonic() + self.stop_within
        return [self._stopped(name, end, until, quick) for name, end in ends.items()]

    def _stopped(self, name: str, end: _End | None, until: float, quick: bool) -> StopResult:
        if end is None:
            return StopResult(name, False, "NOT REACHED: its node has not booted in the running machine")
        reason = _unconfirmed(end, until)
        if reason:
            return StopResult(name, False, f"NOT CONFIRMED as stopped by the running machine: {reason}")
        snapshot = self._seen(name, end.event_at)
        if quick:
            return StopResult(name, True, f"is at standstill, {snapshot.state.value}")
        units, position = self.core.session.axes[name].parameters.units, snapshot.position
        if position is None:
            return StopResult(name, True, "is at standstill at an unknown position")
        at = units.turned(units.position.to_units(position - snapshot.origin))
        return StopResult(name, True, f"is at standstill at {at:.4f} {units.position.unit}")

    def _seen(self, name: str, since: float) -> Snapshot:
        """Return the snapshot of an axis from the first cycle after ``since``; blocks for a cycle."""
        session = self.core.session
        session.waiter.wait(lambda: session.ended or session.snapshots[name].now > since, _MARGIN)
        return session.snapshots[name]

    def _give(self, name: str, command: Command, text: str) -> _End:
        """Give the scan a command that comes from no client."""
        number, end = next(self._numbers), _End()
        self._waits[number] = end
        over = self.submit(_HOUSE * NUMBERS + number, name, command, text)
        if over is not None:
            self._halted(number, over)
        return end

    def request_stop(self, desk: ClientHandler, reason: str, quick: bool) -> None:
        """Stop all axes that a client has commanded; the client gives no more commands."""
        if desk.place == 0:
            self.core.session.request_stop(reason, quick)
            return
        desk.leaving = reason
        if desk is self._holder:
            threading.Thread(target=self.halt, args=(f"{desk.name}: {reason}", quick), name="halting").start()

    def request_halt(self, desk: ClientHandler, reason: str, number: int) -> None:
        """Halt the axes that a client has commanded, because it was interrupted. A client without control has moved none."""
        if desk is self._holder:
            by = f"{desk.name}: {reason}" if desk.place else reason
            self.core.session.request_halt(by, desk.place * NUMBERS + number)

    def hold_to_run(self, desk: ClientHandler, seconds: float | None, continuous: float | None) -> None:
        """Renew or end a client's promise to call again in time. It has no effect for a client without control."""
        with self.giving:
            if desk is self._holder:
                self.core.scan.hold_to_run(seconds, desk.name, continuous)

    # -- commands ------------------------------------------------------------------------------------------------------

    def submit(self, number: int, target: Target, command: Command, name: str) -> CommandEvent | None:
        """Queue a command for the scan; if it is identical to another that has ended meanwhile, return that end."""
        kept = self.core.session.submit(number, target, command, name)
        return None if kept == number else self._merging.join(number, kept)

    def _hear(self, event: CommandEvent) -> None:
        for each in self._merging.all_of(event):
            place, number = divmod(each.number, NUMBERS)
            if place == _HOUSE:
                self._halted(number, each)
            elif (desk := self._desks.get(place)) is not None:
                desk.hear(each if not place else each._replace(number=number))

    def _halted(self, number: int, event: CommandEvent) -> None:
        if event.status in ENDED:
            end = self._waits.pop(number, None)
            if end is not None:
                end.event, end.event_at = event, time.monotonic()
                end.come.set()


def _unconfirmed(end: _End, until: float) -> str:
    """Return why a stop is not confirmed at ``until`` (s, monotonic); empty if it is. Blocks."""
    if not end.come.wait(max(0.0, until - time.monotonic())):
        return "it was not seen at standstill"
    if end.event is not None and end.event.status is Status.DONE:
        return ""
    return str((end.event and end.event.error) or "its stop ended early")


class Guests:
    """Admits other programs, each with a thread of its own: those that join, and those that only want axes to stop."""

    def __init__(
        self,
        door: ClientListener,
        clients: Clients,
        image: int,
        opened: Callable[[], m.CellOpened],
        text: str,
    ) -> None:
        """``image``: the images' descriptor; ``opened``: the message for joined programs; ``text``: as in ``m.Attach``."""
        self._door = door
        self._clients = clients
        self._image = image
        self._opened = opened
        self._text = text
        self._there = threading.Semaphore(_MOST)
        # further requests only wait for their result
        self._stops = ThreadPoolExecutor(_MOST_STOPS, "axisbus stop")

    def start(self) -> None:
        """Begin to admit programs."""
        threading.Thread(target=self._run, name="axisbus door", daemon=True).start()

    def close(self) -> None:
        """Admit no more programs."""
        self._door.close()

    def _run(self) -> None:
        for caller in self._door.callers():
            if caller.stop is not None:
                self._take_stop(caller.line, caller.process, caller.stop)
            elif not self._there.acquire(blocking=False):
                refuse(caller.line)
            else:
                threading.Thread(
                    target=self._serve, args=(caller.line, caller.process), name="axisbus guest", daemon=True
                ).start()

    def _take_stop(self, line: socket.socket, process: int, request: StopRequest) -> None:
        """Give the stop commands at once: waiting for their end, by however many requests, must not delay another one."""
        try:
            begun = self._clients.begin_stop(request.axes, request.quick, described(process, kept=True))
        except Exception:  # the next request must still be executed
            log.exception("a stop request could not be processed")
            line.close()
            return
        with suppress(OSError):  # the program may be gone; a new connection has room for these few bytes
            answer_stop(line, self._clients.stop_within)
        self._stops.submit(self._stop, line, begun, request.quick)

    def _stop(self, line: socket.socket, begun: _Stop, quick: bool) -> None:
        """Wait until axes have stopped, and report it to the program. A program that is gone, or does not read, changes nothing."""
        with line:
            line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _SHAKE)
            stopped = self._clients.await_stop(begun, quick)
            with suppress(OSError):
                answer_stop(line, StopAnswer(tuple(stopped), self._text))

    def _serve(self, line: socket.socket, process: int) -> None:
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, _SHAKE)
        line.setsockopt(socket.SOL_SOCKET, socket.SO_SNDTIMEO, _SHAKE)
        stream = MessageStream(line, m.CODEC.pack, "axisbus guest's", _LARGEST)
        try:
            welcome(line, self._image)
            self._talk(line, stream, described(process, kept=True))
        except Exception as error:  # noqa: BLE001  # whatever it sent: only this connection ends
            log.info("the connection of process %d was closed: %s", process, error)
        finally:
            stream.close(_FAREWELL)
            stream.finish()
            self._there.release()

    def _talk(self, line: socket.socket, stream: MessageStream, who: str) -> None:
        messages = map(m.CODEC.unpack, stream.messages())
        wanted = next(messages, None)
        if not isinstance(wanted, m.Attach):
            return
        line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVTIMEO, _FOR_EVER)
        desk = self._clients.admit(stream, who)
        log.info("joined by %s", who)
        try:
            if self._welcome(desk, wanted):
                _read(desk, messages)
        finally:
            self._clients.dismiss(desk)
            log.info("left by %s", who)

    def _welcome(self, desk: ClientHandler, wanted: m.Attach) -> bool:
        try:
            self._require_same(wanted)
            if wanted.command:
                self._clients.give_command(desk, wanted.take)
        except AxisbusError as error:
            desk.stream.send(m.NotOpened((error,)))
            return False
        desk.stream.send(self._opened())
        desk.stream.send(condition_of(self._clients.core.session))
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


def _read(desk: ClientHandler, messages: map[object]) -> None:
    """Execute a joined program's messages, at a limited rate, until it leaves or sends an invalid one."""
    rate = Bucket(CORE_RATE, CORE_BURST)
    for message in messages:
        if not desk.take(message) or isinstance(message, m.Leave):
            return
        while not rate.take(time.monotonic()):
            time.sleep(1.0 / CORE_RATE)
