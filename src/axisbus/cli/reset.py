"""``axisbus reset``: reset faults."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus import wait
from axisbus.check.checked import checked
from axisbus.cli.shared import axes as named
from axisbus.cli.shared.common import OK, say, say_next
from axisbus.cli.shared.completion import complete_axes
from axisbus.cli.shared.joining import machine_of, take_option
from axisbus.cli.shared.options import beside_option
from axisbus.cli.shared.paths import PATH
from axisbus.cli.shared.speech import in_commands


@click.command("reset")
@click.argument("cell", type=PATH)
@click.argument("axes", nargs=-1, shell_complete=complete_axes)
@beside_option
@take_option
def command(cell: Path, axes: tuple[str, ...], beside: bool, take: bool) -> int:
    """Boot CELL and reset the faults of its axes (or of those named, by themselves or by a group); enables nothing.

    Each fault is told before it is reset. Exit code 3 when one does not go away.
    """
    names = named.chosen(checked(cell), axes)
    with machine_of(cell, command=True, take=take, beside=beside) as machine:
        machine.sleep(0.5)  # a fault explains itself by SDO
        chosen = [machine[name] for name in names]
        for axis in chosen:
            told = "no fault" if axis.error is None else in_commands(axis.error)
            say(told if told.startswith(f"{axis.name}: ") else f"{axis.name}: {told}")
        wait([axis.reset() for axis in chosen])
        for axis in chosen:
            say(f"{axis.name}: {axis.state.value}")
    say_next(f"axisbus home {cell}, or axisbus move {cell} {names[0]}=...")
    return OK
