"""``axisbus bridge``: the subcommands."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

COMMANDS = {
    "metrics": ("axisbus.cli.bridge.metrics", "Serve the figures of a machine that runs, for Prometheus."),
    "opcua": ("axisbus.cli.bridge.opcua", "Serve a machine by OPC UA."),
    "opcua-user": ("axisbus.cli.bridge.opcua_user", "Make a line for the file of who may call methods."),
    "zenoh": ("axisbus.cli.bridge.zenoh", "Join a machine to a Zenoh network, for a fleet."),
}


@click.group(
    "bridge", cls=LazyGroup, table=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]}
)
def command() -> None:
    """Join a machine to what a plant has. A bridge is one more program at it: ending or killing one changes no cycle."""
