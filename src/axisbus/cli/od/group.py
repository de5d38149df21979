"""``axisbus od``: the objects of a node, by name or number."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

COMMANDS = {
    "read": ("axisbus.cli.od.read", "Read objects and show their meaning."),
    "write": ("axisbus.cli.od.write", "Write one object; checked before, read back after."),
    "dump": ("axisbus.cli.od.dump", "Read every object of a node; writes nothing."),
    "watch": ("axisbus.cli.od.watch", "Read objects periodically, and show changes."),
}


@click.group(cls=LazyGroup, table=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
def command() -> None:
    """Read, write, list and watch the objects of a node.

    A node is its ID, or an axis of --cell; an object is an index (6041, 1018:1) or a name of the EDS, with _ for a space.
    """
