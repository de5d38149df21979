"""``axisbus enable``: enable axes of a running machine."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus.check.run import checked
from axisbus.cli.shared import axes as named
from axisbus.cli.shared.attach_or_open import running, take_option
from axisbus.cli.shared.axes_and_pairs import as_pairs, movers
from axisbus.cli.shared.common import OK, say_next
from axisbus.cli.shared.completion import complete_axes
from axisbus.cli.shared.enabled_axes import enable
from axisbus.cli.shared.paths import PATH


@click.command("enable")
@click.argument("cell", type=PATH)
@click.argument("axes", nargs=-1, shell_complete=complete_axes)
@take_option
def command(cell: Path, axes: tuple[str, ...], take: bool) -> int:
    """Enable the axes of CELL, or the named axes, groups or pairs, in the running machine; they stay enabled.

    ENERGISES MOTORS. It needs a machine that keeps running: axisbus run CELL, or your own program.
    """
    config = checked(cell)
    names = as_pairs(config, named.chosen(config, axes), "enable")
    why, remedy = (
        "lasts only as long as the machine runs",
        f"start one in another terminal: axisbus run {cell}",
    )
    with running(cell, "enable", why, remedy, command=True, take=take) as machine:
        enable(movers(machine, names))
    say_next(f"axisbus move {cell} {names[0]}=..., or axisbus disable {cell}")
    return OK
