"""``axisbus bridge``: the subcommands."""

from __future__ import annotations

import click

from axisbus.cli.shared.lazy import LazyGroup

COMMANDS = {
    "metrics": ("axisbus.cli.bridge.metrics", "Serve the figures of a running machine for Prometheus."),
    "opcua": ("axisbus.cli.bridge.opcua", "Serve a machine by OPC UA."),
    "opcua-user": (
        "axisbus.cli.bridge.opcua_user:opcua_user_command",
        "Make a line for the file of users who may call methods.",
    ),
    "zenoh": ("axisbus.cli.bridge.zenoh", "Join a machine to a Zenoh network, for a fleet."),
}


@click.group(
    "bridge", cls=LazyGroup, table=COMMANDS, context_settings={"help_option_names": ["-h", "--help"]}
)
def command() -> None:
    """Connect a machine to the systems of a plant. A bridge is one more client of the machine: ending or killing it changes no
    cycle.
    """
