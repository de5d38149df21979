"""Opening the bus that a subcommand was told of: by a cell file, or by adapter and channel."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.cli.options import parse_options
from axisbus.machine.cell import CellConfig

if TYPE_CHECKING:
    from axisbus.bus.changeover import Opening
    from axisbus.bus.channel import Channel

SIM = "sim"
_NO_BUS = "give a cell file, or the bus with -i and -c (such as: -i socketcan -c can0)"


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
        UsageError: neither a cell file nor an interface is given, or an option that this bus cannot have.
        ConfigError, EdsError, AdapterError: the cell file is wrong, or the bus cannot be opened.
    """
    from axisbus.bus.channel import Channel

    options = parse_options(option)
    if interface is not None:
        require_rate(interface, bitrate, options)
        return stack.enter_context(Channel.open(interface, channel, bitrate, **options))
    if cell is None:
        raise click.UsageError(_NO_BUS)
    from axisbus.machine import config
    from axisbus.machine.runtime import load_dictionaries
    from axisbus.machine.wire import open_channel

    loaded = with_options(config.load(cell), channel, bitrate, option)
    dictionaries = load_dictionaries(loaded) if loaded.bus.interface == SIM else {}
    return open_channel(loaded, dictionaries, stack)[0]


def with_options(
    cell: CellConfig, channel: str | None, bitrate: int | None, option: tuple[str, ...]
) -> CellConfig:
    """Return a cell whose [bus] is replaced by what -c, -b and -O say.

    Raises:
        UsageError: its bus is simulated, and so can have neither channel nor options.
    """
    bus, options = cell.bus, parse_options(option)
    if bus.interface == SIM and (channel is not None or options):
        raise click.UsageError(
            f"{cell.file} is simulated, on a bus of its own: leave -c and -O out, or say another bus with -i"
        )
    given = replace(
        bus,
        channel=bus.channel if channel is None else channel,
        bitrate=bus.bitrate if bitrate is None else bitrate,
        options={**bus.options, **options},
    )
    return replace(cell, bus=given)


def require_rate(interface: str, bitrate: int | None, options: Mapping[str, object]) -> None:
    """Check that a bit rate is given where the adapter sets it.

    Raises:
        UsageError: it is not. AdapterError: the interface is not known.
    """
    from axisbus.bus import adapter

    adapter.check_interface(interface)
    if bitrate is None and adapter.sets_rate(interface, options):
        raise click.UsageError(
            f"{interface} sets the bit rate of its bus, so it must be given: add -b 1000000 (bit/s, the same for all nodes)"
        )


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

    bus = with_options(config.load(cell), channel, bitrate, option).bus
    virtual = bus.interface == SIM
    return Opening("virtual" if virtual else bus.interface, bus.channel, bus.bitrate, bus.options)
