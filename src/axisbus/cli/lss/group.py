"""``axisbus lss``: node-IDs and bit rates over the bus (CiA 305)."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

COMMANDS = {
    "find": ("axisbus.cli.lss.commands:find_command", "Find every slave without a node-ID; changes nothing."),
    "inquire": ("axisbus.cli.lss.commands:inquire_command", "Show a slave's identity and node-ID."),
    "set-node-id": ("axisbus.cli.lss.commands:set_node_id_command", "Give a slave a node-ID."),
    "set-bitrate": ("axisbus.cli.lss.set_bitrate", "Set the bit rate of slaves, and change over to it."),
    "store": ("axisbus.cli.lss.commands:store_command", "Make a slave store node-ID and bit rate."),
}


@click.group(cls=LazyGroup, table=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
def command() -> None:
    """Set node-IDs and bit rates over the bus (CiA 305), on a bus where no machine is running.

    Exit codes: 0 all well, 1 something was found wrong, 2 wrong use, 3 the bus or a slave failed.
    """
