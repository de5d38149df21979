"""``axisbus program``: the program (firmware) of a node."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

COMMANDS = {
    "show": (
        "axisbus.cli.program.commands:show_command",
        "Show the versions and the state of a node's program.",
    ),
    "write": (
        "axisbus.cli.program.commands:write_command",
        "Replace the program of a node by that of a file.",
    ),
    "verify": (
        "axisbus.cli.program.commands:verify_command",
        "Compare the program of a node with a file; writes nothing.",
    ),
}


@click.group(cls=LazyGroup, table=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
def command() -> None:
    """Show, write and verify the program (firmware) of a node that has the objects 1F50h to 1F57h of CiA 302-3.

    Exit codes: 0 all well, 1 something differs or was refused, 2 wrong use, 3 the bus or a node failed.
    """
