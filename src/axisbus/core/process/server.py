"""The server of the core in its own process: it opens a cell for a program, serves all clients, and stops without them.

Theory of operation
-------------------
The main thread reads the program's messages. Commands go to the scan at once; slow requests (SDO, NMT) are executed in threads of a
pool. Joined programs have threads of their own (``clients``). Three events end the process, each by the stop sequence: ``Leave``,
the end of the connection (the program has ended, for any reason, or closed it), and SIGTERM or SIGHUP. A program that is stopped,
or busy for a long time, ends nothing: the axes continue with their commands.
"""

from __future__ import annotations

import gc
import logging
import mmap
import os
import select
import signal
import socket
import threading
import time
from collections.abc import Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from functools import partial

from axisbus.boot.report import Booted
from axisbus.bus.link.ownership import described
from axisbus.cell.model import CellConfig
from axisbus.core.canlink import CanLink
from axisbus.core.core import AdapterLoss, Core
from axisbus.core.files import read_once
from axisbus.core.process.bus_factory import reach
from axisbus.core.process.client_handler import ClientHandler, last_words, told
from axisbus.core.process.clients import Clients, Guests
from axisbus.core.process.listener import ClientListener, text_of
from axisbus.core.process.persistence.faults import Faults
from axisbus.core.process.persistence.journal import journal
from axisbus.core.process.publisher import Publisher
from axisbus.core.process.rescue import BEAT, NOBODY, Lifeline, WatchdogProcessMonitor, state_of
from axisbus.core.process.shared_counters import SharedCounters
from axisbus.core.process.signal_forwarding import INTERRUPTED, STOPPING, SignalForwarder
from axisbus.core.process.startup_args import StartupArgs
from axisbus.core.realtime_setup import OWN_PROCESS, IdleCollector, keep_awake, take_priority, take_processor
from axisbus.core.runtime import Runtime
from axisbus.eds.model import Eds
from axisbus.errors import AxisbusError, ScanError, StateError
from axisbus.ipc import messages as m
from axisbus.ipc.image import ImageReader, size_of
from axisbus.ipc.io_image import IoImage
from axisbus.ipc.own_socket import SLICE, FarEnd
from axisbus.ipc.rescue_memory import CoreStage
from axisbus.ipc.stream import MessageStream
from axisbus.ipc.values import NotForCrossing
from axisbus.system.signals import present
from axisbus.version import __version__

log = logging.getLogger("axisbus")
_ROUND = 0.02  # seconds
_ASKED = 64  # requests that are executed at a time
# For the watchdog process, which ends a core that runs no cycle for too long.
_LOSS_STAGES = {
    AdapterLoss.STOPPING: CoreStage.LOST,
    AdapterLoss.STOPPED: CoreStage.WAITING,
    AdapterLoss.OVER: CoreStage.RUNNING,
}
_NEVER_AFTER = {
    CoreStage.LEAVING: (CoreStage.RUNNING,),
    CoreStage.RELEASING: tuple(stage for stage in CoreStage if stage is not CoreStage.LEFT),
    CoreStage.LEFT: tuple(CoreStage),
}
_FAREWELL = 2.0  # seconds for the last message
_WORDS = 64  # bytes of the watchdog process that are read at a time
_WATCHDOG_GONE = f"the watchdog process of the core has ended: {NOBODY}"
_WAYS_OUT = present("SIGTERM", "SIGHUP")


class CoreServer:
    """One program's core; holds the machine when it is open."""

    def __init__(
        self,
        stream: MessageStream,
        memory: mmap.mmap,
        image: int,
        axes: int,
        watchdog: socket.socket,
        drives: socket.socket | None = None,
        who: str = "the program that opened it",
        listening: socket.socket | None = None,
    ) -> None:
        """``stream`` and ``watchdog`` lead to the program and the watchdog process, ``drives`` to simulated drives, if any.

        ``who``: the program, as text. Other programs connect at ``listening``, if it is given. ``memory`` (its descriptor:
        ``image``) contains the images and the lifeline, for the number of ``axes``.
        """
        self._stream = stream
        self._memory = memory
        self._image = image
        self._degree = ""
        self._axes = axes
        self._watchdog = watchdog
        self._drives = drives
        self._who = who
        self._door = None if listening is None else ClientListener(listening)
        self._ear: SignalForwarder | None = None
        self._in_cells = False
        self._lifeline: Lifeline | None = None
        self._core: Core | None = None
        self._clients: Clients | None = None
        self._faults: Faults | None = None
        self._guests: Guests | None = None
        self._program: ClientHandler | None = None
        self._asked = ThreadPoolExecutor(_ASKED, "axisbus asked")
        self._deaf: int | None = None  # the watchdog process, after it was found not to run
        self._leaving = threading.Lock()
        self._opening = threading.RLock()  # of the next two; a signal handler takes it too
        self._is_opening = True
        self._ends_because: str | None = None  # why the core shall leave as soon as it is open
        self._staging = threading.RLock()
        self._reached = CoreStage.OPENING
        self._left = threading.Event()

    def run(self) -> None:
        """Serve the program until one of the two is gone; blocks."""
        messages = self._messages()
        wanted = next(messages, None)
        try:
            if isinstance(wanted, m.OpenCell) and self._open(wanted):
                self._serve(messages)
        finally:
            self._leave("the program has ended")
            if self._core is not None:
                self._left.wait()
            if self._guests is None and self._door is not None:
                self._door.dismiss()
            self._stream.close(_FAREWELL)
            if self._deaf is not None and self._deaf == os.getppid():
                os.kill(self._deaf, signal.SIGKILL)  # otherwise the program would wait for its end

    def _messages(self) -> Iterator[object]:
        """Yield the program's messages, until it is gone or sends an invalid one."""
        try:
            for data in self._stream.messages():
                yield m.CODEC.unpack(data)
        except NotForCrossing as error:
            log.error("the program's connection was closed: %s", error)

    def listen(self, signals: socket.socket) -> None:
        """Listen for the signals that the program cannot handle; ``signals`` is the socket from which it reads them."""
        self._ear = SignalForwarder(signals, STOPPING)

    def watch(self, pidfd: int, end: FarEnd) -> None:
        """Leave when the process of ``pidfd`` is gone or has lost its end of the connection, even if others still hold that."""
        poll = select.poll()
        poll.register(pidfd, select.POLLIN)
        threading.Thread(
            target=self._await_end, args=(poll, end), name="axisbus program", daemon=True
        ).start()

    def _await_end(self, program: select.poll, end: FarEnd) -> None:
        while not program.poll(SLICE * 1000.0):
            if end.lost:
                self._leave("the program has ended or has closed its connection: it can command nothing")
                return
        self._leave("the program has ended")

    # -- opening -------------------------------------------------------------------------------------------------------

    def _open(self, wanted: m.OpenCell) -> bool:
        try:
            self._require_same(wanted.version)
            cell, dictionaries = read_once(wanted.cell)  # checked by the program
            self._begin(cell.beside(wanted.beside), dictionaries, wanted)
        except BaseExceptionGroup as group:
            self._stream.send(m.NotOpened(tuple(map(told, group.exceptions)), group.message))
            return False
        except BaseException as error:  # noqa: BLE001  # the program gets whatever error it was
            self._stream.send(m.NotOpened((told(error),)))
            return False
        finally:
            self._end_opening()
        return True

    def _end_opening(self) -> None:
        """Leave if that was requested meanwhile: during opening, nothing can be left yet."""
        with self._opening:
            self._is_opening = False
        if self._ends_because is not None:
            self._leave(self._ends_because)

    def _require_wanted(self) -> None:
        """Check that the machine is still to be opened: the program and the watchdog process run, and nobody has requested a stop.

        A stop that was requested during opening has stopped the drives on the bus; a program that runs after it would move them.
        """
        stop = None if self._door is None else self._door.first_stop()
        if stop is not None:
            stop.line.close()  # the program that waits for an answer then stops the drives on the bus
            raise StateError(
                "the machine was not opened: axes were to be stopped meanwhile",
                observed=f"process {stop.process} requested it, as axisbus stop does",
                remedy="open the machine again when it may move",
            )
        if self._ends_because is not None:
            raise ScanError(
                f"the machine was not opened: {self._ends_because}",
                remedy="open the machine again; if it happens again, check the computer's memory and its load",
            )

    def _begin(self, cell: CellConfig, dictionaries: Mapping[int, Eds], wanted: m.OpenCell) -> None:
        self._await_watchdog()
        self._require_wanted()
        gc.collect()  # now, because after boot-up the drives and the master monitor each other's heartbeats
        link = CanLink(cell, dictionaries, channel=reach(cell, self._drives))
        runtime = Runtime(link, sorted(cell.nodes), link.stand_ins)
        core = runtime.use(lambda booted: Core(cell, booted))
        names = tuple(cell.axes)
        self._core, outlet = core, Publisher(self._memory, names)
        self._clients = Clients(core, outlet, self._asked)
        self._program = self._clients.admit(self._stream, self._who)
        self._clients.open_for(self._program, wanted.shared)
        self._in_cells = wanted.in_cells
        self._lifeline = Lifeline(self._memory, size_of(self._axes), core, names)
        self._take_signals()
        self._degree = ", ".join([OWN_PROCESS, *take_priority(), *keep_awake(), *take_processor()])
        reader = ImageReader(self._memory, names, lambda _: None)
        self._faults = Faults(cell, core.session, core.nodes, outlet, reader, self._degree)
        if cell.io:
            core.scan.io.note = IoImage(self._memory, self._axes, tuple(cell.io)).write
        tally = SharedCounters(self._memory, self._axes, len(cell.io))
        tally.take(core.scan.lateness)
        core.session.observe(tally.writer(link.carried))
        core.session.observe(outlet.after_cycle)
        core.session.observe(self._faults.after_cycle)
        core.session.observe(self._lifeline.after_cycle)
        core.on_adapter_loss = lambda progress: self._stage(_LOSS_STAGES[progress])
        core.on_axes_stopped = lambda: self._stage(CoreStage.RELEASING)
        core.begin(self._joined)
        core.await_values()
        core.session.observe(IdleCollector(cell.bus.scan_period).after_cycle)
        self._require_wanted()
        self._stage(CoreStage.RUNNING)
        self._let_in(wanted.cell)
        self._stream.send(self._opened())
        threading.Thread(target=self._watch_condition, name="axisbus condition", daemon=True).start()

    def _await_watchdog(self) -> None:
        """Wait until the watchdog process can stop the axes, and simulated drives listen; then start monitoring the process."""
        if not self._watchdog.recv(1):
            raise ScanError(
                "the watchdog process of the core has ended",
                remedy="open the machine again; check the computer's memory",
            )
        self._watchdog.settimeout(BEAT)
        threading.Thread(target=self._monitor_watchdog, name="axisbus watchdog", daemon=True).start()

    def _monitor_watchdog(self) -> None:
        """Leave when the watchdog process has ended, or does not run."""
        watchdog = os.getppid()
        watch = WatchdogProcessMonitor(time.monotonic(), partial(state_of, watchdog))
        while not self._left.is_set():
            came = self._came()
            why = _WATCHDOG_GONE if came is None else watch.look(time.monotonic(), came)
            if why is not None:
                self._deaf = None if came is None else watchdog
                self._leave(why)
                return

    def _came(self) -> bool | None:
        """Wait a moment for a byte of the watchdog process; return whether one came, None if none can come any more."""
        try:
            return True if self._watchdog.recv(_WORDS) else None
        except TimeoutError:
            return False
        except OSError:
            return None

    def _require_same(self, version: str) -> None:
        if version != __version__:
            raise StateError(
                f"the program has axisbus {version}, its core {__version__}",
                remedy="both must run the same installation: check PYTHONPATH and the virtual environment",
            )

    def _opened(self) -> m.CellOpened:
        assert self._core is not None
        assert self._clients is not None
        nodes = {node_id: self._facts(node_id, booted) for node_id, booted in self._core.booted.items()}
        axes, holder = dict(self._core.session.axes), self._clients.commanded_by
        return m.CellOpened(nodes, axes, self._degree, os.getpid(), holder)

    def _let_in(self, cell: str) -> None:
        """Begin to admit other programs."""
        assert self._clients is not None
        if self._door is not None:
            self._guests = Guests(self._door, self._clients, self._image, self._opened, text_of(cell))
            self._guests.start()

    def _facts(self, node_id: int, booted: Booted) -> m.NodeFacts:
        assert self._core is not None
        parts = self._core.nodes[node_id]
        return m.NodeFacts(booted.report, booted.parameters, parts.plans, parts.events is not None)

    def _take_signals(self) -> None:
        for number, name in _WAYS_OUT.items():
            signal.signal(number, lambda *_, name=name: self._leave(f"{name} to the core"))
        signal.signal(signal.SIGINT, signal.SIG_IGN)  # handled by the program

    # -- serving -------------------------------------------------------------------------------------------------------

    def _serve(self, messages: Iterator[object]) -> None:
        assert self._program is not None
        for message in messages:
            if isinstance(message, m.Leave):
                self._leave(message.reason)
            else:
                self._program.take(message)

    # -- messages to clients -------------------------------------------------------------------------------------------

    def _joined(self, booted: Booted) -> None:
        assert self._core is not None
        assert self._clients is not None
        axes = {name: facts for name, facts in self._core.session.axes.items() if name in booted.parameters}
        node_id = booted.report.node_id
        self._clients.tell(m.NodeJoined(node_id, self._facts(node_id, booted), axes))

    def _watch_condition(self) -> None:
        """Report the end, a failure, or a requested stop of the scan to the clients; and do their periodic work."""
        assert self._clients is not None
        while not self._left.wait(_ROUND):
            self._clients.tell_condition()
            self._clients.look()
            self._hear_signals()
        self._clients.tell_condition()

    def _hear_signals(self) -> None:
        heard = None if self._ear is None else self._ear.look(time.monotonic())
        if heard is not None and self._core is not None:
            name, count = heard
            if self._in_cells and name == STOPPING[signal.SIGINT] and count == 1:
                self._core.session.request_halt(INTERRUPTED, 0)
            else:
                self._core.session.request_stop(name, quick=count > 1)

    # -- leaving -------------------------------------------------------------------------------------------------------

    def _leave(self, reason: str) -> None:
        """Begin to leave, in a thread of its own: the program may still request a faster stop."""
        with self._opening:
            if self._is_opening:
                self._ends_because = self._ends_because or reason
                return
        if self._core is not None and self._leaving.acquire(blocking=False):
            log.info("leaving: %s", reason)
            self._core.session.request_stop(reason)
            # A scan that has failed runs no cycle, which the stage LEAVING would require.
            self._stage(CoreStage.RELEASING if self._core.session.ended else CoreStage.LEAVING)
            threading.Thread(target=partial(self._do_leave, reason), name="leaving").start()

    def _stage(self, stage: CoreStage) -> None:
        """Store the stage. While the core leaves, the loss of its adapter, and its return, must not give it more time."""
        with self._staging:
            if self._lifeline is not None and stage not in _NEVER_AFTER.get(self._reached, ()):
                self._reached = stage
                self._lifeline.stage(stage)

    def _do_leave(self, reason: str) -> None:
        assert self._core is not None
        failures: tuple[AxisbusError, ...] = ()
        try:
            failures = tuple(self._core.leave(reason))
        except BaseException as error:  # noqa: BLE001  # the program gets whatever error it was
            failures = (told(error),)
        self._stage(CoreStage.LEFT)
        if self._faults is not None:
            self._faults.close()
        if self._guests is not None:
            self._guests.close()
        for failure in failures:
            log.info("closed, with an error: %s", failure)
        try:
            if self._clients is not None:
                self._clients.tell_condition()
            self._stream.send(m.Left(failures, last_words(self._core.session, self._core.nodes)))
        except Exception:  # whatever cannot be sent any more: the process ends nevertheless
            log.exception("the end of the core could not be reported")
            self._stream.send(m.Left(failures))
        finally:
            self._left.set()
            self._stream.close(_FAREWELL)


def serve(duty: StartupArgs, watchdog: socket.socket) -> None:
    """Run the core of a program until one of the two is gone; blocks. ``watchdog`` leads to the watchdog process."""
    stream = MessageStream(socket.socket(fileno=duty.line), m.CODEC.pack, "axisbus answers")
    log.addHandler(StreamHandler(stream))
    line = socket.socket(fileno=duty.drives) if duty.simulates else None
    server = CoreServer(
        stream,
        mmap.mmap(duty.memory, 0),
        duty.memory,
        duty.axes,
        watchdog,
        line,
        described(duty.program, kept=True),
        socket.socket(fileno=duty.lock) if duty.lock >= 0 else None,
    )
    with suppress(OSError):  # it is already gone, which the end of the connection shows
        server.watch(os.pidfd_open(duty.program), FarEnd(duty.program, duty.end, duty.inode))
    server.listen(socket.socket(fileno=duty.signals))
    with journal(duty.cell):
        log.info("the core of %s began, for process %d", duty.cell, duty.program)
        server.run()
        log.info("the core ended")


class StreamHandler(logging.Handler):
    """Sends the core's log to the program."""

    def __init__(self, stream: MessageStream) -> None:
        super().__init__(logging.WARNING)  # lower levels are only for the journal
        self._stream = stream

    def emit(self, record: logging.LogRecord) -> None:
        """Send one line."""
        self._stream.send(m.Logged(record.name, record.levelno, record.getMessage()))
