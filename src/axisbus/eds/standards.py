"""What CiA 301 and CiA 402 say of an entry, in one line for a person."""

from __future__ import annotations

import re
from functools import cache

from axisbus.cia301 import objects as cia301
from axisbus.cia402 import objects as cia402
from axisbus.cia402.axes import first_axis
from axisbus.eds.model import Variable

_Rows = dict[tuple[int, int], tuple[str, dict[str, str]]]
_Ranges = list[tuple[range, range, dict[str, str]]]


def standard_words(index: int, subindex: int) -> str:
    """Return such as ``CiA 402: Statusword, UNSIGNED16, ro, TPDO, mandatory``; empty where the standards say nothing."""
    found = _row(index, subindex)
    return _words(*found) if found is not None else ""


def agrees(entry: Variable) -> bool:
    """Whether type and access are those of the standard (a constant counts as read-only), or the standard says nothing."""
    found = _row(entry.index, entry.subindex)
    if found is None:
        return True
    row = found[1]
    access = "ro" if entry.access == "const" else entry.access[:2]
    return entry.data_type.name in re.split(r"\W+", row["data_type"]) and access in (
        "ro" if each == "const" else each for each in row["access"].split("/")
    )


def _row(index: int, subindex: int) -> tuple[str, dict[str, str]] | None:
    exact, ranges = _tables()
    found = exact.get((first_axis(index), subindex))
    if found is None:
        rows = [row for indices, subs, row in ranges if index in indices and subindex in subs]
        found = ("CiA 301", rows[0]) if rows else None
    return found


def _words(title: str, row: dict[str, str]) -> str:
    mapping = row["pdo_mappable"] if row["pdo_mappable"] != "no" else ""
    category = row["category"].partition(":")[0]
    used = row.get("modes", "").split()
    in_modes = f"modes {' '.join(used)}" if used and used != ["all"] else ""
    parts = [row["name"], row["data_type"], row["access"], mapping, category, in_modes]
    return f"{title}: " + ", ".join(part for part in parts if part)


@cache
def _tables() -> tuple[_Rows, _Ranges]:
    exact: _Rows = {}
    ranges: _Ranges = []
    for title, rows in (("CiA 301", cia301.table()), ("CiA 402", cia402.table())):
        for row in rows:
            if row["object_type"].startswith(("ARRAY", "RECORD")):
                continue
            indices, subs = _range(row["index"]), _range(row["subindex"] or "0")
            if len(indices) == len(subs) == 1:
                exact[indices[0], subs[0]] = (title, row)
            else:
                ranges.append((indices, subs, row))
    return exact, ranges


def _range(text: str) -> range:
    low, _, high = text.partition("-")
    return range(int(low, 16), int(high or low, 16) + 1)
