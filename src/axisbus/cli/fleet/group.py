"""``axisbus fleet``: the subcommands."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

COMMANDS = {
    "list": (
        "axisbus.cli.fleet.commands:list_command",
        "Show the cells of a plant, their axes, incidents and recordings, once.",
    ),
    "watch": (
        "axisbus.cli.fleet.commands:watch_command",
        "The same as a table that is updated continuously.",
    ),
    "stop": (
        "axisbus.cli.fleet.commands:stop_command",
        "Quick-stop all axes of all cells, or of some, whichever program has control.",
    ),
}


@click.group("fleet", cls=LazyGroup, table=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]})
def command() -> None:
    """See and stop the cells of a plant over its Zenoh network.

    A cell joins the network by its bridge: axisbus bridge zenoh CELL --plant PLANT. Not a safety function: a stop that is sent
    over a network may not arrive.
    """
