"""``axisbus halt``: halt axes of a machine that runs, whoever has its command."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus import wait
from axisbus.check.checked import checked
from axisbus.cli.shared import axes as named
from axisbus.cli.shared.commanded import say_position
from axisbus.cli.shared.common import OK
from axisbus.cli.shared.completion import complete_axes
from axisbus.cli.shared.joining import running
from axisbus.cli.shared.movers import as_pairs, movers
from axisbus.cli.shared.paths import PATH


@click.command("halt")
@click.argument("cell", type=PATH)
@click.argument("axes", nargs=-1, shell_complete=complete_axes)
def command(cell: Path, axes: tuple[str, ...]) -> int:
    """Halt the axes of CELL (or those named, by themselves, by a group or by a pair) in the machine that runs; they stay enabled.

    Anybody may: what runs ends, and nothing moves until the program that has the command asks for it again.
    """
    config = checked(cell)
    names = as_pairs(config, named.chosen(config, axes))
    why, remedy = "needs one", f"stop the drives themselves: axisbus stop {cell}"
    with running(cell, "halt", why, remedy, command=False) as machine:
        chosen = movers(machine, names)
        wait([each.halt() for each in chosen])
        for each in chosen:
            say_position(each, "stands at")
    return OK
