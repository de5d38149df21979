"""``axisbus check``: everything wrong with a cell file, before the first frame."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict
from pathlib import Path

import click

from axisbus.cell.problem import Problem, errors
from axisbus.check.run import check
from axisbus.cli.shared.common import OK, WRONG, say, say_json, say_next
from axisbus.cli.shared.paths import PATH
from axisbus.cli.shared.terminal import STYLES, say_styled
from axisbus.errors import where_it_stands
from axisbus.wording import counted

_ORDER = ("note", "warning", "error")  # the worst is read last, and stands where the eye is


@click.command("check")
@click.argument("cell", type=PATH, required=False)
@click.option("--json", "as_json", is_flag=True, help="Print the findings as JSON.")
@click.option("--errors-only", is_flag=True, help="Show neither warnings nor notes.")
@click.option("--schema", is_flag=True, help="Print a JSON Schema of cell files, for an editor's completion.")
def command(cell: Path | None, as_json: bool, errors_only: bool, schema: bool) -> int:
    """Find everything wrong with CELL (a cell.toml) before the first frame is sent.

    Errors keep the cell from being opened (exit code 1) and come last; warnings are dangerous or will surprise; notes are worth
    knowing.
    """
    if (cell is None) is not schema:
        raise click.UsageError("give a cell file, or --schema (of all cell files)")
    if cell is None:
        from axisbus.cell.json_schema import schema_of_cells

        say_json(schema_of_cells())
        return OK
    problems = check(cell)
    code = WRONG if errors(problems) else OK
    shown = errors(problems) if errors_only else problems
    if as_json:
        say_json({"file": str(cell), "ok": code == OK, "findings": [_plain(problem) for problem in shown]})
    else:
        _show(cell, problems, shown)
    return code


def _show(cell: Path, problems: list[Problem], shown: list[Problem]) -> None:
    for problem in sorted(shown, key=lambda problem: (_ORDER.index(problem.severity.value), problem.line)):
        severity = problem.severity.value
        say_styled(str(problem), f"{severity}:", STYLES[severity])
    counts = Counter(problem.severity.value for problem in problems)
    say(f"{cell}: {', '.join(counted(counts[severity], severity) for severity in reversed(_ORDER))}")
    wrong = errors(problems)
    for page in sorted({problem.page for problem in wrong}):
        say(where_it_stands(page))
    say_next(f"mend the errors and check again: axisbus check {cell}" if wrong else f"axisbus boot {cell}")


def _plain(problem: Problem) -> dict[str, object]:
    return {**asdict(problem), "severity": problem.severity.value}
