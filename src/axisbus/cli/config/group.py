"""``axisbus config``: the configuration of a node as a DCF file."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

COMMANDS = {
    "backup": (
        "axisbus.cli.config.commands:backup_command",
        "Read all objects of a node into a DCF; writes nothing to it.",
    ),
    "diff": (
        "axisbus.cli.config.commands:diff_command",
        "Compare two files, a file and a node, or a node and its EDS.",
    ),
    "restore": (
        "axisbus.cli.config.restore",
        "Configure a node as in a DCF, and read every object again.",
    ),
}


@click.group(cls=LazyGroup, table=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
def command() -> None:
    """Back up, compare and restore the configuration of a node as a DCF.

    Exit codes: 0 all well, 1 something differs or was refused, 2 wrong use, 3 the bus or a drive failed.
    """
