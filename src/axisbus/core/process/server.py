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
from axisbus.core.process.bus_factory import open_bus
from axisbus.core.process.client_handler import ClientHandler, last_answers, sendable
from axisbus.core.process.clients import ClientAcceptor, Clients
from axisbus.core.process.listener import ClientListener, text_of
from axisbus.core.process.persistence.faults import Faults
from axisbus.core.process.persistence.journal import journal
from axisbus.core.process.publisher import Publisher
from axisbus.core.process.rescue import BEAT_PERIOD, NO_WATCHDOG, Lifeline, WatchdogProcessMonitor, state_of
from axisbus.core.process.shared_counters import SharedCounters
from axisbus.core.process.signal_forwarding import INTERRUPTED, STOPPING, SignalForwarder
from axisbus.core.process.startup_args import StartupArgs
from axisbus.core.realtime_setup import (
    OWN_PROCESS,
    IdleCollector,
    pin_to_isolated_processor,
    prevent_deep_sleep,
    set_real_time_priority,
)
from axisbus.core.runtime import Runtime
from axisbus.eds.model import Eds
from axisbus.errors import AxisbusError, ScanError, StateError
from axisbus.ipc import messages as m
from axisbus.ipc.image import ImageReader, size_of
from axisbus.ipc.io_image import IoImage
from axisbus.ipc.own_socket import SLICE, FarEnd
from axisbus.ipc.rescue_memory import CoreStage
from axisbus.ipc.stream import MessageStream
from axisbus.ipc.values import NotSendable
from axisbus.system.signals import present
from axisbus.version import __version__

log = logging.getLogger("axisbus")
_POLL_PERIOD = 0.02  # seconds
_MAX_REQUESTS = 64  # requests that are executed at a time
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
_CLOSE_TIME = 2.0  # seconds for the last message
_BEAT_BUFFER = 64  # bytes of the watchdog process that are read at a time
_WATCHDOG_GONE = f"the watchdog process of the core has ended: {NO_WATCHDOG}"
_TERMINATION_SIGNALS = present("SIGTERM", "SIGHUP")


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
        client_name: str = "the program that opened it",
        listening: socket.socket | None = None,
    ) -> None:
        """``stream`` and ``watchdog`` lead to the program and the watchdog process, ``drives`` to simulated drives, if any.

        ``client_name``: the program, as text. Other programs connect at ``listening``, if it is given. ``memory`` (its descriptor:
        ``image``) contains the images and the lifeline, for the number of ``axes``.
        """
        self._stream = stream
        self._memory = memory
        self._image = image
        self._real_time_status = ""
        self._axes = axes
        self._watchdog = watchdog
        self._drives = drives
        self._client_name = client_name
        self._listener = None if listening is None else ClientListener(listening)
        self._signal_forwarder: SignalForwarder | None = None
        self._in_cells = False
        self._lifeline: Lifeline | None = None
        self._core: Core | None = None
        self._clients: Clients | None = None
        self._faults: Faults | None = None
        self._acceptor: ClientAcceptor | None = None
        self._program: ClientHandler | None = None
        self._request_pool = ThreadPoolExecutor(_MAX_REQUESTS, "axisbus asked")
        self._hung_watchdog: int | None = None  # the watchdog process, after it was found not to run
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
        request = next(messages, None)
        try:
            if isinstance(request, m.OpenCell) and self._open(request):
                self._serve(messages)
        finally:
            self._leave("the program has ended")
            if self._core is not None:
                self._left.wait()
            if self._acceptor is None and self._listener is not None:
                self._listener.dismiss()
            self._stream.close(_CLOSE_TIME)
            if self._hung_watchdog is not None and self._hung_watchdog == os.getppid():
                os.kill(self._hung_watchdog, signal.SIGKILL)  # otherwise the program would wait for its end

    def _messages(self) -> Iterator[object]:
        """Yield the program's messages, until it is gone or sends an invalid one."""
        try:
            for data in self._stream.messages():
                yield m.CODEC.unpack(data)
        except NotSendable as error:
            log.error("the program's connection was closed: %s", error)

    def listen(self, signals: socket.socket) -> None:
        """Listen for the signals that the program cannot handle; ``signals`` is the socket from which it reads them."""
        self._signal_forwarder = SignalForwarder(signals, STOPPING)

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

    def _open(self, request: m.OpenCell) -> bool:
        try:
            self._require_same(request.version)
            cell, dictionaries = read_once(request.cell)  # checked by the program
            self._begin(cell.beside(request.beside), dictionaries, request)
        except BaseExceptionGroup as group:
            self._stream.send(m.NotOpened(tuple(map(sendable, group.exceptions)), group.message))
            return False
        except BaseException as error:  # noqa: BLE001  # the program gets whatever error it was
            self._stream.send(m.NotOpened((sendable(error),)))
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
        stop = None if self._listener is None else self._listener.first_stop()
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

    def _begin(self, cell: CellConfig, dictionaries: Mapping[int, Eds], request: m.OpenCell) -> None:
        self._await_watchdog()
        self._require_wanted()
        gc.collect()  # now, because after boot-up the drives and the master monitor each other's heartbeats
        link = CanLink(cell, dictionaries, channel=open_bus(cell, self._drives))
        runtime = Runtime(link, sorted(cell.nodes), link.simulated_nodes)
        core = runtime.use(lambda booted: Core(cell, booted))
        names = tuple(cell.axes)
        self._core, publisher = core, Publisher(self._memory, names)
        self._clients = Clients(core, publisher, self._request_pool)
        self._program = self._clients.admit(self._stream, self._client_name)
        self._clients.open_for(self._program, request.shared)
        self._in_cells = request.in_cells
        self._lifeline = Lifeline(self._memory, size_of(self._axes), core, names)
        self._take_signals()
        self._real_time_status = ", ".join(
            [OWN_PROCESS, *set_real_time_priority(), *prevent_deep_sleep(), *pin_to_isolated_processor()]
        )
        outbox = ImageReader(self._memory, names, lambda _: None)
        self._faults = Faults(cell, core.session, core.nodes, publisher, outbox, self._real_time_status)
        if cell.io:
            core.scan.io.note = IoImage(self._memory, self._axes, tuple(cell.io)).write
        tally = SharedCounters(self._memory, self._axes, len(cell.io))
        tally.take(core.scan.lateness)
        core.session.observe(tally.writer(link.carried))
        core.session.observe(publisher.after_cycle)
        core.session.observe(self._faults.after_cycle)
        core.session.observe(self._lifeline.after_cycle)
        core.on_adapter_loss = lambda progress: self._stage(_LOSS_STAGES[progress])
        core.on_axes_stopped = lambda: self._stage(CoreStage.RELEASING)
        core.begin(self._joined)
        core.await_values()
        core.session.observe(IdleCollector(cell.bus.scan_period).after_cycle)
        self._require_wanted()
        self._stage(CoreStage.RUNNING)
        self._admit_programs(request.cell)
        self._stream.send(self._opened())
        threading.Thread(target=self._watch_condition, name="axisbus condition", daemon=True).start()

    def _await_watchdog(self) -> None:
        """Wait until the watchdog process can stop the axes, and simulated drives listen; then start monitoring the process."""
        if not self._watchdog.recv(1):
            raise ScanError(
                "the watchdog process of the core has ended",
                remedy="open the machine again; check the computer's memory",
            )
        self._watchdog.settimeout(BEAT_PERIOD)
        threading.Thread(target=self._monitor_watchdog, name="axisbus watchdog", daemon=True).start()

    def _monitor_watchdog(self) -> None:
        """Leave when the watchdog process has ended, or does not run."""
        watchdog = os.getppid()
        watch = WatchdogProcessMonitor(time.monotonic(), partial(state_of, watchdog))
        while not self._left.is_set():
            received = self._receive_beat()
            why = _WATCHDOG_GONE if received is None else watch.poll(time.monotonic(), received)
            if why is not None:
                self._hung_watchdog = None if received is None else watchdog
                self._leave(why)
                return

    def _receive_beat(self) -> bool | None:
        """Wait a moment for a byte of the watchdog process; return whether one came, None if none can come any more."""
        try:
            return True if self._watchdog.recv(_BEAT_BUFFER) else None
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
        return m.CellOpened(nodes, axes, self._real_time_status, os.getpid(), holder)

    def _admit_programs(self, cell: str) -> None:
        """Begin to admit other programs."""
        assert self._clients is not None
        if self._listener is not None:
            self._acceptor = ClientAcceptor(
                self._listener, self._clients, self._image, self._opened, text_of(cell)
            )
            self._acceptor.start()

    def _facts(self, node_id: int, booted: Booted) -> m.NodeFacts:
        assert self._core is not None
        parts = self._core.nodes[node_id]
        return m.NodeFacts(booted.report, booted.parameters, parts.plans, parts.events is not None)

    def _take_signals(self) -> None:
        for number, name in _TERMINATION_SIGNALS.items():
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
        self._clients.send_to_all(m.NodeJoined(node_id, self._facts(node_id, booted), axes))

    def _watch_condition(self) -> None:
        """Report the end, a failure, or a requested stop of the scan to the clients; and do their periodic work."""
        assert self._clients is not None
        while not self._left.wait(_POLL_PERIOD):
            self._clients.send_condition()
            self._clients.poll()
            self._poll_signals()
        self._clients.send_condition()

    def _poll_signals(self) -> None:
        unread = None if self._signal_forwarder is None else self._signal_forwarder.poll(time.monotonic())
        if unread is not None and self._core is not None:
            name, count = unread
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
            failures = (sendable(error),)
        self._stage(CoreStage.LEFT)
        if self._faults is not None:
            self._faults.close()
        if self._acceptor is not None:
            self._acceptor.close()
        for failure in failures:
            log.info("closed, with an error: %s", failure)
        try:
            if self._clients is not None:
                self._clients.send_condition()
            self._stream.send(m.Left(failures, last_answers(self._core.session, self._core.nodes)))
        except Exception:  # whatever cannot be sent any more: the process ends nevertheless
            log.exception("the end of the core could not be reported")
            self._stream.send(m.Left(failures))
        finally:
            self._left.set()
            self._stream.close(_CLOSE_TIME)


def serve(startup_args: StartupArgs, watchdog: socket.socket) -> None:
    """Run the core of a program until one of the two is gone; blocks. ``watchdog`` leads to the watchdog process."""
    stream = MessageStream(socket.socket(fileno=startup_args.line), m.CODEC.pack, "axisbus answers")
    log.addHandler(StreamHandler(stream))
    line = socket.socket(fileno=startup_args.drives) if startup_args.simulates else None
    server = CoreServer(
        stream,
        mmap.mmap(startup_args.memory, 0),
        startup_args.memory,
        startup_args.axes,
        watchdog,
        line,
        described(startup_args.program, kept=True),
        socket.socket(fileno=startup_args.lock) if startup_args.lock >= 0 else None,
    )
    with suppress(OSError):  # it is already gone, which the end of the connection shows
        server.watch(
            os.pidfd_open(startup_args.program),
            FarEnd(startup_args.program, startup_args.end, startup_args.inode),
        )
    server.listen(socket.socket(fileno=startup_args.signals))
    with journal(startup_args.cell):
        log.info("the core of %s began, for process %d", startup_args.cell, startup_args.program)
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
