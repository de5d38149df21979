"""``axisbus reset``: reset faults."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus import wait
from axisbus.check.run import checked
from axisbus.cli.shared import axes as named
from axisbus.cli.shared.attach_or_open import machine_of, take_option
from axisbus.cli.shared.axes_and_pairs import all_axes, as_pairs, movers
from axisbus.cli.shared.common import OK, say, say_next
from axisbus.cli.shared.completion import complete_axes
from axisbus.cli.shared.enabled_axes import say_state
from axisbus.cli.shared.error_text import with_page
from axisbus.cli.shared.options import beside_option
from axisbus.cli.shared.paths import PATH


@click.command("reset")
@click.argument("cell", type=PATH)
@click.argument("axes", nargs=-1, shell_complete=complete_axes)
@beside_option
@take_option
def command(cell: Path, axes: tuple[str, ...], beside: bool, take: bool) -> int:
    """Boot CELL and reset the faults of its axes (or of the named axes, groups or pairs); enables nothing.

    Each fault is shown before it is reset. Exit code 3 when a fault remains.
    """
    config = checked(cell)
    names = as_pairs(config, named.chosen(config, axes))
    with machine_of(cell, command=True, take=take, beside=beside) as machine:
        machine.sleep(0.5)  # wait for the details of the fault by SDO
        chosen = movers(machine, names)
        for axis in all_axes(chosen):
            told = "no fault" if axis.error is None else with_page(axis.error)
            say(told if told.startswith(f"{axis.name}: ") else f"{axis.name}: {told}")
        wait([each.reset() for each in chosen])
        for each in chosen:
            say_state(each)
    say_next(f"axisbus home {cell}, or axisbus move {cell} {names[0]}=...")
    return OK
