"""The definition of a fix, and the reading as the fixes use it."""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from typing import NamedTuple

from axisbus.cia301.datatypes import DataType
from axisbus.eds.io import values
from axisbus.eds.io.edit import LineEdit
from axisbus.eds.io.findings import Findings
from axisbus.eds.io.lazy_objects import FileObjects
from axisbus.eds.io.reader import EdsParseResult
from axisbus.eds.io.text import EdsText, Section
from axisbus.eds.model import EdsFinding, Severity

_FIRST_OWN_TYPE = 0x40


class Fix(NamedTuple):
    """One fix: the broken ``rule``, the ``line`` (from 1), and the change in words."""

    rule: str
    line: int
    what: str
    changes: tuple[LineEdit, ...]


class _AllFindings(Findings):
    """Collects all findings by rule, however many; the fixes only use their locations."""

    def __init__(self) -> None:
        super().__init__()
        self.found: dict[str, list[EdsFinding]] = {}
        self.lines: dict[str, list[int]] = {}

    def add(
        self,
        rule: str,
        message: str,
        *,
        line: int = 0,
        column: int = 1,
        index: int | None = None,
        subindex: int | None = None,
    ) -> None:
        finding = EdsFinding(rule, Severity.NOTE, line, column, message, "", index, subindex)
        self.found.setdefault(rule, []).append(finding)

    def add_lines(self, rule: str, numbers: Sequence[int], message: Callable[[int], str]) -> None:
        del message  # the fixes do not use messages
        self.lines.setdefault(rule, []).extend(numbers)


class FixContext:
    """A reading for the fixes; frozen, derived values are calculated once on first use."""

    def __init__(self, reading: EdsParseResult) -> None:
        self.reading = reading
        self.document: EdsText = reading.document

    @cached_property
    def _all_findings(self) -> _AllFindings:
        collected = _AllFindings()
        FileObjects(self.document, self.reading.parts).go_through(collected)
        for numbers in collected.lines.values():
            numbers.sort()  # repeated sections are processed last
        return collected

    @property
    def found(self) -> Mapping[str, Sequence[EdsFinding]]:
        """All findings of the reading, by rule, without those in ``lines``."""
        return self._all_findings.found

    @property
    def lines(self) -> Mapping[str, Sequence[int]]:
        """By rule (S005, S006), the lines that are neither section, entry nor comment: there may be a million."""
        return self._all_findings.lines

    @cached_property
    def duplicates(self) -> Mapping[Section, Section]:
        """Sections of a sub-index that another section already describes, each with that other section."""
        return dict(self.reading.parts.duplicates)

    @cached_property
    def _sections(self) -> tuple[Section, ...]:
        collected = (*self.document.sections.values(), *self.document.repeated)
        return tuple(sorted(collected, key=lambda section: section.line))

    @cached_property
    def _starts(self) -> tuple[int, ...]:
        return tuple(section.line for section in self._sections)

    def section_at(self, line: int) -> Section:
        """Return the section of a line; the line must not precede the first section."""
        return self._sections[bisect_right(self._starts, line) - 1]

    def type_at(self, finding: EdsFinding) -> DataType:
        """Return the data type of the value of a finding."""
        given = values.plain(self.section_at(finding.line).entries.get("datatype", "")) or 0
        if 0 < given < _FIRST_OWN_TYPE:
            return DataType(given)
        entry = self.reading.eds.get(finding.index or 0, finding.subindex or 0)
        return DataType(0) if entry is None else entry.data_type


FixFunction = Callable[[FixContext], Iterable[Fix]]
_Single = Callable[[FixContext, EdsFinding], Fix | None]


def each(rule: str, single: _Single) -> FixFunction:
    """Return a fix that examines each finding of a rule separately."""

    def fix_function(context: FixContext) -> Iterator[Fix]:
        for finding in context.found.get(rule, ()):
            one_fix = single(context, finding)
            if one_fix is not None:
                yield one_fix

    return fix_function


def short(text: str) -> str:
    """Return a text of a file, shortened to fit into a sentence."""
    return text if len(text) <= 40 else text[:37] + "..."
