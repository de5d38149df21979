"""Listening on a cell's bus; a simulated cell gets its simulated drives, and is heard from their first frame on."""

from __future__ import annotations

import itertools
import os
from contextlib import ExitStack

from axisbus.bus.link import adapter
from axisbus.bus.link.listen import Listener, listen
from axisbus.cell.model import SIMULATED, CellConfig
from axisbus.core.files import load_dictionaries
from axisbus.core.other_protocols import foreign_nodes_of, simulated_foreign_nodes
from axisbus.sim.build import device_from_eds
from axisbus.sim.node.network import SimulatedNetwork

_CHANNELS = itertools.count(1)


def listen_to(cell: CellConfig, stack: ExitStack, *, silent: bool = False) -> Listener:
    """Open a cell's bus for listening only; ``stack`` closes it. Blocks as the adapter's driver does.

    ``silent``: the controller must not acknowledge frames either, if the adapter supports this (``listenonly``).

    Raises:
        EdsError, AdapterError: an EDS of a simulated cell, or the adapter, cannot be opened.
    """
    bus = cell.bus
    if bus.interface != SIMULATED:
        options = adapter.silent(bus.interface, bus.options) if silent else bus.options
        return stack.enter_context(listen(bus.interface, bus.channel, bus.bitrate, options))
    name = f"axisbus-listen-{os.getpid()}-{next(_CHANNELS)}"
    listener = stack.enter_context(listen("virtual", name, None, {}))
    files = load_dictionaries(cell)
    devices = [device_from_eds(eds, node_id, seed=node_id) for node_id, eds in files.items()]
    stack.enter_context(
        SimulatedNetwork(name, devices, foreign_nodes=foreign_nodes_of(simulated_foreign_nodes(cell)))
    )
    return listener
