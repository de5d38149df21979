"""Stopping a cell's drives beside whoever else is on the bus: no boot, no reset, only a stop that lasts.

Only when all axes of a node stand or are off is the node stopped (NMT), which a live master has to take as a fault.
"""

from __future__ import annotations

from contextlib import ExitStack

from axisbus.bus.node import nmt
from axisbus.bus.node.node import Node
from axisbus.bus.parallel import in_parallel
from axisbus.cell.model import CellConfig
from axisbus.cia301.nmt import NmtCommand
from axisbus.core.canlink import open_channel
from axisbus.core.files import load_dictionaries
from axisbus.core.node_stop import NodeStop
from axisbus.errors import BusError
from axisbus.link import Stopped


def stop_beside(cell: CellConfig) -> list[Stopped]:
    """Stop every axis of a cell; blocks until all stand, at most about 10 s. Energises and configures nothing.

    Raises:
        EdsError, AdapterError: an EDS or the bus cannot be opened.
    """
    dictionaries = load_dictionaries(cell)
    with ExitStack() as stack:
        channel, _ = open_channel(cell, dictionaries, stack)
        nodes = [stack.enter_context(Node(channel, node_id, eds)) for node_id, eds in dictionaries.items()]
        results = in_parallel(lambda node: _stop(cell, node), nodes)
    return [result for node in results for result in node]


def _stop(cell: CellConfig, node: Node) -> list[Stopped]:
    axes = list(cell.axes_of(node.node_id))
    results = NodeStop(node, axes).run()
    if not all(result.ok for result in results):
        return results
    try:
        nmt.send(node.channel, NmtCommand.STOP, node.node_id)
    except BusError as error:
        return [
            Stopped(axis.name, False, f"stands, but its node could not be stopped: {error.message}")
            for axis in axes
        ]
    return results
