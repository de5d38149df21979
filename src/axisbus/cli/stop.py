"""``axisbus stop``: stop a cell's drives, also beside a running master."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path

import click

from axisbus.cell import reader
from axisbus.cli.shared.common import FAILURE, OK, say, say_json, say_next
from axisbus.cli.shared.paths import PATH
from axisbus.machine.beside import stop_beside


@click.command("stop")
@click.argument("cell", type=PATH)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def command(cell: Path, as_json: bool) -> int:
    """Quick-stop every axis of CELL, wait until it stands, then stop its node (NMT). Neither boots nor resets anything.

    Works beside a running master, which then sees its nodes lost. Not an emergency stop: that belongs in hardware.
    Exit code 3 when an axis could not be confirmed as stopped.
    """
    results = stop_beside(reader.load(cell))
    failed = [result for result in results if not result.ok]
    if as_json:
        say_json([asdict(result) for result in results])
        return FAILURE if failed else OK
    for result in results:
        say(f"{result.axis}: {result.text}")
    if not failed:
        say_next(f"bring the nodes up again: axisbus boot {cell}")
    return FAILURE if failed else OK
