"""``axisbus halt``: halt axes of a running machine, whichever client has control."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus.cell import reader
from axisbus.cell.model import CellConfig
from axisbus.cli.shared import axes as named
from axisbus.cli.shared.attach_or_open import no_machine
from axisbus.cli.shared.axes_and_pairs import as_pairs, movers
from axisbus.cli.shared.common import FAILURE, OK, say_error
from axisbus.cli.shared.completion import complete_axes
from axisbus.cli.shared.enabled_axes import say_position, say_stopped
from axisbus.cli.shared.paths import PATH
from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine
from axisbus.machine.stop_external import stop_in_machine


@click.command("halt")
@click.argument("cell", type=PATH)
@click.argument("axes", nargs=-1, shell_complete=complete_axes)
def command(cell: Path, axes: tuple[str, ...]) -> int:
    """Halt the axes of CELL, or the named axes, groups or pairs, in the running machine; they stay enabled.

    Any program may halt: running commands end, and nothing moves until the program that has control commands it again.
    """
    try:
        config = reader.load(cell)
    except (AxisbusError, ExceptionGroup):  # the running machine may have another cell file, and can halt
        say_stopped(stop_in_machine(str(cell), axes, say_error, quick=False))
        raise
    names = named.chosen(config, axes)
    halted = stop_in_machine(config.file, names, say_error, quick=False)
    if not halted:
        raise no_machine(cell, "halt", "needs one", f"stop the drives themselves: axisbus stop {cell}")
    failed = any(not each.ok for each in halted)
    if failed or not _tell_pairs(config, names):
        say_stopped(halted)
    return FAILURE if failed else OK


def _tell_pairs(config: CellConfig, names: list[str]) -> bool:
    """Print the positions of axes and pairs, if there is a pair; return False if not, or if the machine cannot be joined."""
    pairs = as_pairs(config, names)
    if pairs == names:
        return False
    try:
        with Machine.attach(config.file) as machine:
            for each in movers(machine, pairs):
                say_position(each, "stands at")
    except (AxisbusError, ExceptionGroup):
        return False
    return True
