"""``axisbus gim6010 params``: the parameters of a module by name."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

COMMANDS = {
    "get": ("axisbus.drives.gim6010.cli.params.commands:get_command", "Read parameters by name."),
    "set": (
        "axisbus.drives.gim6010.cli.params.commands:set_command",
        "Write parameters by name, each read back; --save stores them.",
    ),
    "dump": (
        "axisbus.drives.gim6010.cli.params.commands:dump_command",
        "Read every parameter that can be read.",
    ),
    "backup": (
        "axisbus.drives.gim6010.cli.params.commands:backup_command",
        "Write the settings of a module into a file.",
    ),
    "restore": (
        "axisbus.drives.gim6010.cli.params.commands:restore_command",
        "Write the settings of a backup to a module.",
    ),
    "diff": (
        "axisbus.drives.gim6010.cli.params.commands:diff_command",
        "Show the differences between backups, or a backup and a module.",
    ),
}


@click.group(cls=LazyGroup, table=COMMANDS)
def command() -> None:
    """Read and write a module's parameters by their names (without odrv0.), over CAN Simple, Modbus RTU (--modbus) or USB
    (--usb).

    Except over USB, the list of endpoints (--list) is needed, the maker's file for exactly this firmware. A list that does not
    fit is refused: numbers differ between firmwares, and a wrong one may erase the module. It calls no function.
    """
