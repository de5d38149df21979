"""``axisbus check``: everything wrong with a cell file, before the first frame."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from pathlib import Path

import click

from axisbus.cli.common import OK, WRONG, say, say_json, say_next
from axisbus.machine.check import check
from axisbus.machine.problem import Problem
from axisbus.wording import counted


@click.command("check")
@click.argument("cell", type=click.Path(path_type=Path))
@click.option("--json", "as_json", is_flag=True, help="Print the findings as JSON.")
def command(cell: Path, as_json: bool) -> int:
    """Find everything wrong with CELL (a cell.toml) before the first frame is sent.

    Errors keep the cell from being opened (exit code 1); warnings are dangerous or will surprise; notes are worth knowing.
    """
    problems = check(cell)
    counts = Counter(problem.severity.value for problem in problems)
    code = WRONG if counts["error"] else OK
    if as_json:
        say_json({"file": str(cell), "ok": code == OK, "findings": [_plain(problem) for problem in problems]})
        return code
    for problem in problems:
        say(str(problem))
    say(
        f"{cell}: {counted(counts['error'], 'error')}, {counted(counts['warning'], 'warning')}, {counted(counts['note'], 'note')}"
    )
    say_next(f"mend the errors and check again: axisbus check {cell}" if code else f"axisbus boot {cell}")
    return code


def _plain(problem: Problem) -> dict[str, object]:
    return {**asdict(problem), "severity": problem.severity.value}
