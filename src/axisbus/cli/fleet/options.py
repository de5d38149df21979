"""Which plant, and where its network is: options of all ``axisbus fleet`` commands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import click

from axisbus.cli.shared.paths import PATH

Decorated = Callable[..., Any]


def plant_options(function: Decorated) -> Decorated:
    """Add --plant, --connect, --listen, --scouting and --config."""
    for decorate in (
        click.option(
            "--config", type=PATH, help="A configuration file of Zenoh's, for certificates and the like."
        ),
        click.option("--scouting", is_flag=True, help="Search for cells by multicast as well."),
        click.option(
            "--listen", multiple=True, metavar="ENDPOINT", help="Where cells may come to; repeatable."
        ),
        click.option(
            "--connect",
            multiple=True,
            metavar="ENDPOINT",
            help="A bridge or a router, such as tcp/10.0.0.5:7447; repeatable.",
        ),
        click.option("--plant", required=True, metavar="NAME", help="The plant, as its bridges name it."),
    ):
        function = decorate(function)
    return function
