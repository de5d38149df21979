"""Opens the bus for its owner: its adapter, or the line to simulated drives in another process."""

from __future__ import annotations

import socket

from axisbus.bus.link.channel import Channel
from axisbus.bus.link.socketpair_bus import PairBus
from axisbus.cell.model import CellConfig
from axisbus.cell.other_protocols import adapter_options


def open_bus(cell: CellConfig, drives: socket.socket | None = None) -> Channel:
    """Open the adapter of a cell's bus, or the line to simulated drives in another process; raises AdapterError."""
    if drives is not None:
        line = PairBus(drives)
        channel = Channel(line, "sim")
        channel.behind = line.behind
        return channel
    bus = cell.bus
    return Channel.open(bus.interface, bus.channel, bus.bitrate, **bus.options, **adapter_options(cell))
