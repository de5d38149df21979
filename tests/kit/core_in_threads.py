"""A core in its own process, without the processes: core and simulated drives run in threads of the test, over the same sockets.

Thus virtual time reaches them, and the exchange between clients and their server is the same. The watchdog process only sends
its bytes, and stops no drive; its actions, and the consequences of the end of a process, are tested with processes.
"""

from __future__ import annotations

import logging
import os
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import fields, replace
from functools import partial
from typing import Any
from unittest import mock

from axisbus.core.process import launch, server, simulated_drives
from axisbus.core.process.rescue import BEAT_PERIOD
from axisbus.core.process.startup_args import StartupArgs
from axisbus.ipc.stream import MessageStream

_NO_DESCRIPTORS = ("program", "cell", "axes", "end", "inode")  # of the core's process


class ProcessThread(threading.Thread):
    """Runs the function of a process; at its end it closes the resources that the end of a process would close."""

    def __init__(self, run: Callable[[], None]) -> None:
        super().__init__(daemon=True)
        self._run = run
        self._left: list[Callable[[], None]] = []

    def run(self) -> None:
        """Run it, and close."""
        try:
            self._run()
        finally:
            for close in reversed(self._left):
                close()

    def leaves(self, close: Callable[[], None]) -> None:
        """Call ``close`` at the end."""
        self._left.append(close)


class CoreThreads:
    """Takes the place of the watchdog process (``subprocess.Popen``): ends when the core has ended."""

    returncode: int | None = None

    def __init__(self, startup_args: StartupArgs) -> None:
        numbers = {each.name: getattr(startup_args, each.name) for each in fields(startup_args)}
        own = {
            name: os.dup(number)
            for name, number in numbers.items()
            if name not in _NO_DESCRIPTORS and number >= 0
        }
        self._core = ProcessThread(partial(_run, replace(startup_args, **own)))
        self._core.start()

    def wait(self, timeout: float | None = None) -> int:
        """As of ``Popen``."""
        self._core.join(timeout)
        if self._core.is_alive():
            raise subprocess.TimeoutExpired("core", timeout or 0.0)
        self.returncode = 0
        return 0

    def kill(self) -> None:
        """As of ``Popen``; the core ends with its connection."""


def _run(startup_args: StartupArgs) -> None:
    hears, ready = socket.socketpair()
    near, far = socket.socketpair()
    drives = ProcessThread(partial(simulated_drives.serve, startup_args, ready))
    beats = threading.Thread(target=_beat, args=(near,), daemon=True)
    with hears, ready, far:
        if startup_args.simulates:
            drives.start()
            hears.recv(1)
        beats.start()
        server.serve(startup_args, far)
    beats.join()
    for number in (startup_args.memory, startup_args.report_line, startup_args.mark):
        if number >= 0:
            os.close(number)


def _beat(line: socket.socket) -> None:
    with line, suppress(OSError):
        while True:
            line.sendall(b"r")
            time.sleep(BEAT_PERIOD)


class _Sockets:
    """Takes the place of the module ``socket``."""

    def __getattr__(self, name: str) -> Any:
        return getattr(socket, name)

    def socket(self, fileno: int) -> socket.socket:
        """Return the socket of a descriptor that the process has."""
        found = socket.socket(fileno=fileno)
        _process().leaves(found.close)
        return found


def _stream(*given: Any) -> MessageStream:
    stream = MessageStream(*given)
    _process().leaves(stream.finish)
    return stream


def _process() -> ProcessThread:
    thread = threading.current_thread()
    assert isinstance(thread, ProcessThread)
    return thread


@contextmanager
def core_in_threads() -> Iterator[None]:
    """Let each ``Machine.open`` run the core of a cell with ``process = "own"`` in threads."""
    changes: list[tuple[Any, str, Any]] = [
        (launch, "_start", CoreThreads),
        *((module, "socket", _Sockets()) for module in (server, simulated_drives)),
        *((module, "MessageStream", _stream) for module in (server, simulated_drives)),
        (server, "StreamHandler", lambda _: logging.NullHandler()),  # the program has the log already
        (server.CoreServer, "_take_signals", lambda _: None),
        # Priority, processor and garbage collector are those of the tests.
        *(
            (server, name, list)
            for name in ("set_real_time_priority", "prevent_deep_sleep", "pin_to_isolated_processor")
        ),
        (simulated_drives, "set_real_time_priority", list),
        (server, "IdleCollector", mock.MagicMock()),
    ]
    with ExitStack() as stack:
        for owner, name, replacement in changes:
            stack.enter_context(mock.patch.object(owner, name, replacement))
        yield
