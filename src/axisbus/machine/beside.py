"""Stopping a cell's drives beside whoever else is on the bus: no boot, no reset, only a stop that lasts.

Only when all axes of a node stand or are off is the node stopped (NMT), which a live master has to take as a fault. A module that
speaks CAN Simple has no such state: it is left without power, or holds its place where its quick stop does.
"""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import replace
from functools import partial

from axisbus.bus.link.channel import Channel
from axisbus.bus.node import nmt
from axisbus.bus.node.node import Node
from axisbus.bus.parallel import in_parallel
from axisbus.cell.can_simple.modules import settings_by_axis
from axisbus.cell.model import CellConfig
from axisbus.cia301.nmt import NmtCommand
from axisbus.core.can_simple.stop import stop_modules
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
        stops = [partial(_stop, cell, node) for node in nodes]
        results = in_parallel(lambda stop: stop(), [*stops, partial(_stop_modules, cell, channel)])
    return [result for each in results for result in each]


def _stop_modules(cell: CellConfig, channel: Channel) -> list[Stopped]:
    modules = settings_by_axis(cell, cell.axes)
    held = {name for name, settings in modules.items() if settings.quick_stop_holds}
    return [
        replace(each, text=f"{each.text}; a master that is alive can move it again")
        if each.ok and each.axis in held
        else each
        for each in stop_modules(channel, modules)
    ]


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
