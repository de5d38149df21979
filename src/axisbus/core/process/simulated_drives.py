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
from axisbus.core.other_protocols import accesses_of, foreign_nodes_of, simulated_foreign_nodes
from axisbus.core.process.persistence.plant_log import PlantLog, history_path
from axisbus.core.process.remote_proxy import answer_all
from axisbus.core.process.startup_args import StartupArgs
from axisbus.core.realtime_setup import set_real_time_priority
from axisbus.core.simulated_nodes import SimulatedNode, devices
from axisbus.ipc.messages import CODEC
from axisbus.ipc.stream import MessageStream
from axisbus.sim.node.network import SimulatedNetwork

_POLL_PERIOD = 0.05  # seconds
_LOG_PERIOD = 0.01  # seconds between two lines of a history


def serve(startup_args: StartupArgs, ready: socket.socket) -> None:
    """Run the drives of a cell until its core and its program are gone; blocks. ``ready`` is closed when they listen."""
    line, control = socket.socket(fileno=startup_args.far), socket.socket(fileno=startup_args.control)
    config, dictionaries = read_once(startup_args.cell)
    made, others = devices(config, dictionaries), simulated_foreign_nodes(config)
    # as for the core, so that a busy computer does not make drives look lost; not earlier, because making them needs a processor
    set_real_time_priority()
    core_poll = select.poll()
    core_poll.register(line, 0)  # only for the end of the line
    bus = PairBus(line, of_drives=True)
    with SimulatedNetwork(
        "line", list(made.values()), bus=bus, foreign_nodes=foreign_nodes_of(others)
    ) as network:
        ready.close()
        simulated_nodes = {node_id: SimulatedNode(device, network.lock) for node_id, device in made.items()}
        simulated_nodes |= accesses_of(others, network.lock)
        stream = MessageStream(control, CODEC.pack, "axisbus drives")
        answering = threading.Thread(
            target=answer_all, args=(stream, simulated_nodes), name="axisbus asked", daemon=True
        )
        answering.start()
        with _history(config, simulated_nodes) as history:
            while answering.is_alive() or not core_poll.poll(0):
                time.sleep(_POLL_PERIOD if history is None else _LOG_PERIOD)
                if history is not None:
                    history.note()


def _history(
    cell: CellConfig, simulated_nodes: Mapping[int, SimulatedNode]
) -> AbstractContextManager[PlantLog | None]:
    """Return the log file of ``history`` in ``[bus.options]``, in the cell's folder; None if there is none."""
    path = history_path(cell)
    return nullcontext() if path is None else PlantLog(path, simulated_nodes)
