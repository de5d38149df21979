"""``axisbus disable``: stop and disable axes of a running machine."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus import wait
from axisbus.check.run import checked
from axisbus.cli.shared import axes as named
from axisbus.cli.shared.attach_or_open import running, take_option
from axisbus.cli.shared.axes_and_pairs import as_pairs, movers
from axisbus.cli.shared.common import OK
from axisbus.cli.shared.completion import complete_axes
from axisbus.cli.shared.enabled_axes import say_state
from axisbus.cli.shared.paths import PATH


@click.command("disable")
@click.argument("cell", type=PATH)
@click.argument("axes", nargs=-1, shell_complete=complete_axes)
@take_option
def command(cell: Path, axes: tuple[str, ...], take: bool) -> int:
    """Stop and disable the axes of CELL, or the named axes, groups or pairs, in the running machine."""
    config = checked(cell)
    names = as_pairs(config, named.chosen(config, axes))
    why, remedy = "happens at the end of every machine", f"stop the drives themselves: axisbus stop {cell}"
    with running(cell, "disable", why, remedy, command=True, take=take) as machine:
        chosen = movers(machine, names)
        wait([each.disable() for each in chosen])
        for each in chosen:
            say_state(each)
    return OK
