"""Open the bus of a subcommand: given by a cell file, or by adapter and channel."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.cell.model import SIMULATED, CellConfig
from axisbus.cli.shared.options import parse_options

if TYPE_CHECKING:
    from axisbus.bus.link.bitrate_change import Opening
    from axisbus.bus.link.channel import Channel

_NO_BUS = "give a cell file, or the bus with -i and -c (such as: -i socketcan -c can0)"


def open_bus(
    stack: ExitStack,
    cell: Path | None,
    interface: str | None,
    channel: str | None,
    bitrate: int | None,
    option: tuple[str, ...],
) -> Channel:
    """Open a bus; ``stack`` closes it. With a simulated cell, or ``-i sim -c CELL``, it has the simulated drives of the cell.

    Raises:
        UsageError: neither a cell file nor an interface is given, no cell with ``-i sim``, or an invalid option for this bus.
        ConfigError, EdsError, AdapterError: the cell file is wrong, or the bus cannot be opened.
        StateError: the cell is simulated, and a machine of it runs.
    """
    from axisbus.bus.link.channel import Channel

    options = parse_options(option)
    if interface == SIMULATED:
        return _simulated_nodes(stack, simulated(channel, option))
    if interface is not None:
        require_rate(interface, bitrate, options)
        return stack.enter_context(Channel.open(interface, channel, bitrate, **options))
    if cell is None:
        raise click.UsageError(_NO_BUS)
    from axisbus.cell import reader

    loaded = with_options(reader.load(cell), channel, bitrate, option)
    if loaded.bus.interface == SIMULATED:
        from axisbus.cli.shared.attach_or_open import require_none_runs

        require_none_runs(cell)
    return _simulated_nodes(stack, loaded)


def simulated(channel: str | None, option: tuple[str, ...]) -> CellConfig:
    """Read the cell of ``-i sim -c CELL``; its nodes are simulated whatever its own bus is.

    Raises:
        UsageError: no cell is given, or an adapter option is, which a simulated bus does not have.
        ConfigError: the cell file is wrong.
    """
    from axisbus.cell import reader

    if channel is None:
        raise click.UsageError(
            "-i sim simulates the nodes of a cell file: give it with -c (-c examples/cell.toml)"
        )
    if option:
        raise click.UsageError("-i sim has no adapter, and therefore no adapter options: leave -O out")
    loaded = reader.load(Path(channel))
    if loaded.bus.interface == SIMULATED:
        return loaded
    return replace(loaded, bus=replace(loaded.bus, interface=SIMULATED, options={}))


def _simulated_nodes(stack: ExitStack, cell: CellConfig) -> Channel:
    from axisbus.core.canlink import open_channel
    from axisbus.core.files import load_dictionaries

    dictionaries = load_dictionaries(cell) if cell.bus.interface == SIMULATED else {}
    return open_channel(cell, dictionaries, stack)[0]


def with_options(
    cell: CellConfig, channel: str | None, bitrate: int | None, option: tuple[str, ...]
) -> CellConfig:
    """Return a cell whose [bus] is replaced by -c, -b and -O.

    Raises:
        UsageError: its bus is simulated, and so has neither channel nor options.
    """
    bus, options = cell.bus, parse_options(option)
    if bus.interface == SIMULATED and (channel is not None or options):
        raise click.UsageError(
            f"{cell.file} is simulated, and needs no bus: leave -c and -O out, or give another bus with -i"
        )
    given = replace(
        bus,
        channel=bus.channel if channel is None else channel,
        bitrate=bus.bitrate if bitrate is None else bitrate,
        options={**bus.options, **options},
    )
    return replace(cell, bus=given)


def rate_of(cell: CellConfig | None, interface: str | None = None, channel: str | None = None) -> int | None:
    """Return the bit rate of a cell's bus, or of the named one, in bit/s; None if it is unknown."""
    from axisbus.bus.link.listen import link_bitrate

    if cell is None:
        return link_bitrate(interface or "", channel)
    return cell.bus.bitrate or link_bitrate(interface or cell.bus.interface, channel or cell.bus.channel)


def require_rate(interface: str, bitrate: int | None, options: Mapping[str, object]) -> None:
    """Check that a bit rate is given if the adapter sets it.

    Raises:
        UsageError: it is missing.
        AdapterError: the interface is unknown.
    """
    from axisbus.bus.link import adapter, interfaces

    adapter.check_interface(interface)
    if bitrate is None and interfaces.sets_rate(interface, options):
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
    """Return how ``open_bus`` opens its adapter, so that it can be opened again at another bit rate.

    Raises:
        UsageError, ConfigError: as ``open_bus``.
    """
    from axisbus.bus.link.bitrate_change import Opening

    if interface == SIMULATED:
        return Opening("virtual", None)
    if interface is not None or cell is None:
        return Opening(interface or "", channel, bitrate, parse_options(option))
    from axisbus.cell import reader

    bus = with_options(reader.load(cell), channel, bitrate, option).bus
    virtual = bus.interface == SIMULATED
    return Opening("virtual" if virtual else bus.interface, bus.channel, bus.bitrate, bus.options)
