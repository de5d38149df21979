"""Fixes of names: sections, keys and words in the standard's spelling."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from axisbus.eds.fixes.base import Fix, FixContext, Mend, each
from axisbus.eds.io import edit
from axisbus.eds.io.build import ACCESS_TYPES
from axisbus.eds.io.text import Section
from axisbus.eds.model import EdsFinding

LISTS = ("mandatoryobjects", "optionalobjects", "manufacturerobjects")
_ZEROS = re.compile(r"(?i)sub0+(?=[0-9a-f])")
_RATE = re.compile(r"baudrate_[0-9]+")
_RATE_AS_PRINTED = re.compile(r"\s*BaudRate_")


def _commissioning(bench: FixContext, finding: EdsFinding) -> Fix | None:
    """Fix K001."""
    return _renamed(bench, "K001", bench.section_at(finding.line), "DeviceComissioning")


def _leading_zeros(bench: FixContext, finding: EdsFinding) -> Fix | None:
    """Fix O012."""
    section = bench.section_at(finding.line)
    return _renamed(bench, "O012", section, _ZEROS.sub(lambda found: found[0][:3], section.name))


def _renamed(bench: FixContext, rule: str, section: Section, name: str) -> Fix | None:
    if name.lower() in bench.document.sections:
        return None
    change = edit.rename_section(bench.document, section, name)
    return Fix(rule, section.line, f"[{section.name}] -> [{name}]", (change,))


def _access(bench: FixContext) -> Iterator[Fix]:
    """Fix O019."""
    for section in bench.reading.parts.described():
        given = section.entries.get("accesstype", "")
        if given.lower() in ACCESS_TYPES and not given.islower():
            change = edit.set_value(bench.document, section, "accesstype", given.lower())
            line = section.places["accesstype"]
            yield Fix("O019", line, f"[{section.name}] {given} -> {given.lower()}", (change,))


def _baud_rates(bench: FixContext) -> Iterator[Fix]:
    """Fix D012."""
    device = bench.document.sections.get("deviceinfo")
    for key, line in device.places.items() if device is not None else ():
        if _RATE.fullmatch(key) and not _RATE_AS_PRINTED.match(bench.document.lines[line - 1]):
            new = key.replace("baudrate", "BaudRate")
            yield Fix("D012", line, f"-> {new}", (edit.rename_key(bench.document, line, new),))


def _supported_objects(bench: FixContext) -> Iterator[Fix]:
    """Fix S017, if the key differs only by spaces, ``_`` or ``-``."""
    for name in LISTS:
        section = bench.document.sections.get(name)
        if section is None or "supportedobjects" in section.entries:
            continue
        for key, line in section.places.items():
            if re.sub(r"[ _-]", "", key) == "supportedobjects":
                change = edit.rename_key(bench.document, line, "SupportedObjects")
                yield Fix("S017", line, f"[{section.name}] {key[:40]} -> SupportedObjects", (change,))
                break


MENDS: Mapping[str, Mend] = {
    "D012": _baud_rates,
    "K001": each("K001", _commissioning),
    "O012": each("O012", _leading_zeros),
    "O019": _access,
    "S017": _supported_objects,
}
