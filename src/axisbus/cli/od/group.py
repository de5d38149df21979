"""``axisbus od``: the objects of a node, by name or number."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

COMMANDS = {
    "read": ("axisbus.cli.od.commands:read_command", "Read objects and show their meaning."),
    "write": ("axisbus.cli.od.commands:write_command", "Write one object; checked before, read back after."),
    "dump": ("axisbus.cli.od.commands:dump_command", "Read every object of a node; writes nothing."),
    "watch": ("axisbus.cli.od.commands:watch_command", "Read objects periodically, and show changes."),
}


@click.group(cls=LazyGroup, table=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
def command() -> None:
    """Read, write, list and watch the objects of a node.

    A node is its ID, or an axis of --cell; an object is an index (6041, 1018:1) or a name of the EDS, with _ for a space.
    """
