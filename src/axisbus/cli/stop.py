"""``axisbus stop``: stop a cell's drives, also beside a running master."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from axisbus import wait
from axisbus.cell import reader
from axisbus.cli.shared.common import FAILURE, OK, say, say_error, say_json, say_next
from axisbus.cli.shared.paths import PATH
from axisbus.errors import AxisbusError
from axisbus.link import Stopped
from axisbus.machine.beside import stop_beside
from axisbus.machine.machine import Machine


@click.command("stop")
@click.argument("cell", type=PATH)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def command(cell: Path, as_json: bool) -> int:
    """Quick-stop every axis of CELL, wait until it stands, then stop its node (NMT). Neither boots nor resets anything.

    A machine of CELL that runs on this computer is asked to quick-stop its axes, and goes on; nothing moves until whoever has its
    command asks for it again. Beside another master it does it itself: that one then sees its nodes lost.
    Not an emergency stop: that belongs in hardware. Exit code 3 when an axis could not be confirmed as stopped.
    """
    config = reader.load(cell)
    joined = _in_machine(cell)
    results = stop_beside(config) if joined is None else joined
    failed = [result for result in results if not result.ok]
    if as_json:
        say_json([asdict(result) for result in results])
        return FAILURE if failed else OK
    for result in results:
        say(f"{result.axis}: {result.text}")
    if not failed and joined is None:
        say_next(f"bring the nodes up again: axisbus boot {cell}")
    return FAILURE if failed else OK


def _in_machine(cell: Path) -> list[Stopped] | None:
    """Have the machine of a cell that runs here stop its axes; None where there is none, or not all of them stand by that."""
    try:
        machine = Machine.join(cell)
        if machine is None:
            return None
        with machine:
            handles = {axis.name: axis.quick_stop() for axis in machine}
            wait(list(handles.values()))
            return [Stopped(name, True, f"stands, {machine[name].state.value}") for name in handles]
    except* AxisbusError as errors:
        for error in errors.exceptions:
            say_error(f"the machine that runs did not stop it: {error}")
    return None
