"""Simulated drives in a process of their own: they continue without the core or the program, and end after both.

Theory of operation
-------------------
They are connected to one end of a line (``bus.link.socketpair_bus``), and the core to the other. They also answer the program's
requests (``remote_proxy``). They end when both connections have ended. Thus a test can observe a drive after its master is gone.
"""

from __future__ import annotations

import select
import socket
import threading
import time
from collections.abc import Mapping
from contextlib import AbstractContextManager, nullcontext

from axisbus.bus.link.socketpair_bus import PairBus
from axisbus.cell.model import CellConfig
from axisbus.core.files import read_once
from axisbus.core.other_protocols import accesses_of, guests_of, simulated_guests
from axisbus.core.process.persistence.plant_log import PlantLog, history_path
from axisbus.core.process.remote_proxy import answer_all
from axisbus.core.process.startup_args import StartupArgs
from axisbus.core.realtime_setup import take_priority
from axisbus.core.simulated_nodes import SimulatedNode, devices
from axisbus.ipc.messages import CODEC
from axisbus.ipc.stream import MessageStream
from axisbus.sim.node.network import StandIns

_ROUND = 0.05  # seconds
_NOTED = 0.01  # seconds between two lines of a history


def serve(duty: StartupArgs, ready: socket.socket) -> None:
    """Run the drives of a cell until its core and its program are gone; blocks. ``ready`` is closed when they listen."""
    line, control = socket.socket(fileno=duty.far), socket.socket(fileno=duty.control)
    config, dictionaries = read_once(duty.cell)
    made, others = devices(config, dictionaries), simulated_guests(config)
    # as for the core, so that a busy computer does not make drives look lost; not earlier, because making them needs a processor
    take_priority()
    gone = select.poll()
    gone.register(line, 0)  # only for the end of the line
    bus = PairBus(line, of_drives=True)
    with StandIns("line", list(made.values()), bus=bus, guests=guests_of(others)) as network:
        ready.close()
        stand_ins = {node_id: SimulatedNode(device, network.lock) for node_id, device in made.items()}
        stand_ins |= accesses_of(others, network.lock)
        stream = MessageStream(control, CODEC.pack, "axisbus drives")
        asked = threading.Thread(
            target=answer_all, args=(stream, stand_ins), name="axisbus asked", daemon=True
        )
        asked.start()
        with _history(config, stand_ins) as history:
            while asked.is_alive() or not gone.poll(0):
                time.sleep(_ROUND if history is None else _NOTED)
                if history is not None:
                    history.note()


def _history(
    cell: CellConfig, stand_ins: Mapping[int, SimulatedNode]
) -> AbstractContextManager[PlantLog | None]:
    """Return the log file of ``history`` in ``[bus.options]``, in the cell's folder; None if there is none."""
    path = history_path(cell)
    return nullcontext() if path is None else PlantLog(path, stand_ins)
