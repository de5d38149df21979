"""Fixes of counts, and of the numbering of lists."""

from __future__ import annotations

import re
from bisect import bisect_left
from collections.abc import Iterator, Mapping

from axisbus.eds.fixes.base import Fix, FixContext, FixFunction, short
from axisbus.eds.fixes.spelling import LISTS
from axisbus.eds.io import edit, values
from axisbus.eds.io.compact import MAX_ENTRIES
from axisbus.eds.io.edit import LineEdit
from axisbus.eds.io.text import Section
from axisbus.eds.rules import records

_COMMENT_LINE = re.compile(r"line[1-9][0-9]*")
_MODULE_LIST = re.compile(r"m[0-9]+(?:fixedobjects|subextends)|connectedmodules")


def _counted(context: FixContext, rule: str, section: Section, key: str, there: int) -> Iterator[Fix]:
    """Correct a count, in its own notation; a missing count is added below the section's header."""
    given = section.entries.get(key.lower())
    if values.plain(given or "") == there:
        return
    new = f"0x{there:X}" if (given or "")[:2].lower() == "0x" else str(there)
    if given is None:
        change = edit.insert_key(context.document, section, key, new, first=True)
        yield Fix(rule, section.line, f"[{section.name}] {key}={new} added", (change,))
    else:
        change = edit.set_value(context.document, section, key, new)
        what = f"[{section.name}] {key} {short(given) or 'empty'} -> {new}"
        yield Fix(rule, section.line_numbers[key.lower()], what, (change,))


def _numbered(section: Section) -> int:
    return sum(key[:1].isdigit() for key in section.entries)


def _object_lists(context: FixContext) -> Iterator[Fix]:
    """Fix L001 and L003."""
    for section in _clear(context):
        rule = "L003" if "supportedobjects" in section.entries else "L001"
        yield from _counted(context, rule, section, "SupportedObjects", _numbered(section))


def _lists(context: FixContext) -> Iterator[Section]:
    sections = context.document.sections
    yield from (sections[name] for name in LISTS if name in sections)


def _numbering(context: FixContext) -> Iterator[Fix]:
    """Fix L004: number the entries from 1 in their order; an entry whose number is a duplicate counts again."""
    for section in _clear(context):
        entries = _entries(section)
        changes = [
            edit.rename_key(context.document, line, str(number))
            for number, (line, key, _) in enumerate(entries, 1)
            if key != str(number)
        ]
        if changes:
            yield Fix("L004", changes[0].line, f"[{section.name}] numbered anew", tuple(changes))


def _clear(context: FixContext) -> Iterator[Section]:
    """Yield the lists that contain no unknown lines, such as merge markers."""
    strange = context.lines.get("S006", ())
    for section in _lists(context):
        at = bisect_left(strange, section.line)
        if at == len(strange) or strange[at] >= section.end:
            yield section


def _entries(section: Section) -> list[tuple[int, str, str]]:
    """Return line, key and value of all entries of a list, including entries with a duplicate key."""
    return [(line, key, given) for line, key, given in section.every() if key[:1].isdigit()]


def _listed_already(context: FixContext) -> Iterator[Fix]:
    """Fix S004: remove an entry with a duplicate number if another entry lists the same object."""
    for section in _clear(context):
        counted = {values.plain(given) for key, given in section.entries.items() if key[:1].isdigit()}
        for line, key, given in _entries(section):
            index = values.plain(given)
            if section.line_numbers[key] == line or index is None:
                continue
            if index in counted:
                what = f"[{section.name}] {key}={short(given)} removed, it is listed under another number"
                yield Fix("S004", line, what, (LineEdit(line, 1),))
            counted.add(index)


def _sub_numbers(context: FixContext) -> Iterator[Fix]:
    """Fix O007 and O024."""
    parts, objects = context.reading.parts, context.reading.eds.objects
    for index, head in parts.heads.items():
        if not objects[index].is_record or records.is_compact(head):
            continue
        there = len(parts.subs.get(index, {}).keys() - {records.STRUCTURE})
        if there == 0 or records.missing_subindex(objects[index], head, there) is not None:
            continue  # O008, O007: a sub-index is missing, so the count is not wrong
        rule = "O007" if head.entries.get("subnumber") else "O024"
        yield from _sub_number(context, rule, head, there)


def _sub_number(context: FixContext, rule: str, head: Section, there: int) -> Iterator[Fix]:
    if "subnumber" in head.entries:
        yield from _counted(context, rule, head, "SubNumber", there)
    else:
        change = edit.insert_key(context.document, head, "SubNumber", str(there))
        yield Fix(rule, head.line, f"[{head.name}] SubNumber={there} added", (change,))


def _compact(context: FixContext) -> Iterator[Fix]:
    """Fix O013 and B001: the highest number of compact sub-indices is 254, and SubNumber is then 0."""
    for index, head in context.reading.parts.heads.items():
        if index in context.reading.parts.subs:
            continue  # they are described one by one: here CompactSubObj is superfluous
        count = values.plain(head.entries.get("compactsubobj", ""))
        if count == MAX_ENTRIES + 1:
            yield from _counted(context, "O013", head, "CompactSubObj", MAX_ENTRIES)
        elif count and values.plain(head.entries.get("subnumber", "")):
            yield from _counted(context, "B001", head, "SubNumber", 0)


def _list_section(context: FixContext) -> Iterator[Fix]:
    """Fix B002 and B003."""
    for (_, kind), section in context.reading.parts.list_sections.items():
        links = kind == "objectlinks"
        rule, key = ("B003", "ObjectLinks") if links else ("B002", "NrOfEntries")
        yield from _counted(context, rule, section, key, _numbered(section))


def _module_lists(context: FixContext) -> Iterator[Fix]:
    """Fix X004."""
    for name, section in context.document.sections.items():
        if _MODULE_LIST.fullmatch(name):
            yield from _counted(context, "X004", section, "NrOfEntries", _numbered(section))


def _comment_lines(context: FixContext) -> Iterator[Fix]:
    """Fix D017."""
    section = context.document.sections.get("comments")
    if section is not None:
        lines = sum(1 for key in section.entries if _COMMENT_LINE.fullmatch(key))
        yield from _counted(context, "D017", section, "Lines", lines)


NUMBERING: Mapping[str, FixFunction] = {"S004": _listed_already, "L004": _numbering}

# By rule; a fix of two rules is listed under the second.
FIXES: Mapping[str, FixFunction] = {
    "B001": _compact,
    "B002": _list_section,
    "D017": _comment_lines,
    "L003": _object_lists,
    "O007": _sub_numbers,
    "X004": _module_lists,
}
