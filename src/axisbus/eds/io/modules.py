"""The modules that a device may have (DS 306 6), and its dynamic channels, as an EDS describes them."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from axisbus.cia301.datatypes import DataType
from axisbus.eds.io import sections, values
from axisbus.eds.io.build import EdsObjectBuilder
from axisbus.eds.io.findings import Findings
from axisbus.eds.io.sections import SectionIndex
from axisbus.eds.io.text import EdsText, Section
from axisbus.eds.model import DynamicChannel, Module, Object, ObjectType, SubExtension

MAX_SEGMENTS = 0xFF  # NrOfSeg is UNSIGNED8
MAX_CONNECTED = 127  # entries of 1027h

_SECTION = re.compile(
    r"m([0-9]{1,5})(?:(moduleinfo|comments|fixedobjects|subextends)|fixed([0-9a-f]{4}(?:sub[0-9a-f]+)?)|subext([0-9a-f]{4}))"
)
_NOTHING: Mapping[str, str] = {}


class _Parts(NamedTuple):
    """The sections of one module: lists by name, objects and extensions by the part of the name after the prefix."""

    lists: dict[str, Section]
    fixed: dict[str, Section]
    extends: dict[int, Section]


def modules(document: EdsText, findings: Findings | None = None) -> dict[int, Module]:
    """Return the kinds of module by number; problems of their objects go to ``findings``."""
    found: dict[int, _Parts] = {}
    for name in [name for name in document.sections if name[:1] == "m"]:
        match, section = _SECTION.fullmatch(name), document.sections[name]
        if match is not None:
            parts = found.setdefault(int(match[1]), _Parts({}, {}, {}))
            if match[2]:
                parts.lists[match[2]] = section
            elif match[3]:
                parts.fixed[match[3]] = section
            else:
                parts.extends[int(match[4], 16)] = section
    return {number: _module(number, found[number], document, findings) for number in sorted(found)}


def _module(number: int, parts: _Parts, document: EdsText, findings: Findings | None) -> Module:
    comments = _entries(parts, "comments")
    return Module(
        number,
        dict(_entries(parts, "moduleinfo")),
        _fixed(parts, document, findings),
        _extends(parts, document, findings),
        tuple(text for _, text in _numbered(comments, "line")),
    )


def _fixed(parts: _Parts, document: EdsText, findings: Findings | None) -> dict[int, Object | None]:
    described = sections.sort(parts.fixed)
    builder = EdsObjectBuilder(document, described, findings)
    indices = described.heads.keys() | described.subs.keys()
    listed = _indices(_entries(parts, "fixedobjects"))
    return {index: builder.object(index) if index in indices else None for index in sorted(indices | listed)}


def _extends(parts: _Parts, document: EdsText, findings: Findings | None) -> dict[int, SubExtension | None]:
    builder = EdsObjectBuilder(document, SectionIndex({}, {}, {}, {}, sections.Info({})), findings)
    listed = _indices(_entries(parts, "subextends"))
    found: dict[int, SubExtension | None] = dict.fromkeys(sorted(parts.extends.keys() | listed))
    for index, section in parts.extends.items():
        found[index] = _extension(index, section, builder)
    return found


def _extension(index: int, section: Section, builder: EdsObjectBuilder) -> SubExtension:
    name = section.entries.get("parametername", section.name)
    variable = builder.variable(section, index, 0, name, ObjectType.VAR)
    count, _, bits = section.entries.get("count", "").partition(";")
    extend = section.entries.get("objextend", "")
    return SubExtension(variable, *(values.plain(text.strip()) or 0 for text in (count, bits, extend)))


def connected(document: EdsText) -> tuple[int, ...]:
    """Return the numbers of the modules that the device has according to a DCF, in the order of their positions."""
    section = document.sections.get("connectedmodules")
    listed = _numbered(section.entries if section is not None else _NOTHING, "")
    numbers = [values.plain(text) for _, text in sorted(listed)][:MAX_CONNECTED]
    return tuple(number for number in numbers if number is not None)


def dynamic_channels(document: EdsText) -> tuple[DynamicChannel, ...]:
    """Return the valid segments of [DynamicChannels]."""
    section = document.sections.get("dynamicchannels")
    if section is None:
        return ()
    count = min(values.plain(section.entries.get("nrofseg", "")) or 0, MAX_SEGMENTS)
    return tuple(
        channel
        for number in range(1, count + 1)
        if (channel := _channel(section.entries, number)) is not None
    )


def _channel(entries: Mapping[str, str], number: int) -> DynamicChannel | None:
    data_type, access, indices, offsets = (
        entries.get(f"{key}{number}", "") for key in ("type", "dir", "range", "ppoffset")
    )
    first, _, last = indices.partition("-")
    start, stop = values.plain(first.strip()), values.plain(last.strip() or first.strip())
    kind = values.plain(data_type) or 0
    if start is None or stop is None or not 0 <= start <= stop <= 0xFFFF or not 0 < kind <= 0xFFFF:
        return None
    offset, _, step = (text.strip() for text in offsets.partition(","))
    return DynamicChannel(
        DataType(kind), access.lower(), range(start, stop + 1), values.plain(offset) or 0, values.plain(step)
    )


def _entries(parts: _Parts, name: str) -> Mapping[str, str]:
    section = parts.lists.get(name)
    return _NOTHING if section is None else section.entries


def _indices(entries: Mapping[str, str]) -> set[int]:
    found = (values.plain(text) for _, text in _numbered(entries, ""))
    return {index for index in found if index is not None and 0 <= index <= 0xFFFF}


def _numbered(entries: Mapping[str, str], prefix: str) -> Iterator[tuple[int, str]]:
    """Return number and text of the keys ``1``, ``2``, … with ``prefix`` before the number."""
    for key, text in entries.items():
        digits = key.removeprefix(prefix)
        if key.startswith(prefix) and digits.isascii() and digits.isdecimal() and len(digits) < 6:
            yield int(digits), text
