"""Opening the bus that a subcommand was told of: by a cell file, or by adapter and channel."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.cli.options import parse_options

if TYPE_CHECKING:
    from axisbus.bus.changeover import Opening
    from axisbus.bus.channel import Channel


def open_bus(
    stack: ExitStack,
    cell: Path | None,
    interface: str | None,
    channel: str | None,
    bitrate: int | None,
    option: tuple[str, ...],
) -> Channel:
    """Open a bus; ``stack`` closes it. A simulated cell's bus has its stand-ins on it.

    Raises:
        UsageError: neither a cell file nor an interface is given.
        ConfigError, EdsError, AdapterError: the cell file is wrong, or the bus cannot be opened.
    """
    from axisbus.bus.channel import Channel

    if interface is not None:
        return stack.enter_context(Channel.open(interface, channel, bitrate, **parse_options(option)))
    if cell is None:
        raise click.UsageError("give a cell file, or the bus with -i and -c (such as: -i socketcan -c can0)")
    from axisbus.machine import config
    from axisbus.machine.runtime import load_dictionaries
    from axisbus.machine.wire import SIM, open_channel

    loaded = config.load(cell)
    dictionaries = load_dictionaries(loaded) if loaded.bus.interface == SIM else {}
    return open_channel(loaded, dictionaries, stack)[0]


def opening_of(
    cell: Path | None,
    interface: str | None,
    channel: str | None,
    bitrate: int | None,
    option: tuple[str, ...],
) -> Opening:
    """Return how ``open_bus`` opens the adapter that it is given, so that it can be opened again at another rate.

    Raises:
        UsageError, ConfigError: as ``open_bus``.
    """
    from axisbus.bus.changeover import Opening

    if interface is not None or cell is None:
        return Opening(interface or "", channel, bitrate, parse_options(option))
    from axisbus.machine import config
    from axisbus.machine.wire import SIM

    bus = config.load(cell).bus
    virtual = bus.interface == SIM
    return Opening("virtual" if virtual else bus.interface, bus.channel, bus.bitrate, bus.options)
