"""Rules for the text itself: lines, spaces, comments and keys (DS 306 4.2)."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Iterator, Mapping
from functools import lru_cache

from axisbus.eds.io.text import Section
from axisbus.eds.model import DEVICE_NUMBERS, Severity
from axisbus.eds.rules.context import DEVICE_INFO, FILE_INFO, LISTS, Hit, RuleContext, finds
from axisbus.wording import counted

MAX_LINE = 255
_MAX_FOREIGN = 200  # different keys; the search for similar keys is slow

_CONTROL = re.compile(r"[\x00-\x08\x0b\x0c\x0e-\x1f\x7f]")
_SPACED_KEY = re.compile(r"[^;\[\s=][^=]*?(\s+)=")
_OTHER_MARKS = ("#", "/", "*", "'")
_INDENTED_COMMENT = re.compile(r"\s+;")

# Keys of DS 306 4.6.3.2 and 5, with those of its later drafts and of CiA 304.
OBJECT_KEYS = frozenset(
    (
        *("parametername", "objecttype", "datatype", "accesstype", "defaultvalue", "pdomapping"),
        *("lowlimit", "highlimit", "objflags", "subnumber", "compactsubobj"),
        *("parametervalue", "denotation", "uploadfile", "downloadfile"),
        *("noderefd", "netrefd", "paramrefd", "srdomapping", "invertedsrad"),
    )
)
FILE_KEYS = frozenset(
    (
        *("filename", "fileversion", "filerevision", "edsversion", "description", "lasteds"),
        *("creationtime", "creationdate", "createdby"),
        *("modificationtime", "modificationdate", "modifiedby"),
    )
)

# Keys of older versions: no longer in use, but no mistake (DS 306 4.5). Keys that begin with LMT_ are old, too.
RESERVED_DEVICE_KEYS = frozenset(
    ("productversion", "productrevision", "extendedbootupmaster", "extendedbootupslave")
)
DEVICE_KEYS = frozenset(
    (
        *("vendorname", "productname", "ordercode"),
        *(name.lower() for name in DEVICE_NUMBERS),
    )
)
_MANDATORY = frozenset(("parametername", "datatype", "accesstype", "subnumber", "supportedobjects"))
_KEYS: Mapping[str, frozenset[str]] = {
    FILE_INFO: FILE_KEYS,
    DEVICE_INFO: DEVICE_KEYS | RESERVED_DEVICE_KEYS,
    **dict.fromkeys(LISTS, frozenset(("supportedobjects",))),
}


@finds("S007")
def long_lines(context: RuleContext) -> Iterator[Hit]:
    """S007."""
    if len(max(context.document.lines, key=len)) <= MAX_LINE:
        return
    long = [
        number for number, line in enumerate(context.document.lines, 1) if len(line.rstrip("\r")) > MAX_LINE
    ]
    if long:
        length = len(context.document.lines[long[0] - 1].rstrip("\r"))
        yield Hit(long[0], MAX_LINE + 1, f"the line has {counted(length, 'character')}{_and_more(long)}")


@finds("S008")
def spaced_keys(context: RuleContext) -> Iterator[Hit]:
    """S008."""
    found = _matches(context, _SPACED_KEY, " =", "\t=")
    if found:
        number, match = found[0]
        yield Hit(number, match.start(1) + 1, f"there is a space before the equals sign{_and_more(found)}")


@finds("S013")
def indented_comments(context: RuleContext) -> Iterator[Hit]:
    """S013."""
    found = _matches(context, _INDENTED_COMMENT, " ;", "\t;")
    if found:
        number, match = found[0]
        yield Hit(number, match.end(), f"the comment is indented{_and_more(found)}")


@finds("S014")
def old_line_ends(context: RuleContext) -> Iterator[Hit]:
    """S014."""
    if context.document.newline == "\r" and len(context.document.lines) > 1:
        yield Hit(1, 1, "the lines end in CR alone")


@finds("S015")
def mixed_line_ends(context: RuleContext) -> Iterator[Hit]:
    """S015."""
    if "\r" not in context.text:
        return
    lines = context.document.lines[:-1]  # the text after the last line end has none
    carriage = [number for number, line in enumerate(lines, 1) if line.endswith("\r")]
    if not carriage or len(carriage) == len(lines):
        return
    bare = [number for number, line in enumerate(lines, 1) if not line.endswith("\r")]
    fewer, kind = (carriage, "CR LF") if len(carriage) <= len(bare) else (bare, "LF")
    yield Hit(fewer[0], 1, f"the line ends in {kind}, most others do not{_and_more(fewer)}")


@finds("S018")
def control_characters(context: RuleContext) -> Iterator[Hit]:
    """S018."""
    if _CONTROL.search(context.text) is None:
        return
    found = [
        (number, match)
        for number, line in enumerate(context.document.lines, 1)
        if not line.isprintable() and (match := _CONTROL.search(line.rstrip("\r")))
    ]
    if found:
        number, match = found[0]
        yield Hit(number, match.start() + 1, f"the control character {ord(match[0]):02X}h{_and_more(found)}")


@finds("S016")
def unknown_keys(context: RuleContext) -> Iterator[Hit]:
    """S016."""
    seen: dict[str, list[Section]] = {}
    for section, key in _foreign_keys(context):
        if not _meant(key, _keys_of(section)):
            seen.setdefault(key, []).append(section)
    for key, sections in seen.items():
        message = f"key {key[:40]!r} is not of DS 306{_and_more(sections)}"
        line, _ = context.document.location(sections[0], key)
        yield Hit(line, 1, message)


@finds("S017")
def misspelt_keys(context: RuleContext) -> Iterator[Hit]:
    """S017."""
    for section, key in _foreign_keys(context):
        meant = _meant(key, _keys_of(section))
        if meant and meant not in section.entries:
            line, _ = context.document.location(section, key)
            severity = None if meant in _MANDATORY else Severity.WARNING
            text = f"key {key[:40]!r} is not known, {meant!r} may be meant"
            yield Hit(line, 1, text, severity=severity)


def _foreign_keys(context: RuleContext) -> Iterator[tuple[Section, str]]:
    """Yield the keys that are not in DS 306, in sections whose keys the standard defines; only the first of very many."""
    seen: set[str] = set()
    for section, key in _all_foreign_keys(context):
        seen.add(key)
        if len(seen) > _MAX_FOREIGN:
            return
        yield section, key


def _all_foreign_keys(context: RuleContext) -> Iterator[tuple[Section, str]]:
    for name, known in _KEYS.items():
        section = context.section(name)
        if section is not None:
            for key in section.entries.keys() - known:
                if not _may_be_there(name, key):
                    yield section, key
    for section in context.reading.parts.described():
        if not section.entries.keys() <= OBJECT_KEYS:
            for key in section.entries:
                if key not in OBJECT_KEYS and not key.startswith(_OTHER_MARKS):
                    yield section, key


@finds("S019")
def other_comments(context: RuleContext) -> Iterator[Hit]:
    """S019."""
    found = [
        (section, key)
        for section in context.reading.parts.described()
        for key in section.entries
        if key.startswith(_OTHER_MARKS)
    ]
    if found:
        section, key = found[0]
        line, _ = context.document.location(section, key)
        text = f"{key[:40]!r} is commented out by {key[:1]!r}, and ';' is the mark{_and_more(found)}"
        yield Hit(line, 1, text)


def _may_be_there(name: str, key: str) -> bool:
    if name in LISTS:
        return key[:1].isdigit()
    return name == DEVICE_INFO and key.startswith(("baudrate", "lmt_"))  # D011 checks the rates


def _keys_of(section: Section) -> frozenset[str]:
    return _KEYS.get(section.name.lower(), OBJECT_KEYS)


@lru_cache(maxsize=512)
def _meant(key: str, known: frozenset[str]) -> str:
    """Return the known key that this one misspells, empty if none is similar."""
    bare = key.replace(" ", "").replace("_", "").replace("-", "")
    if bare in known:
        return bare
    near = difflib.get_close_matches(key[:40], sorted(known), n=1, cutoff=0.85)
    return near[0] if near else ""


def _matches(
    context: RuleContext, pattern: re.Pattern[str], part: str, other: str
) -> list[tuple[int, re.Match[str]]]:
    """Return the lines that match ``pattern``; they must contain ``part`` or ``other``, which is a quick test."""
    if part not in context.text and other not in context.text:
        return []
    return [
        (number, match)
        for number, line in enumerate(context.document.lines, 1)
        if (part in line or other in line) and (match := pattern.match(line))
    ]


def _and_more(found: Iterable[object]) -> str:
    """Return ``, and 3 more`` for a finding that represents several."""
    others = len(list(found)) - 1
    return f", and {others} more like it" if others else ""
