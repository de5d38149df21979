"""Starting a core in a process of its own, and the program's hold on it."""

from __future__ import annotations

import json
import mmap
import os
import socket
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import axisbus
from axisbus.bus.link import ownership
from axisbus.bus.link.claims import HeldClaim
from axisbus.bus.link.socketpair import cable
from axisbus.cell.model import SIMULATED, BusConfig, CellConfig
from axisbus.core.process import shared_counters
from axisbus.core.process.persistence.plant_log import history_path
from axisbus.core.process.startup_args import StartupArgs
from axisbus.core.realtime_setup import (
    APART,
    FIFO,
    IN_A_THREAD,
    LOCKED,
    OWN_PROCESS,
    WAKEFUL,
    isolated,
    permitted,
)
from axisbus.ipc.own_socket import inode_of

_END = (
    15.0  # seconds that core and warden may take to end once they have been left: a rescue may be under way
)


_PERMIT = {
    FIFO: "rtprio 50 in limits.conf",
    LOCKED: "memlock unlimited in limits.conf",
    WAKEFUL: "a udev rule that lets your group write /dev/cpu_dma_latency",
}


def wanted(bus: BusConfig) -> bool:
    """Whether the core of a cell is to run in its own process: as the cell says, else ``AXISBUS_PROCESS``, else where it can."""
    can = sys.platform == "linux" and bus.interface != "virtual"  # that exists in one process only
    return can and (bus.process or os.environ.get("AXISBUS_PROCESS", "own")) == "own"


def expected(bus: BusConfig) -> str:
    """Say how surely the cycles of a cell's core would come in time, as ``Machine.real_time_status`` does, and what would help."""
    if not wanted(bus):
        return IN_A_THREAD
    got = [*permitted(), *([APART] if isolated() else [])]
    lacks = [f"{what} is not permitted ({help_})" for what, help_ in _PERMIT.items() if what not in got]
    return ", ".join([OWN_PROCESS, *got]) + "".join(f"; {lack}" for lack in lacks)


class Processes:
    """A core's warden, which becomes the core and the simulated drives too; holds this end of the connections, and the memory.

    ``line`` leads to the core, ``warden`` to what tells of its death, ``control`` to the simulated drives, where there are such.
    """

    def __init__(self, cell: CellConfig, signals: int) -> None:
        """Start them; they import and read what they need while the program goes on. The core is told later that it may open it.

        They have a session of their own, so that Ctrl-C reaches the program alone. ``signals``: the descriptor out of which this
        program takes its signals, which the core looks at (``core.process.signal_forwarding``).

        Raises:
            SecondMasterError: another program has the channel. ConfigError: as ``history_path``.
        """
        bus, axes = cell.bus, len(cell.axes)
        simulated = bus.interface == SIMULATED
        if simulated:
            history_path(cell)  # before anything is opened: its drives could only die of it
        lock = ownership.hold(
            bus.interface, bus.channel, path_of(cell), beside=bus.beside, door=True, simulated=simulated
        )
        self.line, line = socket.socketpair()
        self.warden, tell = socket.socketpair()
        none = (None, None)
        drives, far = cable() if simulated else none
        near, control = socket.socketpair() if simulated else none
        self.control: socket.socket | None = near
        memory = os.memfd_create("axisbus image")
        os.ftruncate(memory, shared_counters.offset(axes, len(cell.io)) + shared_counters.SIZE)
        self.memory = mmap.mmap(memory, 0)
        others = (drives, far, control, lock)
        own = (line.fileno(), memory, tell.fileno(), os.getpid())
        end = (self.line.fileno(), inode_of(self.line))
        numbers = [*map(_number, others), -1 if lock is None else lock.mark]
        self._warden = _start(StartupArgs(*own, path_of(cell), axes, signals, *end, *numbers))
        os.close(memory)
        for passed in (line, tell, *others):
            if passed is not None:
                passed.close()

    def end(self) -> None:
        """See them end, now that the core has been left; one that hangs is killed. Blocks at most a few seconds."""
        _see_end(self._warden)

    def abandon(self) -> None:
        """End them before they were asked to open anything; blocks for a moment."""
        for end in (self.line, self.warden, self.control):
            if end is not None:
                end.close()
        self._warden.kill()
        self._warden.wait()

    def disown(self) -> None:
        """Let go of them in a forked child, which may neither wait for them nor kill them."""
        self._warden.returncode = 0


def _number(end: socket.socket | HeldClaim | None) -> int:
    return -1 if end is None else end.fileno()


def path_of(cell: CellConfig) -> str:
    """Return the path by which other processes find the file of a cell."""
    return str(Path(cell.file).absolute())


def _start(duty: StartupArgs) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "axisbus.core", json.dumps(asdict(duty))],
        pass_fds=sorted(duty.all),
        start_new_session=True,
        stdin=subprocess.DEVNULL,
        env=_environment(),
    )


def _see_end(process: subprocess.Popen[bytes]) -> None:
    try:
        process.wait(_END)
    except subprocess.TimeoutExpired:
        process.kill()
        process.wait()


def _environment() -> dict[str, str]:
    """Return the environment in which it finds this very axisbus, however this program did."""
    home = Path(axisbus.__file__).parents[1]
    if home.name in ("site-packages", "dist-packages"):
        return dict(os.environ)
    known = os.environ.get("PYTHONPATH")
    return {**os.environ, "PYTHONPATH": os.pathsep.join([str(home), *([known] if known else [])])}
