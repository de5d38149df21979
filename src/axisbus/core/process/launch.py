"""Start a core in a process of its own, and hold the program's connections to it."""

from __future__ import annotations

import json
import mmap
import os
import select
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import axisbus
from axisbus.bus.link import ownership
from axisbus.bus.link.claims import HeldClaim
from axisbus.cell.model import SIMULATED, BusConfig, CellConfig
from axisbus.core.process import shared_counters
from axisbus.core.process.persistence.plant_log import history_path
from axisbus.core.process.startup_args import StartupArgs
from axisbus.core.realtime_setup import (
    FIFO,
    IN_A_THREAD,
    ISOLATED,
    LOCKED,
    OWN_PROCESS,
    QUICK_WAKING,
    isolated,
    permitted,
)
from axisbus.errors import PlatformError
from axisbus.ipc.own_socket import inode_of

_FIRST_FREE = 3  # the first descriptor after the standard streams
_END_TIMEOUT = 15.0  # seconds for core and watchdog process to end after leaving: a rescue may be in progress


_PERMIT = {
    FIFO: "rtprio 50 in limits.conf",
    LOCKED: "memlock unlimited in limits.conf",
    QUICK_WAKING: "a udev rule that lets your group write /dev/cpu_dma_latency",
}


def has_own_process(bus: BusConfig) -> bool:
    """Whether the core of a cell runs in its own process: as the cell says, else ``AXISBUS_PROCESS``, else if possible."""
    can = sys.platform == "linux" and bus.interface != "virtual"  # that bus exists in one process only
    return can and (bus.process or os.environ.get("AXISBUS_PROCESS", "own")) == "own"


def require_joinable_system() -> None:
    """Check that other programs could join a machine on this system.

    Raises:
        PlatformError: they could not.
    """
    if sys.platform != "linux":
        raise PlatformError(
            "no other program can join a machine on this system",
            observed=f"its core runs in a thread of its program: a process of its own needs Linux, and this is {sys.platform}",
            remedy="let one program do all of the work (a script, or one command such as axisbus move), or use Linux",
        )


def expected(bus: BusConfig) -> str:
    """Return the expected real-time status, as ``Machine.real_time_status``, and the permissions that are missing."""
    if not has_own_process(bus):
        return IN_A_THREAD
    got = [*permitted(), *([ISOLATED] if isolated() else [])]
    missing = [f"{what} is not permitted ({help_})" for what, help_ in _PERMIT.items() if what not in got]
    return ", ".join([OWN_PROCESS, *got]) + "".join(f"; {text}" for text in missing)


class Processes:
    """A core's watchdog process, which forks the core and the simulated drives; holds this end of the connections, and the memory.

    ``line`` leads to the core, ``watchdog`` to the watchdog process, ``control`` to the simulated drives, if there are any.
    """

    def __init__(self, cell: CellConfig, signals: int) -> None:
        """Start the processes, which import and read while the program continues. The core opens the cell only on a later message.

        They have a session of their own, so that Ctrl-C reaches only the program. ``signals``: the descriptor from which this
        program reads its signals, and which the core checks (``core.process.signal_forwarding``).

        Raises:
            SecondMasterError: another program has the channel. ConfigError: as ``history_path``.
        """
        bus, axes = cell.bus, len(cell.axes)
        simulated = bus.interface == SIMULATED
        if simulated:
            history_path(cell)  # before anything is opened: it would end the simulated drives
        lock = ownership.hold_claim(
            bus.interface,
            bus.channel,
            path_of(cell),
            beside=bus.beside,
            accepts_clients=True,
            simulated=simulated,
        )
        self.line, line = socket.socketpair()
        self.watchdog, report_line = socket.socketpair()
        none = (None, None)
        drives, far = can_line() if simulated else none
        near, control = socket.socketpair() if simulated else none
        self.control: socket.socket | None = near
        memory = os.memfd_create("axisbus image")
        os.ftruncate(memory, shared_counters.offset(axes, len(cell.io)) + shared_counters.SIZE)
        self.memory = mmap.mmap(memory, 0)
        others = (drives, far, control, lock)
        own = (line.fileno(), memory, report_line.fileno(), os.getpid())
        end = (self.line.fileno(), inode_of(self.line))
        numbers = [*map(_number, others), lock.mark]
        self._watchdog = _start(StartupArgs(*own, path_of(cell), axes, signals, *end, *numbers))
        self._core: int | None = None  # a descriptor of the core's process
        os.close(memory)
        for passed in (line, report_line, *others):
            if passed is not None:
                passed.close()

    def watch_core(self, process: int) -> None:
        """Remember the core, which lives, by its process ID: ``end`` waits for it too."""
        if process != os.getpid():  # in tests it runs in threads of this process
            with suppress(OSError):
                self._core = os.pidfd_open(process)

    def end(self) -> None:
        """Wait for the end of the processes after leaving; kill those that hang. Blocks at most 15 s for each."""
        _await_end(self._watchdog)
        core, self._core = self._core, None
        if core is not None:  # its watchdog process may have been killed before, and not by this program
            _await_core_end(core)
            os.close(core)

    def abandon(self) -> None:
        """End them before they were asked to open anything; blocks for a moment."""
        for end in (self.line, self.watchdog, self.control):
            if end is not None:
                end.close()
        self._watchdog.kill()
        self._watchdog.wait()

    def disown(self) -> None:
        """Release them in a forked child, which must neither wait for them nor kill them."""
        self._watchdog.returncode = 0


def _number(end: socket.socket | HeldClaim | None) -> int:
    return -1 if end is None else end.fileno()


def path_of(cell: CellConfig) -> str:
    """Return the path by which other processes find the file of a cell."""
    return str(Path(cell.file).absolute())


def _start(startup_args: StartupArgs) -> subprocess.Popen[bytes]:
    with _above_standard_streams(startup_args) as passed:
        return subprocess.Popen(
            [sys.executable, "-P", "-m", "axisbus.core", json.dumps(asdict(passed))],
            pass_fds=sorted(passed.all),
            start_new_session=True,
            stdin=subprocess.DEVNULL,
            env=_environment(),
        )


@contextmanager
def _above_standard_streams(startup_args: StartupArgs) -> Iterator[StartupArgs]:
    """Return ``startup_args`` without the descriptors 0 to 2, which the new process has for its standard streams.

    A program whose standard streams are closed gets these numbers for its sockets.
    """
    import fcntl  # only this system has it

    numbers = {
        name: number for name, number in asdict(startup_args).items() if name in StartupArgs.DESCRIPTORS
    }
    copies: dict[str, Any] = {
        name: fcntl.fcntl(number, fcntl.F_DUPFD_CLOEXEC, _FIRST_FREE)
        for name, number in numbers.items()
        if 0 <= number < _FIRST_FREE
    }
    try:
        yield replace(startup_args, **copies)
    finally:
        for copy in copies.values():
            os.close(copy)


def _await_end(process: subprocess.Popen[bytes]) -> None:
    """Wait for the end of the watchdog process; kill it together with its children, which are in its process group."""
    try:
        process.wait(_END_TIMEOUT)
    except subprocess.TimeoutExpired:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


def _await_core_end(core: int) -> None:
    """Wait for the end of a core; kill one that hangs."""
    poll = select.poll()
    poll.register(core, select.POLLIN)
    if not poll.poll(_END_TIMEOUT * 1000.0):
        with suppress(OSError):
            signal.pidfd_send_signal(core, signal.SIGKILL)


def _environment() -> dict[str, str]:
    """Return an environment in which the process finds this same axisbus, however this program found it."""
    home = Path(axisbus.__file__).parents[1]
    if home.name in ("site-packages", "dist-packages"):
        return dict(os.environ)
    known = os.environ.get("PYTHONPATH")
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(home), *([known] if known else [])])}


_SEND_BUFFER = 1 << 18  # bytes; some thousand frames


def can_line() -> tuple[socket.socket, socket.socket]:
    """Return the two ends of a new CAN line between two processes of one computer: a socket pair, one frame in each packet.

    Its bus is ``bus.link.socketpair_bus``.
    """
    ends = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    for end in ends:
        end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _SEND_BUFFER)
    return ends
