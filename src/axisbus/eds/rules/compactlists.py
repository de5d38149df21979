"""Rules for CompactSubObj, [xxxxName], [xxxxValue], [xxxxDenotation] and [xxxxObjectLinks] (DS 306 4.6.3.2, 4.6.4)."""

from __future__ import annotations

from collections.abc import Iterator

from axisbus.eds.io import values
from axisbus.eds.io.text import Section
from axisbus.eds.rules.context import Hit, Looks, RuleContext, short

_COUNTED = ("name", "value", "denotation")
_LINKS = "objectlinks"


def both_forms(sheet: RuleContext) -> Iterator[Hit]:
    """B001."""
    for index, head in sheet.heads.items():
        count = values.plain(head.entries.get("compactsubobj", ""))
        if count and values.plain(head.entries.get("subnumber", "")):
            which = "; its sub-indices are described one by one" if index in sheet.subs else ""
            text = f"[{head.name}] has SubNumber beside CompactSubObj={count}{which}"
            yield sheet.at(head, "subnumber", text, index)


def counts(sheet: RuleContext) -> Iterator[Hit]:
    """B002."""
    for (index, kind), section in sheet.reading.parts.beside.items():
        if kind in _COUNTED:
            yield from _count(sheet, section, "nrofentries", "NrOfEntries", index)


def link_counts(sheet: RuleContext) -> Iterator[Hit]:
    """B003."""
    for (index, kind), section in sheet.reading.parts.beside.items():
        if kind == _LINKS:
            yield from _count(sheet, section, "objectlinks", "ObjectLinks", index)


def _count(sheet: RuleContext, section: Section, key: str, name: str, index: int) -> Iterator[Hit]:
    given = section.entries.get(key, "")
    there = sum(key[:1].isdigit() for key in section.entries)
    if values.plain(given) != there:
        text = f"[{section.name}] says {name}={short(given)}, but has {there}"
        yield sheet.at(section, key, text, index)


def link_targets(sheet: RuleContext) -> Iterator[Hit]:
    """B004."""
    for (index, kind), section in sheet.reading.parts.beside.items():
        for key, text in section.entries.items() if kind == _LINKS else ():
            target = values.plain(text)
            if key[:1].isdigit() and target not in sheet.eds.objects:
                yield sheet.at(
                    section,
                    key,
                    f"[{section.name}] links to {short(text)}, which the file does not describe",
                    index,
                )


def names_beyond(sheet: RuleContext) -> Iterator[Hit]:
    """O013, for names; the reader reports it for values and denotations."""
    for (index, kind), section in sheet.reading.parts.beside.items():
        head = sheet.heads.get(index)
        count = values.plain(head.entries.get("compactsubobj", "")) if head is not None else None
        for key in section.entries if kind == "name" and count else ():
            number = values.plain(key)
            if key != "nrofentries" and (number is None or number > (count or 0)):
                yield sheet.at(section, key, f"[{section.name}] names sub-index {short(key, 20)}", index)


def foreign_lists(sheet: RuleContext) -> Iterator[Hit]:
    """B005."""
    for (index, _), section in sheet.reading.parts.beside.items():
        if index not in sheet.heads:
            yield sheet.at(
                section, "", f"[{section.name}] belongs to [{index:04X}], which is not there", index
            )


LOOKS: Looks = {
    "B001": both_forms,
    "B002": counts,
    "B003": link_counts,
    "B004": link_targets,
    "B005": foreign_lists,
    "O013": names_beyond,
}
