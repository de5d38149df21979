"""The sections of an EDS sorted by what they describe: objects, their sub-indices, lists beside them, and everything else."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from axisbus.eds.io.findings import Findings
from axisbus.eds.io.text import Section

MAX_SUBINDEX = 0xFF

_OBJECT = re.compile(r"([0-9a-f]{4})(?:sub(0*)([0-9a-f]{1,2}))?")
_BESIDE = re.compile(r"([0-9a-f]{4})(name|value|denotation|objectlinks)")
_KNOWN = re.compile(
    r"fileinfo|deviceinfo|dummyusage|comments|mandatoryobjects|optionalobjects|manufacturerobjects"
    r"|devicecomm?issioning|standarddatatypes|dynamicchannels|tools|tool[0-9]+"
    r"|supportedmodules|connectedmodules|m[0-9]+(?:moduleinfo|comments|fixedobjects|subextends)"
    r"|m[0-9]+(?:fixed[0-9a-f]{4}(?:sub[0-9a-f]+)?|subext[0-9a-f]{4})"
    r"|[0-9a-f]{2,3}(?:sub[0-9a-f]+)?"  # types that CanFestival's editor defines, such as [A0sub1]
)
_TYPE_SUB = re.compile(r"0*([0-9a-f]{1,4})sub1")


class Info(Mapping[str, Mapping[str, str]]):
    """The entries of the sections that are no objects, by lower-case name; a section is taken apart when looked at."""

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
class Sorted:
    """Sections by index and sub-index; ``beside`` holds ``[xxxxName]`` and its kin as (index, ``name``).

    ``again`` are sections of a sub-index that has one already under another spelling, each with the first.
    """

    heads: Mapping[int, Section]
    subs: Mapping[int, Mapping[int, Section]]
    beside: Mapping[tuple[int, str], Section]
    types: Mapping[int, Section]
    info: Info
    again: tuple[tuple[Section, Section], ...] = ()

    def described(self) -> Iterator[Section]:
        """Yield the sections of all objects, then those of all sub-indices."""
        yield from self.heads.values()
        for subs in self.subs.values():
            yield from subs.values()


def sort(sections: Mapping[str, Section]) -> Sorted:
    """Sort the sections of a document by their (lower-case) names; unknown ones are kept as information."""
    heads: dict[int, Section] = {}
    subs: dict[int, dict[int, Section]] = {}
    beside: dict[tuple[int, str], Section] = {}
    types: dict[int, Section] = {}
    other: dict[str, Section] = {}
    again: list[tuple[Section, Section]] = []
    for name, section in sections.items():
        found = _OBJECT.fullmatch(name)
        if found is None:
            listed = _BESIDE.fullmatch(name)
            if listed is not None:
                beside[int(listed[1], 16), listed[2]] = section
            other[name] = section
        elif found[3] is None:
            heads[int(name, 16)] = section
        else:
            of_index = subs.setdefault(int(found[1], 16), {})
            first = of_index.setdefault(int(found[3], 16), section)
            if first is not section:
                again.append((section, first))
        typed = _TYPE_SUB.fullmatch(name) if name.endswith("sub1") else None
        if typed is not None:
            types[int(typed[1], 16)] = section
    return Sorted(heads, subs, beside, types, Info(other), tuple(again))


def report(sections: Mapping[str, Section], parts: Sorted, findings: Findings) -> None:
    """Name what is odd about the sections' names."""
    again = dict(parts.again)
    for name, section in sections.items():
        found = _OBJECT.fullmatch(name)
        if found is None:
            if _BESIDE.fullmatch(name) is None and _KNOWN.fullmatch(name) is None:
                findings.add("S012", f"section [{section.name[:60]}] is not of DS 306", line=section.line)
        elif found[2] or section in again:
            _report_sub(found, section, again.get(section), findings)


def _report_sub(found: re.Match[str], section: Section, first: Section | None, findings: Findings) -> None:
    index, subindex = int(found[1], 16), int(found[3], 16)
    if found[2]:
        text = f"[{section.name}] has leading zeros"
        findings.add("O012", text, line=section.line, index=index, subindex=subindex)
    if first is not None:
        text = f"[{section.name}] and [{first.name}] (line {first.line}) are the same sub-index"
        findings.add("S003", text, line=section.line, index=index, subindex=subindex)
