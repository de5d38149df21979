"""The drives of a cell, served on a port for other programs, with their planned faults."""

from __future__ import annotations

import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

from axisbus.cell.model import CellConfig
from axisbus.core.can_simple.simulated_modules import modules as modules_of_cell
from axisbus.core.can_simple.simulated_modules import stand_ins_of
from axisbus.core.files import load_dictionaries
from axisbus.core.realtime_setup import take_priority
from axisbus.core.sim_server.control import ControlDoor
from axisbus.core.sim_server.player import Player
from axisbus.core.simulated_nodes import SimulatedNode, devices
from axisbus.eds.model import Eds
from axisbus.sim.can_simple.module import Module
from axisbus.sim.faults.plan import PlannedFault
from axisbus.sim.node.network import StandIns
from axisbus.sim.socketcand.server import Server

_LOOK = 0.2  # seconds between two checks of the time
_STEP = 0.005  # seconds between two checks of the faults' conditions


class Served:
    """Holds the devices of a cell, further modules of other protocols, and, while they are served, the player of the faults."""

    def __init__(
        self, cell: CellConfig | None, faults: Sequence[PlannedFault], modules: Sequence[Module] = ()
    ) -> None:
        """Make the devices; blocks for reading their files. ``modules`` are added to those of the cell.

        Raises:
            EdsError: one is missing or cannot be read.
        """
        self._cell = cell
        self._faults = tuple(faults)
        own = {} if cell is None else modules_of_cell(cell)
        self._own = own
        self._modules = (*own.values(), *modules)
        self._dictionaries: Mapping[int, Eds] = {} if cell is None else load_dictionaries(cell)
        self._devices = {} if cell is None else devices(cell, self._dictionaries)
        self._player: Player | None = None

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
                StandIns(server.channel, list(self._devices.values()), bus=server.bus, guests=self._modules)
            )
            if control is not None:
                made = {
                    node_id: SimulatedNode(device, network.lock) for node_id, device in self._devices.items()
                }
                made |= stand_ins_of(self._own, network.lock)
                stack.callback(ControlDoor(control, made).close)
            if self._faults and self._cell is not None:
                self._player = Player(
                    self._faults, self._cell, self._dictionaries, self._devices, network.lock
                )
            take_priority()  # as for the drives of a core, so that a busy computer does not make them look lost
            yield server

    def play(self, seconds: float | None) -> Iterator[str]:
        """Play the faults for this time (None: without end), and yield the texts about each; blocks meanwhile."""
        begin = time.monotonic()
        pause = _LOOK if self._player is None else _STEP
        while seconds is None or time.monotonic() - begin < seconds:
            now = time.monotonic() - begin
            for line in () if self._player is None else self._player.step(now):
                yield f"{now:8.2f} s  {line}"
            time.sleep(pause)
