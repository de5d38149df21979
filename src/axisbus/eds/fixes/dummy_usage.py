"""Fixes of [DummyUsage]: keys of four digits, and an entry for each data type that can fill space in a PDO (DS 306 4.6.2)."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

from axisbus.eds.fixes.base import Fix, FixContext, Mend
from axisbus.eds.io import edit, values
from axisbus.eds.model import DUMMIES

_SHORT = re.compile(r"dummy([0-9a-f]{1,3})")


def _short_keys(bench: FixContext) -> Iterator[Fix]:
    """Fix D016, if the complete key does not exist in another spelling."""
    section = bench.document.sections.get("dummyusage")
    if section is None:
        return
    taken = set(section.entries)
    for key, line in section.places.items():
        found = _SHORT.fullmatch(key)
        if found is None or (name := f"Dummy{int(found[1], 16):04X}").lower() in taken:
            continue
        taken.add(name.lower())
        change = edit.rename_key(bench.document, line, name)
        yield Fix("D016", line, f"[{section.name}] {key.capitalize()} -> {name}", (change,))


def _left_out(bench: FixContext) -> Iterator[Fix]:
    """Fix D019: a missing entry means 0."""
    section = bench.document.sections.get("dummyusage")
    if section is None or any(values.plain(text) is None for text in section.entries.values()):
        return  # D016: an unknown entry
    absent = {
        name: "0" for number in DUMMIES if (name := f"Dummy{number:04X}").lower() not in section.entries
    }
    if absent:
        changes = tuple(edit.set_values(bench.document, section, absent))
        yield Fix("D019", section.line, f"[{section.name}] {', '.join(absent)} added as 0", changes)


NAMES: Mapping[str, Mend] = {"D016": _short_keys}
MENDS: Mapping[str, Mend] = {"D019": _left_out}
