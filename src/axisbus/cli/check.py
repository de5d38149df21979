"""``axisbus check``: find all errors in a cell file before the first frame."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path

import click

from axisbus.cell.problem import CellProblem, SharedProblem, errors, shared
from axisbus.check.ids.table import checks
from axisbus.check.run import check
from axisbus.cli.eds.check import explain_rule, ids_of, list_rules
from axisbus.cli.shared.common import OK, STYLES, WRONG, misuse, say, say_json, say_next, say_styled
from axisbus.cli.shared.options import PATH
from axisbus.eds.model import EdsFinding, Severity
from axisbus.eds.rules import sarif, table
from axisbus.errors import page_reference
from axisbus.version import __version__
from axisbus.wording import counted

_ORDER = ("note", "warning", "error")  # the worst comes last, at the end of the screen
_COMMAND = "axisbus check"


@click.command("check")
@click.argument("cell", type=PATH, required=False)
@click.option(
    "--ignore",
    multiple=True,
    metavar="IDS",
    help="Leave out warnings and notes of these checks, such as C019; separated by commas. Errors are always shown.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the findings as JSON.")
@click.option("--sarif", "as_sarif", is_flag=True, help="Print the findings as SARIF 2.1.0, for code hosts.")
@click.option("--errors-only", is_flag=True, help="Show neither warnings nor notes.")
@click.option("--explain", metavar="ID", help="Explain a check by its id; nothing is checked.")
@click.option("--list", "as_list", is_flag=True, help="List all checks with their ids; nothing is checked.")
@click.option("--schema", is_flag=True, help="Print a JSON Schema of cell files, for an editor's completion.")
def command(
    cell: Path | None, ignore: tuple[str, ...], as_json: bool, as_sarif: bool, errors_only: bool,
    explain: str | None, as_list: bool, schema: bool,
) -> int:  # fmt: skip
    """Find the errors and dangers in CELL (a cell.toml) before the first frame is sent.

    An error prevents the cell from being opened (exit code 1). A warning points to a danger, or to behaviour that can surprise. A
    note gives useful information. Errors are shown last. A finding that several axes or nodes share is shown once, with their
    names and lines. Each finding ends with the id of its check, such as [C017], for --explain and --ignore.
    """
    if (cell is None) is not (schema or as_list or explain is not None):
        raise click.UsageError("give a cell file, or --schema (for all cell files), --list or --explain ID")
    if explain is not None:
        return explain_rule(explain, checks())
    if as_list:
        return list_rules(list(checks().values()), _COMMAND, as_json)
    if as_json and as_sarif:
        return misuse("--json and --sarif exclude each other: give one of them")
    if cell is None:
        from axisbus.cell.json_schema import schema_of_cells

        say_json(schema_of_cells())
        return OK
    wanted = table.chooser((), ids_of(ignore), table.RuleIds(checks(), _COMMAND))
    problems = check(cell)
    code = WRONG if errors(problems) else OK
    visible_problems = [each for each in problems if each.severity is Severity.ERROR or wanted(each.rule)]
    ignored = len(shared(problems)) - len(shared(visible_problems))
    visible = errors(visible_problems) if errors_only else visible_problems
    if as_json:
        findings = [_plain(each) for each in shared(visible)]
        say_json({"file": str(cell), "ok": code == OK, "ignored": ignored, "findings": findings})
    elif as_sarif:
        found = {str(cell): [_finding(each) for each in visible]}
        say_json(sarif.log(found, __version__, Path.cwd(), _COMMAND, checks()))
    else:
        _show(cell, visible_problems, visible, ignored)
    return code


def _show(cell: Path, problems: list[CellProblem], visible: list[CellProblem], ignored: int) -> None:
    for problem in sorted(_merged(visible), key=_errors_last):
        severity = problem.severity.value
        say_styled(problem.with_rule, f"{severity}:", STYLES[severity])
    counts = Counter(problem.severity.value for problem in _merged(problems))
    left_out = f", {ignored} ignored" if ignored else ""
    say(
        f"{cell}: {', '.join(counted(counts[severity], severity) for severity in reversed(_ORDER))}{left_out}"
    )
    wrong = errors(problems)
    for page in sorted({problem.page for problem in wrong}):
        say(page_reference(page))
    say_next(f"fix the errors and check again: axisbus check {cell}" if wrong else f"axisbus boot {cell}")


def _merged(problems: Iterable[CellProblem]) -> list[CellProblem]:
    return [each.problem for each in shared(problems)]


def _errors_last(problem: CellProblem) -> tuple[int, int]:
    return _ORDER.index(problem.severity.value), problem.line


def _plain(found: SharedProblem) -> dict[str, object]:
    problem = found.problem
    return {
        **asdict(problem),
        "severity": problem.severity.value,
        "subjects": list(found.subjects),
        "lines": list(found.lines) or [problem.line],
    }


def _finding(problem: CellProblem) -> EdsFinding:
    """Return a problem in the form of EDS findings, for SARIF; each at its own line."""
    message = f"{problem.message} ({problem.observed})" if problem.observed else problem.message
    remedy = problem.remedy or checks()[problem.rule].remedy
    return EdsFinding(problem.rule, problem.severity, problem.line, 1, message, remedy)
