"""``axisbus stop``: stop a cell's drives, even while another master runs."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from axisbus.cell import reader
from axisbus.cli.shared.common import FAILURE, OK, say_error, say_json, say_next
from axisbus.cli.shared.enabled_axes import say_stopped
from axisbus.cli.shared.paths import PATH
from axisbus.errors import AxisbusError
from axisbus.machine.stop_external import stop_cell, stop_in_machine


@click.command("stop")
@click.argument("cell", type=PATH)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def command(cell: Path, as_json: bool) -> int:
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
    results, beside = stop_cell(config, say_error)
    failed = [result for result in results if not result.ok]
    if as_json:
        say_json([asdict(result) for result in results])
        return FAILURE if failed else OK
    say_stopped(results)
    if not failed and beside:
        say_next(f"bring the nodes up again: axisbus boot {cell}")
    return FAILURE if failed else OK
