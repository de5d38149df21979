"""``axisbus boot``: bring the nodes of a cell up and report each."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus.cli.common import FAILURE, OK, progress_bar, say, say_json, say_next
from axisbus.machine.machine import boot


@click.command("boot")
@click.argument("cell", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print the reports as JSON.")
def command(cell: Path, as_json: bool) -> int:
    """Boot and configure the nodes of CELL, report each, and let them go again; energises nothing.

    The report says who each node is, how its boot-up went (with the letter of CiA 302-2, A to O, where there is one), how each axis
    stops, and what notices a dead master. Exit code 3 when a node that is not optional did not come up.
    """
    with progress_bar("booting", quiet=as_json) as tell:
        reports = boot(cell, tell)
    failed = [report for report in reports if not report.ok and not report.optional]
    up = sum(report.ok for report in reports)
    if as_json:
        say_json([report.as_json() for report in reports])
        return FAILURE if failed else OK
    for report in reports:
        say(report.text())
    say(f"{up} of {len(reports)} nodes came up")
    if failed:
        say_next("mend what FAILED says, and boot again; who is there: axisbus scan " + str(cell))
        return FAILURE
    say_next(f"axisbus monitor {cell}, or axisbus home {cell}")
    return OK
