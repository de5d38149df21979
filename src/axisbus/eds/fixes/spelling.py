"""Fixes of names: sections, keys and words in the standard's spelling."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from axisbus.eds.fixes.base import Fix, FixContext, FixFunction, each
from axisbus.eds.io import edit
from axisbus.eds.io.build import ACCESS_TYPES
from axisbus.eds.io.text import Section
from axisbus.eds.model import EdsFinding

LISTS = ("mandatoryobjects", "optionalobjects", "manufacturerobjects")
_ZEROS = re.compile(r"(?i)sub0+(?=[0-9a-f])")
_RATE = re.compile(r"baudrate_[0-9]+")
_RATE_AS_PRINTED = re.compile(r"\s*BaudRate_")


def _commissioning(context: FixContext, finding: EdsFinding) -> Fix | None:
    """Fix K001."""
    return _renamed(context, "K001", context.section_at(finding.line), "DeviceComissioning")


def _leading_zeros(context: FixContext, finding: EdsFinding) -> Fix | None:
    """Fix O012."""
    section = context.section_at(finding.line)
    return _renamed(context, "O012", section, _ZEROS.sub(lambda found: found[0][:3], section.name))


def _renamed(context: FixContext, rule: str, section: Section, name: str) -> Fix | None:
    if name.lower() in context.document.sections:
        return None
    change = edit.rename_section(context.document, section, name)
    return Fix(rule, section.line, f"[{section.name}] -> [{name}]", (change,))


def _access(context: FixContext) -> Iterator[Fix]:
    """Fix O019."""
    for section in context.reading.parts.described():
        given = section.entries.get("accesstype", "")
        if given.lower() in ACCESS_TYPES and not given.islower():
            change = edit.set_value(context.document, section, "accesstype", given.lower())
            line = section.line_numbers["accesstype"]
            yield Fix("O019", line, f"[{section.name}] {given} -> {given.lower()}", (change,))


def _baud_rates(context: FixContext) -> Iterator[Fix]:
    """Fix D012."""
    device = context.document.sections.get("deviceinfo")
    for key, line in device.line_numbers.items() if device is not None else ():
        if _RATE.fullmatch(key) and not _RATE_AS_PRINTED.match(context.document.lines[line - 1]):
            new = key.replace("baudrate", "BaudRate")
            yield Fix("D012", line, f"-> {new}", (edit.rename_key(context.document, line, new),))


def _supported_objects(context: FixContext) -> Iterator[Fix]:
    """Fix S017, if the key differs only by spaces, ``_`` or ``-``."""
    for name in LISTS:
        section = context.document.sections.get(name)
        if section is None or "supportedobjects" in section.entries:
            continue
        for key, line in section.line_numbers.items():
            if re.sub(r"[ _-]", "", key) == "supportedobjects":
                change = edit.rename_key(context.document, line, "SupportedObjects")
                yield Fix("S017", line, f"[{section.name}] {key[:40]} -> SupportedObjects", (change,))
                break


FIXES: Mapping[str, FixFunction] = {
    "D012": _baud_rates,
    "K001": each("K001", _commissioning),
    "O012": each("O012", _leading_zeros),
    "O019": _access,
    "S017": _supported_objects,
}
