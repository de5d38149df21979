"""The sections of an EDS sorted by what they describe: objects, their sub-indices, lists beside them, and everything else."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass

from axisbus.eds.findings import Findings
from axisbus.eds.text import Document, Section

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


@dataclass(frozen=True, slots=True)
class Sorted:
    """Sections by index and sub-index; ``beside`` holds ``[xxxxName]`` and its kin as (index, ``name``)."""

    heads: Mapping[int, Section]
    subs: Mapping[int, Mapping[int, Section]]
    beside: Mapping[tuple[int, str], Section]
    types: Mapping[int, Section]
    info: Mapping[str, Mapping[str, str]]


def sort(document: Document, findings: Findings) -> Sorted:
    """Sort a document's sections; unknown ones are kept as information and noted."""
    heads: dict[int, Section] = {}
    subs: dict[int, dict[int, Section]] = {}
    beside: dict[tuple[int, str], Section] = {}
    types: dict[int, Section] = {}
    info: dict[str, Mapping[str, str]] = {}
    for name, section in document.sections.items():
        found = _OBJECT.fullmatch(name)
        if found is None:
            _other(name, section, beside, info, findings)
        elif found[3] is None:
            heads[int(found[1], 16)] = section
        else:
            _sub(found, section, subs, findings)
        typed = _TYPE_SUB.fullmatch(name) if name.endswith("sub1") else None
        if typed is not None:
            types[int(typed[1], 16)] = section
    return Sorted(heads, subs, beside, types, info)


def _sub(
    found: re.Match[str], section: Section, subs: dict[int, dict[int, Section]], findings: Findings
) -> None:
    index, subindex = int(found[1], 16), int(found[3], 16)
    if found[2]:
        findings.add(
            "O012", f"[{section.name}] has leading zeros", line=section.line, index=index, subindex=subindex
        )
    first = subs.setdefault(index, {}).setdefault(subindex, section)
    if first is not section:
        text = f"[{section.name}] and [{first.name}] (line {first.line}) are the same sub-index"
        findings.add("S003", text, line=section.line, index=index, subindex=subindex)


def _other(
    name: str,
    section: Section,
    beside: dict[tuple[int, str], Section],
    info: dict[str, Mapping[str, str]],
    findings: Findings,
) -> None:
    found = _BESIDE.fullmatch(name)
    if found is not None:
        beside[int(found[1], 16), found[2]] = section
    info[name] = section.entries
    if found is None and _KNOWN.fullmatch(name) is None:
        findings.add("S012", f"section [{section.name[:60]}] is not of DS 306", line=section.line)
