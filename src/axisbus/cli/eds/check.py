"""``axisbus eds check``: find the errors in a file, with their locations."""

from __future__ import annotations

import os
import textwrap
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from pathlib import Path
from typing import Any

import click

from axisbus.cli.eds.files import expanded, say_lines, terminal_width
from axisbus.cli.shared.common import OK, WRONG, misuse, progress_bar, say_json, say_next
from axisbus.eds import builtin, checking
from axisbus.eds.model import EdsFinding, Severity
from axisbus.eds.rules import engine, sarif, table
from axisbus.eds.rules.table import Rule, rules
from axisbus.errors import EdsError
from axisbus.version import __version__
from axisbus.wording import counted, printable

_FAILING = {
    "error": {Severity.ERROR},
    "warning": {Severity.ERROR, Severity.WARNING},
    "note": set(Severity),
}
_BAR_FROM = 10  # files; with more, a progress bar is shown
_Found = dict[str, tuple[EdsFinding, ...]]
_Show = Callable[[str, Iterable[EdsFinding]], Iterable[str]]


def _severities(_: click.Context, __: click.Parameter, given: tuple[str, ...]) -> frozenset[Severity]:
    """Return the requested severities, all if none is given."""
    words = [word.strip().lower() for word in ids_of(given)]
    try:
        return frozenset(map(Severity, words)) or frozenset(Severity)
    except ValueError:
        raise click.BadParameter(
            f"give {', '.join(one.value for one in Severity)}, separated by commas"
        ) from None


@click.command("check")
@click.argument("files", nargs=-1)
@click.option(
    "--select",
    multiple=True,
    metavar="IDS",
    help="Apply only these rules: V003, or V for all rules of V; separated by commas.",
)
@click.option(
    "--ignore",
    multiple=True,
    metavar="IDS",
    help="Do not apply these rules; if --select matches a rule as well, the longer text decides.",
)
@click.option(
    "--fail-on",
    type=click.Choice(list(_FAILING)),
    default="error",
    show_default=True,
    help="Exit with 1 for findings of this severity or worse.",
)
@click.option(
    "--severity",
    "shown",
    multiple=True,
    metavar="WORDS",
    callback=_severities,
    help="Show only findings of these severities: error, warning, note; separated by commas. --json and --sarif always have all.",
)
@click.option("--all", "each", is_flag=True, help="Show every finding, not only the first ones of each rule.")
@click.option(
    "--lines",
    "as_lines",
    is_flag=True,
    help="Print one line for each finding, as file:line:column: ..., for editors.",
)
@click.option("--json", "as_json", is_flag=True, help="Print all findings as JSON.")
@click.option("--sarif", "as_sarif", is_flag=True, help="Print all findings as SARIF 2.1.0, for code hosts.")
@click.option("--explain", metavar="ID", help="Explain a rule; nothing is checked.")
@click.option(
    "--list", "as_list", is_flag=True, help="List all rules, or the selected ones; nothing is checked."
)
def command(
    files: tuple[str, ...], select: tuple[str, ...], ignore: tuple[str, ...], fail_on: str,
    shown: frozenset[Severity], each: bool, as_lines: bool, as_json: bool, as_sarif: bool,
    explain: str | None, as_list: bool,
) -> int:  # fmt: skip
    """Check FILES (EDS, DCF, builtin:NAME, or patterns such as 'eds/*.eds') according to CiA DS 306, CiA 301 and CiA 402.

    Error: a tool or the device fails. Warning: the file deviates from the standard. Note: useful to know. For each file, the
    report lists the broken rules, with the number of findings, the remedy, and line and column of the first findings. --all
    shows every finding, and --explain describes a rule.

    Exit codes: 0 no finding of the severity of --fail-on or worse (shown or not), 1 there is one, or a file cannot be read, 2
    wrong use.
    """
    wanted = table.chooser(ids_of(select), ids_of(ignore))
    if explain is not None:
        return explain_rule(explain, rules())
    if as_list:
        return list_rules(
            [rule for rule in rules().values() if wanted(rule.id)], "axisbus eds check", as_json
        )
    if as_json and as_sarif:
        return misuse("--json and --sarif exclude each other: give one of them")
    if not files:
        return misuse("no file is given, such as: axisbus eds check drive.eds (or --list, --explain ID)")
    found = _check_all(files, wanted, None if as_json or as_sarif else _printer(shown, each, as_lines))
    if as_json:
        say_json(plain(found))
    elif as_sarif:
        say_json(sarif.log(found, __version__, Path.cwd()))
    else:
        say_lines(summary(found, shown), styled=True)
        say_next(next_step(found))
    failing = _FAILING[fail_on]
    return (
        WRONG
        if any(one.severity in failing for all_findings in found.values() for one in all_findings)
        else OK
    )


def _printer(shown: frozenset[Severity], each: bool, as_lines: bool) -> _Show:
    """Return a function that formats the findings of a file as lines."""

    def show(file: str, findings: Iterable[EdsFinding]) -> Iterable[str]:
        visible = [finding for finding in findings if finding.severity in shown]
        if not visible:
            return ()
        return lines(file, visible) if as_lines else grouped(file, visible, each=each)

    return show


def _check_all(files: Iterable[str], wanted: Callable[[str], bool], show: _Show | None) -> _Found:
    """Return the findings in each file; ``show`` formats them, so that each file is printed as soon as it is checked."""
    found: _Found = {}
    named = list(expanded(files))
    with progress_bar("checking", quiet=show is not None or len(named) < _BAR_FROM) as on_progress:
        for number, file in enumerate(named, 1):
            found[file] = _check(file, wanted)
            if show is not None and (shown := list(show(file, found[file]))):
                say_lines(shown, styled=True)
            if on_progress is not None:
                on_progress(number, len(named))
    return found


def _check(file: str, wanted: Callable[[str], bool]) -> tuple[EdsFinding, ...]:
    try:
        return engine.check(checking.reading(builtin.resolve(file, Path())), wanted)
    except EdsError as error:
        return (engine.unreadable(error),)


def explain_rule(rule: str, known: Mapping[str, Rule]) -> int:
    """Print the explanation of a rule; return the exit code."""
    found = table.RuleIds(known).starting(rule)
    if len(found) != 1:
        hint = f"rules that begin so: {', '.join(found)}" if found and rule else "all rules: --list"
        return misuse(f"--explain: {rule[:20]!r} is not the id of a rule; {hint}")
    say_lines(explained(known[found[0]]), styled=True)
    return OK


def list_rules(chosen: list[Rule], command: str, as_json: bool) -> int:
    """Print rules, and the command that explains one; return the exit code."""
    if as_json:
        say_json({"rules": [plain_rule(rule) for rule in chosen]})
    else:
        say_lines(listed(chosen), styled=True)
        say_next(f"{command} --explain ID")
    return OK


def ids_of(given: Iterable[str]) -> list[str]:
    """Return the ids of a repeatable option, each of which may have several, separated by commas."""
    return [text for each in given for text in each.split(",")]


# -- Output of the command: findings by rule or one by one, the summary, and the rules -------------------------------------

_COLOURS = {Severity.ERROR: "red", Severity.WARNING: "yellow", Severity.NOTE: "cyan"}
_TEXT_WIDTH = 100
FIRST = 3  # locations shown for a rule, unless all are requested
_RULE_INDENT, _LOCATION_INDENT, _REMEDY_INDENT = " " * 2, " " * 6, " " * 10
_Findings = Mapping[str, tuple[EdsFinding, ...]]


def grouped(file: str, findings: Iterable[EdsFinding], *, each: bool) -> Iterator[str]:
    """Yield the file's name, then each violated rule with its first locations (all, if ``each``); errors last."""
    groups: dict[tuple[str, Severity], list[EdsFinding]] = {}
    for finding in findings:
        groups.setdefault((finding.rule, finding.severity), []).append(finding)
    yield _bold(printable(file))
    for group in sorted(groups.values(), key=_errors_last):
        yield from _group(group, each=each)


def _errors_last(group: list[EdsFinding]) -> tuple[int, int, str]:
    """Return the sort key of the groups of a file: the worst last, within a severity the most frequent first."""
    return -group[0].severity.rank, -len(group), group[0].rule


def _group(group: list[EdsFinding], *, each: bool) -> Iterator[str]:
    first = group[0]
    times = f" {counted(len(group), 'time')}" if len(group) > 1 else ""
    one_remedy = all(finding.remedy == first.remedy for finding in group)
    head = f"{first.severity.value} {first.rule}{times}: {rules()[first.rule].title}"
    top, *more = _wrapped(f"{head} To do: {first.remedy}." if one_remedy else head, _RULE_INDENT)
    word = first.severity.value
    yield top.replace(word, _coloured(word, first.severity), 1)
    yield from more
    shown = group if each or len(group) <= FIRST + 1 else group[:FIRST]
    for finding in shown:
        line, column = location(finding)
        yield from _wrapped(f"{line}:{column} {finding.message}", _LOCATION_INDENT)
        if not one_remedy:
            yield from map(_dim, _wrapped(f"to do: {finding.remedy}", _REMEDY_INDENT))
    if len(shown) < len(group):
        yield _dim(f"{_LOCATION_INDENT}and {len(group) - len(shown)} more (--all shows them)")


def _wrapped(text: str, indent: str) -> list[str]:
    """Return a text with an indent, folded to the terminal; in a pipe a line may have any length."""
    width, text = terminal_width(), printable(text)
    if width is None:
        return [indent + text]
    return textwrap.wrap(text, width, initial_indent=indent, subsequent_indent=f"{indent}    ") or [indent]


def lines(file: str, findings: Iterable[EdsFinding]) -> Iterator[str]:
    """Yield ``file:line:column: severity ID message; remedy``, one line for each, in the order of the file's lines."""
    for finding in findings:
        line, column = location(finding)
        word = _coloured(finding.severity.value, finding.severity)
        where = _bold(printable(f"{file}:{line}:{column}:"))
        yield f"{where} {word} {finding.rule} {printable(f'{finding.message}; {finding.remedy}')}"


def location(finding: EdsFinding) -> tuple[int, int]:
    """Return line and column for editors: a finding about the whole file is shown at its beginning."""
    return max(1, finding.line), max(1, finding.column)


def summary(found: _Findings, shown: Collection[Severity]) -> Iterator[str]:
    """Yield the count of each rule, unless the groups of the file show it already, and the totals."""
    all_findings = [(file, finding) for file, findings in found.items() for finding in findings]
    visible = [(file, finding) for file, finding in all_findings if finding.severity in shown]
    if visible:
        yield ""
    if len(found) > 1:
        yield from _table(visible)
    totals = Counter(finding.severity for _, finding in all_findings)
    files = counted(len(found), "file") if len(found) > 1 else "in all" if visible else next(iter(found))
    yield f"{printable(files)}: " + ", ".join(
        _total(severity, totals[severity], shown) for severity in Severity
    )


def _total(severity: Severity, count: int, shown: Collection[Severity]) -> str:
    return counted(count, severity.value) + (" (not shown)" if count and severity not in shown else "")


def _table(visible: Iterable[tuple[str, EdsFinding]]) -> Iterator[str]:
    """Yield a line for each rule: how often, in how many files; errors last."""
    files: dict[tuple[str, Severity], Counter[str]] = {}
    for file, finding in visible:
        files.setdefault((finding.rule, finding.severity), Counter())[file] += 1
    for (rule, severity), where in sorted(files.items(), key=_row_order):
        word = _coloured(f"{severity.value:8}", severity)
        yield f"{where.total():6} {word} {rule:6} {rules()[rule].title} ({counted(len(where), 'file')})"


def _row_order(row: tuple[tuple[str, Severity], Counter[str]]) -> tuple[int, int, str]:
    (rule, severity), where = row
    return -severity.rank, where.total(), rule


def next_step(found: _Findings) -> str:
    """Return the next command to type: to learn about the worst finding, or to inspect the file."""
    all_findings = [finding for findings in found.values() for finding in findings]
    if not all_findings:
        return f"axisbus eds show {next(iter(found), 'FILE')}"
    worst = min(all_findings, key=lambda finding: finding.severity.rank)
    return f"axisbus eds check --explain {worst.rule}"


def plain(found: _Findings) -> dict[str, Any]:
    """Return the findings for ``--json``; lines and columns count from 1."""
    return {"findings": [_plain(file, finding) for file, findings in found.items() for finding in findings]}


def _plain(file: str, finding: EdsFinding) -> dict[str, Any]:
    line, column = location(finding)
    return {
        "file": file,
        "line": line,
        "column": column,
        "rule": finding.rule,
        "severity": finding.severity.value,
        "index": finding.index,
        "subindex": finding.subindex,
        "message": finding.message,
        "remedy": finding.remedy,
    }


def plain_rule(rule: Rule) -> dict[str, str]:
    """Return a rule for ``--list --json``."""
    return {**rule._asdict(), "severity": rule.severity.value}


def listed(chosen: Iterable[Rule]) -> Iterator[str]:
    """Yield one line for each rule."""
    for rule in chosen:
        yield f"{rule.id:6} {_coloured(f'{rule.severity.value:8}', rule.severity)} {rule.title}"


def explained(rule: Rule) -> Iterator[str]:
    """Yield the explanation of a rule."""
    width = min(terminal_width() or _TEXT_WIDTH, _TEXT_WIDTH)
    yield f"{_bold(rule.id)} {_coloured(rule.severity.value, rule.severity)}: {rule.title}"
    if rule.clause:
        yield f"Reference: {rule.clause}."
    yield ""
    yield from textwrap.wrap(rule.explanation, width)
    yield ""
    yield from textwrap.wrap(f"To do: {rule.remedy}.", width)


def _bold(text: str) -> str:
    return text if _plain_text() else click.style(text, bold=True)


def _dim(text: str) -> str:
    return text if _plain_text() else click.style(text, dim=True)


def _coloured(text: str, severity: Severity) -> str:
    return text if _plain_text() else click.style(text, fg=_COLOURS[severity], bold=True)


def _plain_text() -> bool:
    """Whether the user wants no colours (no-color.org); click itself removes them in a pipe."""
    return bool(os.environ.get("NO_COLOR"))
