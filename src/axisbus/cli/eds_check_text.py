"""How ``axisbus eds check`` prints what it finds."""

from __future__ import annotations

import os
import textwrap
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping
from typing import Any

import click

from axisbus.cli.eds_files import terminal_width
from axisbus.eds.model import Finding, Severity
from axisbus.eds.rules.table import Rule, rules
from axisbus.wording import counted

_COLOURS = {Severity.ERROR: "red", Severity.WARNING: "yellow", Severity.NOTE: "cyan"}
_RANKS = {severity: rank for rank, severity in enumerate(Severity)}
_TEXT_WIDTH = 100
_Found = Mapping[str, tuple[Finding, ...]]


def lines(file: str, findings: Iterable[Finding]) -> Iterator[str]:
    """Yield ``file:line:column: severity ID message``, with what to do in a line of its own below."""
    for finding in findings:
        line, column = place(finding)
        word = _coloured(finding.severity.value, finding.severity)
        yield f"{_bold(f'{file}:{line}:{column}:')} {word} {finding.rule} {finding.message}"
        yield _dim(f"    {finding.remedy}")


def place(finding: Finding) -> tuple[int, int]:
    """Return line and column as editors want them: what concerns the whole file is shown at its beginning."""
    return max(1, finding.line), max(1, finding.column)


def summary(found: _Found) -> Iterator[str]:
    """Yield how often each rule was broken, worst first, and how much there is in all."""
    every = [finding for findings in found.values() for finding in findings]
    totalled = Counter((finding.rule, finding.severity) for finding in every)
    if every:
        yield ""
    for (rule, severity), count in sorted(totalled.items(), key=_worst_first):
        word = _coloured(f"{severity.value:8}", severity)
        yield f"{count:6} {word} {rule:6} {rules()[rule].title}"
    totals = Counter(finding.severity for finding in every)
    files = next(iter(found)) if len(found) == 1 else counted(len(found), "file")
    yield f"{files}: " + ", ".join(counted(totals[severity], severity.value) for severity in Severity)


def _worst_first(item: tuple[tuple[str, Severity], int]) -> tuple[int, int, str]:
    (rule, severity), count = item
    return _RANKS[severity], -count, rule


def next_step(found: _Found) -> str:
    """Return what to type next: to learn about the worst that was found, or to look at the file."""
    every = [finding for findings in found.values() for finding in findings]
    if not every:
        return f"axisbus eds show {next(iter(found), 'FILE')}"
    worst = min(every, key=lambda finding: _RANKS[finding.severity])
    return f"axisbus eds check --explain {worst.rule}"


def plain(found: _Found) -> dict[str, Any]:
    """Return the findings for ``--json``; lines and columns count from 1."""
    return {"findings": [_plain(file, finding) for file, findings in found.items() for finding in findings]}


def _plain(file: str, finding: Finding) -> dict[str, Any]:
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
    """Yield all that there is to say about a rule."""
    width = min(terminal_width() or _TEXT_WIDTH, _TEXT_WIDTH)
    yield f"{_bold(rule.id)} {_coloured(rule.severity.value, rule.severity)}: {rule.title}"
    if rule.clause:
        yield f"Stands in {rule.clause}."
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
    """Whether the user wants no colours (no-color.org); that a pipe gets none, click sees to."""
    return bool(os.environ.get("NO_COLOR"))
