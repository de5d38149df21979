"""``axisbus gim6010`` with its groups ``params`` and ``modbus``: find and inspect modules, in any of their protocols."""

from __future__ import annotations

import click

from axisbus.cia301.tables import rows
from axisbus.cli.shared.lazy import LazyGroup, Table

_ROWS = rows(__package__, "commands.tsv")


def _table(group: str) -> Table:
    """Return the table of a group, from ``commands.tsv``."""
    return {
        row["name"]: (f"{__package__}.{row['place']}", row["help"]) for row in _ROWS if row["group"] == group
    }


@click.group(cls=LazyGroup, table=_table("gim6010"))
def command() -> None:
    """Find and inspect GIM6010-8 modules, in any of their protocols.

    No command here enables or turns a module, except those that ask before. All commands were tried on simulated modules only.
    """


@click.group(cls=LazyGroup, table=_table("params"))
def params() -> None:
    """Read and write a module's parameters by their names (without odrv0.), over CAN Simple, Modbus RTU (--modbus) or USB
    (--usb).

    Except over USB, the list of endpoints (--list) is needed, the maker's file for exactly this firmware. A list of another
    firmware is refused: the numbers differ, and a wrong number may erase the module. No function of the module is called.
    """


@click.group(cls=LazyGroup, table=_table("modbus"))
def modbus() -> None:
    """Use a GIM6010-8 over RS485, by Modbus RTU: needs the extra axisbus[modbus].

    Only calibrate energises its motor. To move a module, make it an axis of a cell file: interface = "modbus" in [bus], then
    axisbus check, boot and move. A module cannot detect the loss of the master over Modbus. Positions and velocities are turns of
    the rotor; 8 of these are one turn of the output. All commands were tried on simulated modules only.
    """
