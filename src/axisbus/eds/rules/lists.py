"""Rules for [MandatoryObjects], [OptionalObjects], [ManufacturerObjects], and lists of compact objects (DS 306 4.6.3, 4.6.4)."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from axisbus.eds.io import values
from axisbus.eds.io.new_file import FIRST_OBJECT
from axisbus.eds.io.text import Section
from axisbus.eds.rules.context import LISTS, Hit, RuleContext, finds, list_of, short
from axisbus.wording import counted


class Listed(NamedTuple):
    """One line of a list: its key and text as written, and its index (None: no valid index)."""

    section: Section
    key: str
    text: str
    target: int | None


@finds("L001")
def missing_lists(context: RuleContext) -> Iterator[Hit]:
    """L001."""
    for name, spelled in LISTS.items():
        section = context.section(name)
        if section is None:
            example = next((index for index in context.heads if list_of(index) == name), None)
            if example is not None:
                yield context.at(
                    context.heads[example],
                    "",
                    f"there is no section [{spelled}], though [{example:04X}] belongs there",
                )
        elif "supportedobjects" not in section.entries:
            yield context.at(section, "", f"[{section.name}] has no SupportedObjects")


@finds("L003")
def counts(context: RuleContext) -> Iterator[Hit]:
    """L003."""
    for section in _lists(context):
        given = section.entries.get("supportedobjects")
        entries = list(_entries(section))
        present = len(entries)
        if given is None or values.plain(given) == present or (entries and given == entries[-1].key):
            continue  # the last number is right, but one before it is missing: L004
        text = (
            f"[{section.name}] says SupportedObjects={short(given)}, but names {counted(present, 'object')}"
        )
        yield context.at(section, "supportedobjects", text)


@finds("L004")
def numbering(context: RuleContext) -> Iterator[Hit]:
    """L004."""
    for section in _lists(context):
        for expected, listed in enumerate(_entries(section), 1):
            if listed.key != str(expected):
                text = f"[{section.name}] continues with {short(listed.key)!r}, but {expected} is expected"
                yield _at_key(context, listed, text)
                break


@finds("L009")
def no_objects(context: RuleContext) -> Iterator[Hit]:
    """L009."""
    for listed in _all(context):
        if listed.target is None:
            text = f"[{listed.section.name}] {listed.key}={short(listed.text)} is not an index of an object"
            yield context.at(listed.section, listed.key, text)


@finds("L005")
def not_described(context: RuleContext) -> Iterator[Hit]:
    """L005."""
    for section in _lists(context):
        unlisted = _unlisted(context, section)
        hint = (
            f"; {unlisted[0]:04X} may be meant"
            if len(unlisted) == 1 == _misspelt_count(context, section)
            else ""
        )
        for listed in _entries(section):
            if listed.target is not None and listed.target not in context.eds:
                text = f"[{section.name}] names {listed.target:04X}, but there is no section [{listed.target:04X}]"
                yield context.at(section, listed.key, text + hint, listed.target)


@finds("L006")
def not_listed(context: RuleContext) -> Iterator[Hit]:
    """L006."""
    for section in _lists(context):
        unlisted = _unlisted(context, section)
        if len(unlisted) == 1 == _misspelt_count(context, section):
            continue  # the one wrong entry of the list is the cause; L005, L007 or L009 reports it
        for index in unlisted:
            head = context.heads[index]
            yield context.at(head, "", f"[{head.name}] is described, but in no list of objects", index)


def _unlisted(context: RuleContext, section: Section) -> list[int]:
    """Return the objects that belong in a list, but are in none."""
    listed = {each.target for each in _all(context)}
    name = section.name.lower()
    return [
        index
        for index in context.heads
        if index >= FIRST_OBJECT and index not in listed and list_of(index) == name
    ]


def _misspelt_count(context: RuleContext, section: Section) -> int:
    """Return the number of entries that are no object of the file, or that repeat an earlier entry."""
    seen: set[int] = set()
    misspelt = 0
    for listed in _entries(section):
        if listed.target is None or listed.target in seen or listed.target not in context.eds:
            misspelt += 1
        else:
            seen.add(listed.target)
    return misspelt


@finds("L007")
def listed_twice(context: RuleContext) -> Iterator[Hit]:
    """L007."""
    first: dict[int, Listed] = {}
    for listed in _all(context):
        if listed.target is None:
            continue
        before = first.setdefault(listed.target, listed)
        if before is not listed:
            line, _ = context.document.location(before.section, before.key)
            text = f"{listed.target:04X} is in a list already, in line {line}"
            yield context.at(listed.section, listed.key, text, listed.target)


@finds("L008")
def wrong_list(context: RuleContext) -> Iterator[Hit]:
    """L008."""
    for listed in _all(context):
        name = listed.section.name.lower()
        if listed.target is None or name == "mandatoryobjects":
            continue  # a profile or a maker may define more mandatory objects
        proper = list_of(listed.target)
        if proper != name:
            text = f"{listed.target:04X} is in [{listed.section.name}], it belongs to [{LISTS[proper]}]"
            yield context.at(listed.section, listed.key, text, listed.target)


def _lists(context: RuleContext) -> Iterator[Section]:
    for name in LISTS:
        section = context.section(name)
        if section is not None:
            yield section


def _entries(section: Section) -> Iterator[Listed]:
    for key, text in section.entries.items():
        if key[:1].isdigit():
            index = values.plain(text)
            yield Listed(section, key, text, index if index is not None and 0 < index <= 0xFFFF else None)


def _all(context: RuleContext) -> Iterator[Listed]:
    for section in _lists(context):
        yield from _entries(section)


def _at_key(context: RuleContext, listed: Listed, message: str) -> Hit:
    line, _ = context.document.location(listed.section, listed.key)
    return Hit(line, 1, message, listed.target)


# -- CompactSubObj, [xxxxName], [xxxxValue], [xxxxDenotation] and [xxxxObjectLinks] (DS 306 4.6.3.2, 4.6.4) ----------------

_COUNTED = ("name", "value", "denotation")
_LINKS = "objectlinks"


@finds("B001")
def both_forms(context: RuleContext) -> Iterator[Hit]:
    """B001."""
    for index, head in context.heads.items():
        count = values.plain(head.entries.get("compactsubobj", ""))
        if count and values.plain(head.entries.get("subnumber", "")):
            which = "; its sub-indices are described one by one" if index in context.subs else ""
            text = f"[{head.name}] has SubNumber beside CompactSubObj={count}{which}"
            yield context.at(head, "subnumber", text, index)


@finds("B002")
def compact_counts(context: RuleContext) -> Iterator[Hit]:
    """B002."""
    for (index, kind), section in context.reading.parts.list_sections.items():
        if kind in _COUNTED:
            yield from context.miscounted(section, "NrOfEntries", index)


@finds("B003")
def link_counts(context: RuleContext) -> Iterator[Hit]:
    """B003."""
    for (index, kind), section in context.reading.parts.list_sections.items():
        if kind == _LINKS:
            yield from context.miscounted(section, "ObjectLinks", index)


@finds("B004")
def link_targets(context: RuleContext) -> Iterator[Hit]:
    """B004."""
    for (index, kind), section in context.reading.parts.list_sections.items():
        for key, text in section.entries.items() if kind == _LINKS else ():
            target = values.plain(text)
            if key[:1].isdigit() and target not in context.eds.objects:
                yield context.at(
                    section,
                    key,
                    f"[{section.name}] links to {short(text)}, which the file does not describe",
                    index,
                )


@finds("O013")
def names_beyond(context: RuleContext) -> Iterator[Hit]:
    """O013, for names; the reader reports it for values and denotations."""
    for (index, kind), section in context.reading.parts.list_sections.items():
        head = context.heads.get(index)
        count = values.plain(head.entries.get("compactsubobj", "")) if head is not None else None
        for key in section.entries if kind == "name" and count else ():
            number = values.plain(key)
            if key != "nrofentries" and (number is None or number > (count or 0)):
                yield context.at(section, key, f"[{section.name}] names sub-index {short(key, 20)}", index)


@finds("B005")
def foreign_lists(context: RuleContext) -> Iterator[Hit]:
    """B005."""
    for (index, _), section in context.reading.parts.list_sections.items():
        if index not in context.heads:
            yield context.at(
                section, "", f"[{section.name}] belongs to [{index:04X}], which is not there", index
            )
