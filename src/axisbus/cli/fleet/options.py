"""Options of all ``axisbus fleet`` commands: the plant, and its network."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import wraps
from pathlib import Path
from typing import Any

import click

from axisbus.cli.shared.paths import PATH
from axisbus.fleet.fleet import Fleet

Decorated = Callable[..., Any]


@dataclass(frozen=True, slots=True)
class FleetOptions:
    """A plant by its name, and its network, as ``Fleet`` takes them."""

    plant: str
    connect: tuple[str, ...]
    listen: tuple[str, ...]
    scouting: bool
    config: Path | None

    def fleet(self, look: float | None = None) -> Fleet:
        """Return the cells of the plant; ``look`` in seconds, blocking and errors as for ``Fleet``."""
        return Fleet(
            self.plant,
            connect=self.connect,
            listen=self.listen,
            scouting=self.scouting,
            config=self.config,
            look=look,
        )


def plant_options(function: Decorated) -> Decorated:
    """Add --plant, --connect, --listen, --scouting and --config; a command gets them together as ``place``."""

    @wraps(function)
    def placed(
        plant: str,
        connect: tuple[str, ...],
        listen: tuple[str, ...],
        scouting: bool,
        config: Path | None,
        **others: Any,
    ) -> Any:
        return function(place=FleetOptions(plant, connect, listen, scouting, config), **others)

    return _with_options(placed)


def _with_options(function: Decorated) -> Decorated:
    for decorate in (
        click.option(
            "--config", type=PATH, help="A configuration file of Zenoh, for example for certificates."
        ),
        click.option("--scouting", is_flag=True, help="Also search for cells by multicast."),
        click.option(
            "--listen",
            multiple=True,
            metavar="ENDPOINT",
            help="The endpoint at which cells may connect; repeatable.",
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
