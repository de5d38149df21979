"""The rule for a file that ends in the middle, and the findings that are only its consequences (DS 306 4.6.3)."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from typing import NamedTuple

from axisbus.eds.io import values
from axisbus.eds.io.text import Section, entry_of
from axisbus.eds.model import EdsFinding
from axisbus.eds.rules.context import LISTS, Hit, RuleContext, finds, short
from axisbus.eds.rules.records import STRUCTURE, is_compact
from axisbus.wording import counted

RULE = "S020"
_SEVERAL = 2  # missing listed objects at the end; a single one may be a mistake
_NEEDED = ("parametername", "datatype", "accesstype")
# Rules about parts that are missing because the rest of the file is missing.
CONSEQUENCES = frozenset(
    (
        *("L001", "L005", "D006", "B004", "K002", "P001", "P002", "P007"),
        *("C001", "C006", "C007", "C008", "C009", "C010", "C011", "C015"),
        *("M001", "M001c", "M006", "M008", "M009", "M011", "M012", "M013", "M018", "M020"),
    )
)


class FileTruncation(NamedTuple):
    """The end of a truncated file: its last section, the object of that section, and the listed objects that are missing."""

    section: Section
    index: int | None  # type: ignore[assignment]  # hides tuple.index, which is not used
    absent: tuple[int, ...]


def ending(sheet: RuleContext) -> FileTruncation | None:
    """Return the end of a file that ends early; None if it ends correctly, or if that is uncertain."""
    every = (*sheet.document.sections.values(), *sheet.document.repeated)
    *before, last = sorted(every, key=lambda section: section.line)
    index = _index_of(sheet, last)
    absent = _absent_at_the_end(sheet)
    broken = _breaks_off(sheet)
    unfinished = index is not None and _is_unfinished(sheet, last, index)
    bare = index is not None and _announces(sheet, last, index)
    early = broken or bare or len(absent) >= _SEVERAL or (bool(absent) and unfinished)
    unended = unfinished and sheet.document.lines[-1] != ""
    if not (early or unended):
        return None
    if index is None and before:  # half a header: the object before it may be incomplete
        index = _index_of(sheet, before[-1])
    return FileTruncation(last, index, absent)


def _breaks_off(sheet: RuleContext) -> bool:
    """Whether the last line has no line end and is incomplete."""
    line = sheet.document.lines[-1].strip()
    if not line or line[0] == ";":
        return False
    if line[0] == "[":
        return "]" not in line
    return not entry_of(line)[0] or entry_of(line)[1].lower() == "0x"


def _absent_at_the_end(sheet: RuleContext) -> tuple[int, ...]:
    """Return the listed objects that have no section, if they are the last ones by the lists or by their indices."""
    lists = sorted(filter(None, map(sheet.section, LISTS)), key=lambda section: section.line)
    listed = [
        index
        for section in lists
        for key, text in section.entries.items()
        if key[:1].isdigit() and (index := values.plain(text)) is not None
    ]
    absent = [index for index in listed if index not in sheet.eds]
    there = [index for index in listed if index in sheet.eds]
    if not absent or not there:
        return ()
    by_list, by_index = listed[-len(absent) :] == absent, min(absent) > max(there)
    return tuple(absent) if by_list or by_index else ()


def _index_of(sheet: RuleContext, section: Section) -> int | None:
    for index, head in sheet.heads.items():
        if head is section or section in sheet.subs.get(index, {}).values():
            return index
    return None


def _announces(sheet: RuleContext, last: Section, index: int) -> bool:
    """Whether the last section announces sub-indices, but none follows."""
    bare = last is sheet.heads.get(index) and index not in sheet.subs and sheet.eds.objects[index].is_record
    return bare and not is_compact(last) and bool(values.plain(last.entries.get("subnumber", "")))


def _is_unfinished(sheet: RuleContext, last: Section, index: int) -> bool:
    """Whether the last section, or its object, lacks a mandatory part."""
    entry, head = sheet.eds.objects[index], sheet.heads.get(index, last)
    if entry.is_record and last is head and index not in sheet.subs and not is_compact(head):
        return True
    if any(not last.entries.get(key) for key in _NEEDED) and last.entries.get("objecttype") not in (
        "2",
        "0x2",
    ):
        return True
    said = values.plain(head.entries.get("subnumber", ""))
    return entry.is_record and said is not None and said > len(sheet.subs.get(index, {}).keys() - {STRUCTURE})


@finds("S020")
def ends_early(sheet: RuleContext) -> Iterator[Hit]:
    """S020."""
    found = ending(sheet)
    if found is None:
        return
    lines = sheet.document.lines
    number = next(number for number in range(len(lines), 0, -1) if lines[number - 1].strip())
    missing = counted(len(found.absent), "object", "objects")
    more = f"; {missing} of its lists are missing after the end" if found.absent else ""
    yield Hit(number, 1, f"the file ends in the middle, in [{short(found.section.name)}]{more}")


def without_consequences(sheet: RuleContext, found: Iterable[EdsFinding]) -> list[EdsFinding]:
    """Return the findings without consequences of the early end of the file."""
    every = list(found)
    end = ending(sheet) if any(each.rule == RULE for each in every) else None
    if end is None:
        return every
    return [each for each in every if each.rule == RULE or not _follows(each, end)]


def _follows(finding: EdsFinding, end: FileTruncation) -> bool:
    of_last = end.index is not None and finding.index == end.index
    return finding.rule in CONSEQUENCES or of_last or finding.line >= end.section.line
