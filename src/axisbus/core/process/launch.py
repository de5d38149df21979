"""Starting a core in a process of its own, and the program's hold on it."""

from __future__ import annotations

import json
import mmap
import os
import socket
import subprocess
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import axisbus
from axisbus.bus.link import ownership, pair
from axisbus.cell.model import SIMULATED, BusConfig, CellConfig
from axisbus.core.process.duty import Duty
from axisbus.wire import image, lifeline

_END = (
    15.0  # seconds that core and warden may take to end once they have been left: a rescue may be under way
)


def wanted(bus: BusConfig) -> bool:
    """Whether the core of a cell is to run in its own process: as the cell says, else ``AXISBUS_PROCESS``, else where it can."""
    can = sys.platform == "linux" and bus.interface != "virtual"  # that exists in one process only
    return can and (bus.process or os.environ.get("AXISBUS_PROCESS", "own")) == "own"


class Processes:
    """A core's process with its warden, and that of its simulated drives; holds this end of the connections, and the memory.

    ``line`` leads to the core, ``warden`` to what tells of its death, ``control`` to the simulated drives, where there are such.
    """

    drives: subprocess.Popen[bytes]  # where they are simulated

    def __init__(self, cell: CellConfig) -> None:
        """Start them; they import what they need while the program goes on. The core is told later what to open.

        They have a session of their own, so that Ctrl-C reaches the program alone.

        Raises:
            SecondMasterError: another program has the channel.
        """
        bus, axes = cell.bus, len(cell.axes)
        simulated = bus.interface == SIMULATED
        lock = None if simulated else ownership.take(bus.interface, bus.channel, beside=bus.beside)
        self.line, line = socket.socketpair()
        self.warden, tell = socket.socketpair()
        self.control: socket.socket | None = None
        drives = self._start_drives(cell) if simulated else None
        memory = os.memfd_create("axisbus image")
        os.ftruncate(memory, image.size_of(axes) + lifeline.size_of(axes))
        self.memory = mmap.mmap(memory, 0)
        own = (line.fileno(), memory, tell.fileno(), os.getpid())
        duty = Duty(*own, str(Path(cell.file).absolute()), axes, _number(drives), _number(lock))
        self._warden = _start("warden", [json.dumps(asdict(duty))], [tell.fileno(), *duty.of_core])
        os.close(memory)
        for end in (line, tell, drives, lock):
            if end is not None:
                end.close()

    def _start_drives(self, cell: CellConfig) -> socket.socket:
        """Start the simulated drives; return the core's end of the line to them."""
        near, far = pair.line()
        self.control, control = socket.socketpair()
        ends = (far, control)
        numbers = [end.fileno() for end in ends]
        self.drives = _start("drives", [*numbers, Path(cell.file).absolute()], numbers)
        for end in ends:
            end.close()
        return near

    def end(self) -> None:
        """See them end, now that the core has been left; one that hangs is killed. Blocks at most a few seconds."""
        _see_end(self._warden)

    def disown(self) -> None:
        """Let go of them in a forked child, which may neither wait for them nor kill them."""
        self._warden.returncode = 0


def _number(end: socket.socket | None) -> int:
    return -1 if end is None else end.fileno()


def _start(what: str, arguments: Sequence[object], descriptors: Sequence[int]) -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-P", "-m", "axisbus.core", what, *map(str, arguments)],
        pass_fds=descriptors,
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
