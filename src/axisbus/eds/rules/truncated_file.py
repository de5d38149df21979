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


def ending(context: RuleContext) -> FileTruncation | None:
    """Return the end of a file that ends early; None if it ends correctly, or if that is uncertain."""
    all_sections = (*context.document.sections.values(), *context.document.repeated)
    *before, last = sorted(all_sections, key=lambda section: section.line)
    index = _index_of(context, last)
    absent = _absent_at_the_end(context)
    broken = _breaks_off(context)
    unfinished = index is not None and _is_unfinished(context, last, index)
    without_entries = index is not None and _announces(context, last, index)
    is_truncated = broken or without_entries or len(absent) >= _SEVERAL or (bool(absent) and unfinished)
    unended = unfinished and context.document.lines[-1] != ""
    if not (is_truncated or unended):
        return None
    if index is None and before:  # half a header: the object before it may be incomplete
        index = _index_of(context, before[-1])
    return FileTruncation(last, index, absent)


def _breaks_off(context: RuleContext) -> bool:
    """Whether the last line has no line end and is incomplete."""
    line = context.document.lines[-1].strip()
    if not line or line[0] == ";":
        return False
    if line[0] == "[":
        return "]" not in line
    return not entry_of(line)[0] or entry_of(line)[1].lower() == "0x"


def _absent_at_the_end(context: RuleContext) -> tuple[int, ...]:
    """Return the listed objects that have no section, if they are the last ones by the lists or by their indices."""
    lists = sorted(filter(None, map(context.section, LISTS)), key=lambda section: section.line)
    listed = [
        index
        for section in lists
        for key, text in section.entries.items()
        if key[:1].isdigit() and (index := values.plain(text)) is not None
    ]
    absent = [index for index in listed if index not in context.eds]
    present = [index for index in listed if index in context.eds]
    if not absent or not present:
        return ()
    by_list, by_index = listed[-len(absent) :] == absent, min(absent) > max(present)
    return tuple(absent) if by_list or by_index else ()


def _index_of(context: RuleContext, section: Section) -> int | None:
    for index, head in context.heads.items():
        if head is section or section in context.subs.get(index, {}).values():
            return index
    return None


def _announces(context: RuleContext, last: Section, index: int) -> bool:
    """Whether the last section announces sub-indices, but none follows."""
    without_entries = (
        last is context.heads.get(index)
        and index not in context.subs
        and context.eds.objects[index].is_record
    )
    return without_entries and not is_compact(last) and bool(values.plain(last.entries.get("subnumber", "")))


def _is_unfinished(context: RuleContext, last: Section, index: int) -> bool:
    """Whether the last section, or its object, lacks a mandatory part."""
    entry, head = context.eds.objects[index], context.heads.get(index, last)
    if entry.is_record and last is head and index not in context.subs and not is_compact(head):
        return True
    if any(not last.entries.get(key) for key in _NEEDED) and last.entries.get("objecttype") not in (
        "2",
        "0x2",
    ):
        return True
    declared = values.plain(head.entries.get("subnumber", ""))
    return (
        entry.is_record
        and declared is not None
        and declared > len(context.subs.get(index, {}).keys() - {STRUCTURE})
    )


@finds("S020")
def ends_early(context: RuleContext) -> Iterator[Hit]:
    """S020."""
    found = ending(context)
    if found is None:
        return
    lines = context.document.lines
    number = next(number for number in range(len(lines), 0, -1) if lines[number - 1].strip())
    missing = counted(len(found.absent), "object", "objects")
    more = f"; {missing} of its lists are missing after the end" if found.absent else ""
    yield Hit(number, 1, f"the file ends in the middle, in [{short(found.section.name)}]{more}")


def without_consequences(context: RuleContext, found: Iterable[EdsFinding]) -> list[EdsFinding]:
    """Return the findings without consequences of the early end of the file."""
    all_sections = list(found)
    end = ending(context) if any(each.rule == RULE for each in all_sections) else None
    if end is None:
        return all_sections
    return [each for each in all_sections if each.rule == RULE or not _follows(each, end)]


def _follows(finding: EdsFinding, end: FileTruncation) -> bool:
    of_last = end.index is not None and finding.index == end.index
    return finding.rule in CONSEQUENCES or of_last or finding.line >= end.section.line
