"""The sections of an EDS sorted by their contents: objects, their sub-indices, lists beside them, and others."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from axisbus.eds.io.findings import Findings
from axisbus.eds.io.text import Section

MAX_SUBINDEX = 0xFF

_OBJECT = re.compile(r"([0-9a-f]{4})(?:sub(0*)([0-9a-f]{1,2}))?")
_INDEX = re.compile(r"[0-9a-f]{4}")
_SUBINDICES = {
    f"{number:x}": number for number in range(MAX_SUBINDEX + 1)
}  # in the spelling of nearly all files
_LIST_SECTION = re.compile(r"([0-9a-f]{4})(name|value|denotation|objectlinks)")
_KNOWN = re.compile(
    r"fileinfo|deviceinfo|dummyusage|comments|mandatoryobjects|optionalobjects|manufacturerobjects"
    r"|devicecomm?issioning|standarddatatypes|dynamicchannels|tools|tool[0-9]+"
    r"|supportedmodules|connectedmodules|m[0-9]+(?:moduleinfo|comments|fixedobjects|subextends)"
    r"|m[0-9]+(?:fixed[0-9a-f]{4}(?:sub[0-9a-f]+)?|subext[0-9a-f]{4})"
    r"|[0-9a-f]{2,3}(?:sub[0-9a-f]+)?"  # types that CanFestival's editor defines, such as [A0sub1]
)
_TYPE = re.compile(r"0*[0-9a-f]{1,4}")


class Info(Mapping[str, Mapping[str, str]]):
    """The entries of the sections that are no objects, by lower-case name; a section is parsed on access."""

    def __init__(self, sections: Mapping[str, Section]) -> None:
        self._sections = sections

    def __getitem__(self, name: str) -> Mapping[str, str]:
        return self._sections[name].entries

    def __contains__(self, name: object) -> bool:
        return name in self._sections

    def __iter__(self) -> Iterator[str]:
        return iter(self._sections)

    def __len__(self) -> int:
        return len(self._sections)


@dataclass(frozen=True, slots=True)
class SectionIndex:
    """Sections by index and sub-index; ``list_sections`` holds ``[xxxxName]`` and similar sections as (index, ``name``).

    ``duplicates`` are sections of a sub-index that already has a section in another spelling, each with the first one.
    """

    heads: Mapping[int, Section]
    subs: Mapping[int, Mapping[int, Section]]
    list_sections: Mapping[tuple[int, str], Section]
    types: Mapping[int, Section]
    info: Info
    duplicates: tuple[tuple[Section, Section], ...] = ()

    def described(self) -> Iterator[Section]:
        """Yield the sections of all objects, then those of all sub-indices."""
        yield from self.heads.values()
        for subs in self.subs.values():
            yield from subs.values()


class _Indices(dict[str, int | None]):
    """Numbers by their four digits, None for other texts; cached, because sub-indices repeat the digits of their object."""

    def __missing__(self, digits: str) -> int | None:
        self[digits] = index = int(digits, 16) if _INDEX.fullmatch(digits) else None
        return index


def sort(sections: Mapping[str, Section]) -> SectionIndex:
    """Sort the sections of a document by their (lower-case) names; unknown ones are stored as information."""
    heads: dict[int, Section] = {}
    subs: dict[int, dict[int, Section]] = {}
    types: dict[int, Section] = {}
    other: dict[str, Section] = {}
    duplicates: list[tuple[Section, Section]] = []
    indices = _Indices()
    for name, section in sections.items():
        digits, is_sub, number = name.partition("sub")
        index = indices[digits]
        if index is not None and not is_sub:
            heads[index] = section
            continue
        subindex = _SUBINDICES.get(number)
        if subindex is None:
            subindex = _without_leading_zeros(number)
        if index is None or subindex is None:
            other[name] = section
        else:
            first = subs.setdefault(index, {}).setdefault(subindex, section)
            if first is not section:
                duplicates.append((section, first))
        if number == "1":
            _note_type(digits, section, types)
    return SectionIndex(heads, subs, _list_sections(other), types, Info(other), tuple(duplicates))


def _without_leading_zeros(number: str) -> int | None:
    return _SUBINDICES.get(number.lstrip("0") or "0") if number else None


def _note_type(digits: str, section: Section, types: dict[int, Section]) -> None:
    if _TYPE.fullmatch(digits):
        types[int(digits, 16)] = section


def _list_sections(other: Mapping[str, Section]) -> dict[tuple[int, str], Section]:
    """Return the sections of lists beside an object, by its index and the kind of list."""
    listed = ((_LIST_SECTION.fullmatch(name), section) for name, section in other.items())
    return {(int(found[1], 16), found[2]): section for found, section in listed if found is not None}


def report(sections: Mapping[str, Section], parts: SectionIndex, findings: Findings) -> None:
    """Report the oddities of the sections' names."""
    duplicates = dict(parts.duplicates)
    for name, section in sections.items():
        found = _OBJECT.fullmatch(name)
        if found is None:
            if _LIST_SECTION.fullmatch(name) is None and _KNOWN.fullmatch(name) is None:
                findings.add("S012", f"section [{section.name[:60]}] is not of DS 306", line=section.line)
        elif found[2] or section in duplicates:
            _report_sub(found, section, duplicates.get(section), findings)


def _report_sub(found: re.Match[str], section: Section, first: Section | None, findings: Findings) -> None:
    index, subindex = int(found[1], 16), int(found[3], 16)
    if found[2]:
        text = f"[{section.name}] has leading zeros"
        findings.add("O012", text, line=section.line, index=index, subindex=subindex)
    if first is not None:
        text = f"[{section.name}] and [{first.name}] (line {first.line}) are the same sub-index"
        findings.add("S003", text, line=section.line, index=index, subindex=subindex)
