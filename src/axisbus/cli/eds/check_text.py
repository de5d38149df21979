"""Output of ``axisbus eds check``."""

from __future__ import annotations

import os
import textwrap
from collections import Counter
from collections.abc import Collection, Iterable, Iterator, Mapping
from typing import Any

import click

from axisbus.cli.eds.files import terminal_width
from axisbus.eds.model import EdsFinding, Severity
from axisbus.eds.rules.table import Rule, rules
from axisbus.wording import counted, printable

_COLOURS = {Severity.ERROR: "red", Severity.WARNING: "yellow", Severity.NOTE: "cyan"}
_TEXT_WIDTH = 100
FIRST = 3  # locations shown for a rule, unless all are requested
_RULE_INDENT, _PLACE_INDENT, _REMEDY_INDENT = " " * 2, " " * 6, " " * 10
_Found = Mapping[str, tuple[EdsFinding, ...]]


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
    top, *more = _folded(f"{head} To do: {first.remedy}." if one_remedy else head, _RULE_INDENT)
    word = first.severity.value
    yield top.replace(word, _coloured(word, first.severity), 1)
    yield from more
    shown = group if each or len(group) <= FIRST + 1 else group[:FIRST]
    for finding in shown:
        line, column = place(finding)
        yield from _folded(f"{line}:{column} {finding.message}", _PLACE_INDENT)
        if not one_remedy:
            yield from map(_dim, _folded(f"to do: {finding.remedy}", _REMEDY_INDENT))
    if len(shown) < len(group):
        yield _dim(f"{_PLACE_INDENT}and {len(group) - len(shown)} more (--all shows them)")


def _folded(text: str, indent: str) -> list[str]:
    """Return a text with an indent, folded to the terminal; in a pipe a line may have any length."""
    width, text = terminal_width(), printable(text)
    if width is None:
        return [indent + text]
    return textwrap.wrap(text, width, initial_indent=indent, subsequent_indent=f"{indent}    ") or [indent]


def lines(file: str, findings: Iterable[EdsFinding]) -> Iterator[str]:
    """Yield ``file:line:column: severity ID message; remedy``, one line for each, in the order of the file's lines."""
    for finding in findings:
        line, column = place(finding)
        word = _coloured(finding.severity.value, finding.severity)
        where = _bold(printable(f"{file}:{line}:{column}:"))
        yield f"{where} {word} {finding.rule} {printable(f'{finding.message}; {finding.remedy}')}"


def place(finding: EdsFinding) -> tuple[int, int]:
    """Return line and column for editors: a finding about the whole file is shown at its beginning."""
    return max(1, finding.line), max(1, finding.column)


def summary(found: _Found, shown: Collection[Severity]) -> Iterator[str]:
    """Yield the count of each rule, unless the groups of the file show it already, and the totals."""
    every = [(file, finding) for file, findings in found.items() for finding in findings]
    visible = [(file, finding) for file, finding in every if finding.severity in shown]
    if visible:
        yield ""
    if len(found) > 1:
        yield from _table(visible)
    totals = Counter(finding.severity for _, finding in every)
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


def next_step(found: _Found) -> str:
    """Return the next command to type: to learn about the worst finding, or to inspect the file."""
    every = [finding for findings in found.values() for finding in findings]
    if not every:
        return f"axisbus eds show {next(iter(found), 'FILE')}"
    worst = min(every, key=lambda finding: finding.severity.rank)
    return f"axisbus eds check --explain {worst.rule}"


def plain(found: _Found) -> dict[str, Any]:
    """Return the findings for ``--json``; lines and columns count from 1."""
    return {"findings": [_plain(file, finding) for file, findings in found.items() for finding in findings]}


def _plain(file: str, finding: EdsFinding) -> dict[str, Any]:
    line, column = place(finding)
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
