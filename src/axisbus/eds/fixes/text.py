"""Fixes of the text itself: lines, comments, and duplicates (DS 306 4.2)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from axisbus.eds.fixes.base import Fix, FixContext, Mend, each, short
from axisbus.eds.io import edit, text
from axisbus.eds.io.edit import LineEdit
from axisbus.eds.io.text import Section
from axisbus.eds.model import EdsFinding

_TRAILING = re.compile(r"\s*;|(?:^|\s+)#")
_FOREIGN_COMMENT = ("#", "//")


def _comments(rule: str) -> Mend:
    """Fix S005 and S006: comments in the syntax of another format."""

    def mend(bench: FixContext) -> Iterator[Fix]:
        for number in bench.lines.get(rule, ()):
            raw = bench.document.lines[number - 1].removesuffix("\r")
            if raw.lstrip().startswith(_FOREIGN_COMMENT):
                change = LineEdit(number, 1, (f";{raw.lstrip()}",))
                yield Fix(rule, number, f"{short(raw.strip())} made a comment", (change,))

    return mend


def _indented(bench: FixContext, finding: EdsFinding) -> Fix:
    """Fix S009."""
    raw = bench.document.lines[finding.line - 1].removesuffix("\r")
    change = LineEdit(finding.line, 1, (raw.lstrip(),))
    return Fix("S009", finding.line, f"{short(raw.strip())} moved to column 1", (change,))


def _unclosed(bench: FixContext, finding: EdsFinding) -> Fix | None:
    """Fix S010."""
    section = bench.section_at(finding.line)
    if not section.name or "[" in section.name:
        return None
    change = edit.rename_section(bench.document, section, section.name)
    return Fix("S010", finding.line, f"[{short(section.name)} closed", (change,))


def _behind(bench: FixContext, finding: EdsFinding) -> Fix | None:
    """Fix S011: move the text after a value or a name to a comment in the next line."""
    raw = bench.document.lines[finding.line - 1].removesuffix("\r")
    section = bench.section_at(finding.line)
    kept, behind = _header(raw) if finding.line == section.line else _value(raw)
    if not behind:
        return None
    comment = behind if behind[0] == ";" else f"; {behind}"
    change = LineEdit(finding.line, 1, (kept, comment))
    return Fix("S011", finding.line, f"{short(behind)} moved to a separate line", (change,))


def _header(raw: str) -> tuple[str, str]:
    name, _, behind = raw.partition("]")
    return f"{name}]", behind.strip()


def _value(raw: str) -> tuple[str, str]:
    key, _, rest = raw.partition("=")
    if key.strip().lower() == "accesstype":
        word = re.match(r"\s*[A-Za-z]+", rest)
        end = word.end() if word else len(rest)
    else:
        found = _TRAILING.search(rest)
        end = found.start() if found else len(rest)
    return f"{key}={rest[:end]}", rest[end:].strip()


def _same_section(bench: FixContext, finding: EdsFinding) -> Fix | None:
    """Fix S003: remove the second of two equal sections."""
    second = bench.section_at(finding.line)
    first = bench.document.sections[second.name.lower()]
    if first is second:
        first = bench.again.get(second, second)
    if first is second or first.entries != second.entries:
        return None
    if not (_plain(bench, first) and _plain(bench, second)):
        return None
    return Fix(
        "S003",
        finding.line,
        f"[{second.name}] removed, it repeats line {first.line}",
        tuple(_without_comments(bench, second)),
    )


def _plain(bench: FixContext, section: Section) -> bool:
    """Whether a section has no duplicate key and no unknown line."""
    lines = [line for raw in bench.document.lines[section.line : section.end - 1] if (line := raw.strip())]
    return sum(line[0] != ";" for line in lines) == len(section.entries)


def _without_comments(bench: FixContext, section: Section) -> Iterator[LineEdit]:
    lines = bench.document.lines
    ended = len(lines) if lines[-1] == "" else 0  # after the last line end there is no line
    for number in range(section.line, section.end):
        if lines[number - 1].lstrip()[:1] != ";" and number != ended:
            yield LineEdit(number, 1)


def _same_key(bench: FixContext, finding: EdsFinding) -> Fix | None:
    """Fix S004: remove the second of two equal entries."""
    key, given = text.entry_of(bench.document.lines[finding.line - 1])
    if bench.section_at(finding.line).entries.get(key) != given:
        return None
    what = f"{short(key)} removed, it is there already with the same value"
    return Fix("S004", finding.line, what, (LineEdit(finding.line, 1),))


MENDS: Mapping[str, Mend] = {
    "S003": each("S003", _same_section),
    "S004": each("S004", _same_key),
    "S005": _comments("S005"),
    "S006": _comments("S006"),
    "S009": each("S009", _indented),
    "S010": each("S010", _unclosed),
    "S011": each("S011", _behind),
}
