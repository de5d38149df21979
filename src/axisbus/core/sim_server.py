"""The drives of a cell, served on a port for other programs, with their planned faults."""

from __future__ import annotations

import os
import socket
import stat
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

from axisbus.cell.model import CellConfig
from axisbus.cell.parameters import axis_parameters
from axisbus.cia402.state import decode
from axisbus.core.files import load_dictionaries
from axisbus.core.other_protocols import accesses_of, foreign_nodes_of, simulated_foreign_nodes
from axisbus.core.process.remote_proxy import answer_all
from axisbus.core.realtime_setup import set_real_time_priority
from axisbus.core.simulated_nodes import SimulatedNode, devices
from axisbus.eds.model import Eds
from axisbus.errors import UserError
from axisbus.ipc.messages import CODEC
from axisbus.ipc.stream import MessageStream
from axisbus.ipc.values import NotSendable
from axisbus.record.columns import AxisForm, digits
from axisbus.sim.device import Device
from axisbus.sim.drive import Drive
from axisbus.sim.fault_plan import Plan, PlannedFault
from axisbus.sim.node.network import ForeignNode, SimulatedNetwork
from axisbus.sim.socketcand_server import Server
from axisbus.system.local_sockets import local_socket

_POLL_PERIOD = 0.2  # seconds between two checks of the time
_STEP = 0.005  # seconds between two checks of the faults' conditions


class ServedDrives:
    """Holds the devices of a cell, further modules of other protocols, and, while they are served, the player of the faults."""

    def __init__(
        self,
        cell: CellConfig | None,
        faults: Sequence[PlannedFault],
        foreign_nodes: Sequence[ForeignNode] = (),
    ) -> None:
        """Make the devices; blocks for reading their files. ``foreign_nodes`` are added to those of the cell.

        Raises:
            EdsError: one is missing or cannot be read.
        """
        self._cell = cell
        self._faults = tuple(faults)
        self._cell_foreign_nodes = {} if cell is None else simulated_foreign_nodes(cell)
        self._foreign_nodes = (*foreign_nodes_of(self._cell_foreign_nodes), *foreign_nodes)
        self._dictionaries: Mapping[int, Eds] = {} if cell is None else load_dictionaries(cell)
        self._devices = {} if cell is None else devices(cell, self._dictionaries)
        self._fault_player: FaultPlayer | None = None

    @contextmanager
    def serve(self, port: int, control: Path | None = None) -> Iterator[Server]:
        """Run the drives during the block, on this port (0: any free one), with access to their plant at ``control`` for tests.

        Raises:
            AdapterError: the port is taken.
            UserError: there can be no control at this path.
        """
        with ExitStack() as stack:
            server = Server(port)
            stack.callback(server.close)
            network = stack.enter_context(
                SimulatedNetwork(
                    server.channel,
                    list(self._devices.values()),
                    bus=server.bus,
                    foreign_nodes=self._foreign_nodes,
                )
            )
            if control is not None:
                made = {
                    node_id: SimulatedNode(device, network.lock) for node_id, device in self._devices.items()
                }
                made |= accesses_of(self._cell_foreign_nodes, network.lock)
                stack.callback(ControlSocket(control, made).close)
            if self._faults and self._cell is not None:
                self._fault_player = FaultPlayer(
                    self._faults, self._cell, self._dictionaries, self._devices, network.lock
                )
            set_real_time_priority()  # as for the drives of a core, so that a busy computer does not make them look lost
            yield server

    def play(self, seconds: float | None) -> Iterator[str]:
        """Play the faults for this time (None: without end), and yield the texts about each; blocks meanwhile."""
        begin = time.monotonic()
        pause = _POLL_PERIOD if self._fault_player is None else _STEP
        while seconds is None or time.monotonic() - begin < seconds:
            now = time.monotonic() - begin
            for line in () if self._fault_player is None else self._fault_player.step(now):
                yield f"{now:8.2f} s  {line}"
            time.sleep(pause)


# -- Executes planned faults on simulated drives; the values for their conditions come from the drives themselves ------


class FaultPlayer:
    """Holds the plan, and the drive of each axis with its units. Positions are those of the drive (6064h)."""

    def __init__(
        self,
        faults: Sequence[PlannedFault],
        cell: CellConfig,
        dictionaries: Mapping[int, Eds],
        devices: Mapping[int, Device],
        lock: AbstractContextManager[object],
    ) -> None:
        """``lock``: that of the devices, taken for each step."""
        self._plan = Plan(faults, devices)
        self._lock = lock
        self._axes = {
            name: (
                devices[axis.node].drives[axis.drive_axis - 1],
                AxisForm.of(axis_parameters(cell, name, dictionaries[axis.node])),
            )
            for name, axis in cell.driven.items()
        }

    def step(self, now: float) -> list[str]:
        """Execute the faults that are due ``now`` (seconds since the drives began); return the texts about them."""
        with self._lock:
            return self._plan.step(now, {name: _values(*axis) for name, axis in self._axes.items()})


def _values(drive: Drive, form: AxisForm) -> dict[str, Any]:
    return {
        "position": round(drive.position / form.position, digits(form.position)),
        "velocity": round(drive.velocity / form.velocity, digits(form.velocity)),
        "torque": drive.torque * form.torque,
        "state": decode(drive.statusword).value,
        "mode": drive.mode_display,
        "statusword": drive.statusword,
    }


# -- Access to the plant of served drives, for tests: a Unix socket of this user only, separate from the public bus ----


_BACKLOG = 16
_LARGEST = 1 << 20  # bytes of a request


class ControlSocket:
    """Gives programs of this user access to simulated drives and their fault settings; holds the socket."""

    def __init__(self, path: Path, simulated_nodes: Mapping[int, SimulatedNode]) -> None:
        """``path``: of the socket, which is created; a socket without a listener is replaced.

        Raises:
            UserError: it cannot be made there, or this platform has no such sockets.
        """
        self._simulated_nodes = simulated_nodes
        self._path = path
        self._socket = _listening(path)
        threading.Thread(target=self._accept, name="axisbus control", daemon=True).start()

    def close(self) -> None:
        """Accept no more connections."""
        with suppress(OSError):
            self._path.unlink()
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)
        self._socket.close()

    def _accept(self) -> None:
        while True:
            try:
                line, _ = self._socket.accept()
            except OSError:
                return
            threading.Thread(target=self._answer, args=(line,), name="axisbus asked", daemon=True).start()

    def _answer(self, line: socket.socket) -> None:
        stream = MessageStream(line, CODEC.pack, "axisbus answers", _LARGEST)
        try:
            with suppress(NotSendable):
                answer_all(stream, self._simulated_nodes)
        finally:
            stream.finish()


def _listening(path: Path) -> socket.socket:
    _require_free_path(path)
    made = local_socket()
    before = os.umask(0o177)
    try:
        if _is_stale_socket(path):
            path.unlink()
        made.bind(str(path))
        made.listen(_BACKLOG)
    except OSError as error:
        made.close()
        raise UserError(
            f"{path} cannot be made the control socket of the drives",
            observed=str(error.strerror or error),
            remedy="give a path in a folder of your own with --control, of at most 100 bytes",
        ) from error
    finally:
        os.umask(before)
    return made


def _require_free_path(path: Path) -> None:
    if path.exists() and not stat.S_ISSOCK(path.stat().st_mode):
        raise UserError(
            f"{path} exists already, and is not a socket", remedy="give another name with --control"
        )


def _is_stale_socket(path: Path) -> bool:
    """Whether a socket without a listener is there."""
    if not path.exists():
        return False
    with local_socket() as tried:
        try:
            tried.connect(str(path))
        except OSError:
            return True
    return False
