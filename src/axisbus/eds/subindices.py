"""Determine which sub-index of an object is probably missing, from the object's own counts."""

from __future__ import annotations

from axisbus.eds.io import values
from axisbus.eds.io.compact import MAX_ENTRIES
from axisbus.eds.io.text import Section
from axisbus.eds.model import Number, Object

STRUCTURE = 0xFF  # sub-index FFh holds the object's own type and size (CiA 301 7.4.4), and is not counted


def is_compact(head: Section) -> bool:
    """Whether an object uses CompactSubObj, even if its number is not valid."""
    given = head.entries.get("compactsubobj", "")
    return bool(given) and values.plain(given) != 0


def count_of(entry: Object) -> int | None:
    """Return the default of sub-index 0, None if it is no number."""
    count = entry.subs.get(0)
    return count.default.value if count is not None and isinstance(count.default, Number) else None


def one_is_missing(head: Section, there: int) -> bool:
    """Whether SubNumber counts one sub-index more than the ``there`` that have a section."""
    return values.plain(head.entries.get("subnumber", "")) == there + 1


def missing(entry: Object, head: Section, there: int) -> int | None:
    """Return the sub-index whose section is missing; None unless SubNumber and sub-index 0 leave only one possibility.

    ``there`` is the number of sub-indices that have a section.
    """
    if not one_is_missing(head, there):
        return None
    if 0 not in entry.subs:
        return 0
    highest = min(count_of(entry) or 0, MAX_ENTRIES)  # the file may contain any number
    absent = [sub for sub in range(1, highest + 1) if sub not in entry.subs]
    return absent[0] if len(absent) == 1 else None
