"""The commands that stop axes from outside: ``axisbus halt`` and ``stop``."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from axisbus.cell import reader
from axisbus.cell.model import CellConfig
from axisbus.cli.shared import axes as named
from axisbus.cli.shared.attach_or_open import no_machine
from axisbus.cli.shared.axes_and_pairs import as_pairs, movers
from axisbus.cli.shared.common import FAILURE, OK, say_error, say_json, say_next
from axisbus.cli.shared.completion import complete_axes
from axisbus.cli.shared.enabled_axes import say_position, say_stopped
from axisbus.cli.shared.options import PATH
from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine
from axisbus.machine.stop_external import stop_cell, stop_in_machine

# -- ``axisbus halt``: halt axes of a running machine, whichever client has control ------------------------------------


@click.command("halt")
@click.argument("cell", type=PATH)
@click.argument("axes", nargs=-1, shell_complete=complete_axes)
def halt_command(cell: Path, axes: tuple[str, ...]) -> int:
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
    if failed or not _report_pairs(config, names):
        say_stopped(halted)
    return FAILURE if failed else OK


def _report_pairs(config: CellConfig, names: list[str]) -> bool:
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


# -- ``axisbus stop``: stop a cell's drives, even while another master runs --------------------------------------------


@click.command("stop")
@click.argument("cell", type=PATH)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def stop_command(cell: Path, as_json: bool) -> int:
    """Quick-stop every axis of CELL, wait until it is at standstill, then stop its node (NMT). Neither boots nor resets
    anything.

    If a machine of CELL is running on this computer, the command makes it quick-stop its axes; the machine keeps running, and
    nothing moves until the program that has control commands it again. If no machine is running, or it cannot be reached, the
    drives are stopped on the bus, even if another master runs there: that master then loses its nodes. Simulated drives can be
    reached only through their machine. Not an emergency stop: that belongs in hardware. Exit code 3 when an axis could not be
    reached or confirmed as stopped.
    """
    try:
        config = reader.load(cell)
    except (AxisbusError, ExceptionGroup):  # the running machine may have another cell file, and can stop
        say_stopped(stop_in_machine(str(cell), (), say_error, quick=True))
        raise
    results, others_on_bus = stop_cell(config, say_error)
    failed = [result for result in results if not result.ok]
    if as_json:
        say_json([asdict(result) for result in results])
        return FAILURE if failed else OK
    say_stopped(results)
    if not failed and others_on_bus:
        say_next(f"bring the nodes up again: axisbus boot {cell}")
    return FAILURE if failed else OK
