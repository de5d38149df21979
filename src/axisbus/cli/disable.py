"""``axisbus disable``: stop and disable axes of a machine that runs."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus import wait
from axisbus.check.checked import checked
from axisbus.cli.shared import axes as named
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.completion import complete_axes
from axisbus.cli.shared.joining import running, take_option
from axisbus.cli.shared.paths import PATH


@click.command("disable")
@click.argument("cell", type=PATH)
@click.argument("axes", nargs=-1, shell_complete=complete_axes)
@take_option
def command(cell: Path, axes: tuple[str, ...], take: bool) -> int:
    """Stop the axes of CELL (or those named, by themselves or by a group) in the machine that runs, and disable them."""
    names = named.chosen(checked(cell), axes)
    why, remedy = "is what every machine does at its end", f"stop the drives themselves: axisbus stop {cell}"
    with running(cell, "disable", why, remedy, command=True, take=take) as machine:
        chosen = [machine[name] for name in names]
        wait([axis.disable() for axis in chosen])
        for axis in chosen:
            say(f"{axis.name}: {axis.state.value}")
    return OK
