"""Common parts of the LSS subcommands: the bus, the slave, and the progress line of a scan."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import click

from axisbus.cli.shared.buses import open_bus
from axisbus.cli.shared.options import (
    PATH,
    GivenBus,
    NumberType,
    Seconds,
    bus_options,
    bus_words,
    packed,
    together,
)
from axisbus.errors import UserError
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.bus.lss import LssMaster
    from axisbus.cia305.scan_result import Unconfigured
    from axisbus.cia305.services import LssAddress

_REDRAW = 0.1  # s
_FLOOR = 0.015  # s, as in cia305.dialogue.LssTiming


@dataclass(frozen=True, slots=True)
class Where:
    """The requested bus, and the options for its use."""

    bus: GivenBus
    timeout: float
    beside_operation: bool

    @property
    def words(self) -> str:
        """The bus options as typed, to be repeated in a hint; without the bit rate, which a hint may have to change."""
        return bus_words(*self.bus._replace(bitrate=None))

    @property
    def words_and_rate(self) -> str:
        """The bus options as typed, with the bit rate."""
        return bus_words(*self.bus)


# CELL, -i, -c, -b, -O, --timeout, --beside-operation and --json; the first seven come as ``where``.
lss_options = together(
    click.argument("cell", type=PATH, required=False),
    bus_options,
    click.option(
        "--timeout",
        type=Seconds(),
        default=_FLOOR,
        show_default=True,
        metavar="SECONDS",
        help="Shortest wait for an answer; it increases automatically with the slowest answer seen.",
    ),
    click.option(
        "--beside-operation",
        is_flag=True,
        help="Run even while a machine is running on the bus (otherwise refused).",
    ),
    click.option("--json", "as_json", is_flag=True, help="Print the result as JSON."),
    packed(GivenBus, "bus"),
    packed(Where, "where"),
)


def slave_option(*, multiple: bool) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Return a decorator that adds -s: a slave by the four numbers of its identity."""
    return click.option(
        "-s",
        "--slave",
        nargs=4,
        type=NumberType(32),
        multiple=multiple,
        metavar="VENDOR PRODUCT REVISION SERIAL",
        help="The slave with this identity (1018h:1 to 4).",
    )


@contextmanager
def open_master(where: Where) -> Iterator[LssMaster]:
    """Open the bus and an LSS master on it.

    Raises:
        UsageError: no bus is given.
        ArgumentError: the time-out cannot be used.
        ConfigError, EdsError, AdapterError: as ``open_bus``.
    """
    from axisbus.bus.lss import LssMaster
    from axisbus.cia305.dialogue import LssTiming

    timing = LssTiming(floor=where.timeout)
    with ExitStack() as stack:
        bus = open_bus(stack, *where.bus)
        yield LssMaster(
            bus,
            timing,
            on_progress=stack.enter_context(_progress_line()),
            beside_operation=where.beside_operation,
        )


@dataclass(frozen=True, slots=True)
class SlaveChoice:
    """The selection of a slave: by its identity, as the one without a node-ID, or as the only one on the bus."""

    slave: tuple[int, ...] | None
    found: bool
    only: bool

    def require_one(self) -> None:
        """Check that a slave is selected in exactly one form, before the bus is opened.

        Raises:
            UsageError: no form, or more than one, is given.
            ArgumentError: a number is out of range.
        """
        from axisbus.cia305.services import LssAddress

        if bool(self.slave) + self.found + self.only != 1:
            raise click.UsageError(
                "name the slave by one of these: -s VENDOR PRODUCT REVISION SERIAL, --found (the one without a node-ID) or --only "
                "(the only one on the bus)"
            )
        if self.slave:
            LssAddress(*self.slave)

    def address(self, master: LssMaster) -> LssAddress | None:
        """Return the address of the named slave, None for the only one on the bus; if none is named, find it by a scan.

        Raises:
            UserError: the scan finds no slave, or several.
            LssError: as ``LssMaster.find``.
        """
        from axisbus.cia305.services import LssAddress

        if self.slave:
            return LssAddress(*self.slave)
        return None if self.only else _found(master)


# The three options that select a slave: -s, --found, --only; a command gets them together as ``choice``.
slave_options = together(
    slave_option(multiple=False),
    click.option("--found", is_flag=True, help="The one slave without a node-ID, found by a scan."),
    click.option(
        "--only", is_flag=True, help="The only LSS slave on the bus (wrong if there are two or more)."
    ),
    packed(SlaveChoice, "choice"),
)


def _found(master: LssMaster) -> LssAddress:
    scanned = master.find()
    slaves = [slave for slave in scanned.slaves if not slave.has_node_id]
    if scanned.incomplete:
        raise UserError(
            "the search for LSS slaves without a node-ID could not be completed",
            observed=scanned.incomplete,
            remedy="name the slave by its identity (-s)",
        )
    if not slaves:
        raise UserError(
            "no LSS slave without a node-ID answers",
            remedy="name the slave by its identity (-s); axisbus scan shows those with a node-ID",
        )
    if len(slaves) > 1:
        raise UserError(
            f"{counted(len(slaves), 'LSS slave')} have no node-ID",
            observed=", ".join(str(slave.address) for slave in slaves),
            remedy="name one by its identity (-s)",
        )
    _require_selectable(slaves[0])
    return slaves[0].address


def _require_selectable(slave: Unconfigured) -> None:
    from axisbus.cia305.scan_result import Check

    if slave.check is Check.UNSELECTABLE:
        raise UserError(
            f"the LSS slave {slave.address} cannot be selected by its address",
            observed="it answers fast scan, but not switch state selective",
            remedy="connect only this slave, and name it by --only",
        )


def say_slave(address: LssAddress) -> str:
    """Return an address as text."""
    vendor, product, revision, serial = address.parts
    return f"vendor 0x{vendor:X}, product 0x{product:X}, revision 0x{revision:X}, serial 0x{serial:X}"


def as_numbers(address: LssAddress) -> dict[str, int]:
    """Return an address for JSON."""
    names = ("vendor_id", "product_code", "revision_number", "serial_number")
    return dict(zip(names, address.parts, strict=True))


@contextmanager
def _progress_line() -> Iterator[Callable[[int, int], None] | None]:
    """Offer ``show_found(found, bits)``, which redraws a line on standard error, on a terminal only."""
    if not sys.stderr.isatty():
        yield None
        return
    last_update = 0.0

    def show_found(found: int, bits: int) -> None:
        nonlocal last_update
        now = time.monotonic()
        if bits and now - last_update > _REDRAW:
            last_update = now
            click.echo(f"\rfast scan: {found} found, {bits:3} of 128 bits of the next ", err=True, nl=False)

    try:
        yield show_found
    finally:
        if last_update:
            click.echo("\r" + " " * 60 + "\r", err=True, nl=False)
