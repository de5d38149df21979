"""The catalogue of all objects of CiA 301 and CiA 402, for communication and for every axis."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from itertools import groupby

from axisbus.cia301.datatypes import DataType
from axisbus.cia301.tables import rows
from axisbus.cia402.axes import first_axis

CIA_301, CIA_402 = "CiA 301", "CiA 402"


@dataclass(frozen=True, slots=True)
class StandardObject:
    """One row of a standard: an object as a whole, or one of its entries; a field is empty if the standard leaves it open.

    Parameters with several instances, such as those of PDOs, share one row: then ``indices`` or ``subindices`` are several.
    ``subindices`` is empty for an ARRAY or RECORD as a whole. The type and access of an ARRAY are those of its elements, if all
    have the same. ``sure``: a different drive is wrong beyond doubt.
    """

    standard: str
    indices: range
    subindices: range
    name: str
    object_type: str  # VAR, ARRAY or RECORD
    type_text: str
    data_types: tuple[DataType, ...]  # all permitted types
    access_text: str
    access: frozenset[str]  # the permitted ones of ro, rw, wo and const
    mapping: str  # RPDO, TPDO or TPDO/RPDO
    category: str
    modes: tuple[str, ...]
    sure: bool

    @property
    def index(self) -> int:
        """The only index, or the first one."""
        return self.indices.start

    @property
    def subindex(self) -> int:
        """The only sub-index, or the first one; 0 for an object as a whole."""
        return self.subindices.start

    @property
    def single(self) -> bool:
        """Whether the row describes one object, not several of a kind."""
        return len(self.indices) == 1

    @property
    def data_type(self) -> DataType | None:
        """The data type; None if the standard has none for it, or permits several."""
        return DataType.__members__.get(self.type_text)

    @property
    def mandatory(self) -> bool:
        """Whether every device with the object has this entry."""
        return self.category == "mandatory"


def of(index: int) -> tuple[StandardObject, ...]:
    """Return the rows of an object of any axis, that of the whole object first; empty if the standards do not have it."""
    return _BY_INDEX.get(first_axis(index), ())


def whole(index: int) -> StandardObject | None:
    """Return the row of an object of any axis; None if the standards do not have it."""
    found = of(index)
    return found[0] if found else None


def entry(index: int, subindex: int) -> StandardObject | None:
    """Return the row of an entry of any axis; None if it has no row of its own."""
    for row in of(index):
        if subindex in row.subindices:
            return row
    return None


def name(index: int) -> str:
    """Return the name of an object; empty if the standards do not have it."""
    found = whole(index)
    return found.name if found is not None else ""


def named(text: str) -> tuple[int, int] | None:
    """Return index and sub-index of the object without sub-indices that has this name in any case; None if there is none."""
    return NAMES.get(text.strip().lower())


def _row(standard: str, line: Mapping[str, str]) -> StandardObject:
    object_type = line["object_type"].split()[0]
    return StandardObject(
        standard,
        _range(line["index"]),
        _range(line["subindex"] or "0") if object_type == "VAR" else range(0),
        line["name"],
        object_type,
        line["data_type"],
        _types(line["data_type"]),
        line["access"],
        frozenset(line["access"].split("/")) if line["access"] else frozenset(),
        "" if line["pdo_mappable"] == "no" else line["pdo_mappable"],
        line["category"],
        tuple(line.get("modes", "").split()),
        line.get("confidence", "H") == "H",
    )


def _types(text: str) -> tuple[DataType, ...]:
    """Read ``UNSIGNED32``, ``UNSIGNED8/16`` and ``INTEGER8 (some drives UNSIGNED8)``."""
    words: list[str] = re.findall(r"[A-Z_]+[0-9]*|(?<=/)[0-9]+", text)
    names = [word if not word.isdigit() else words[0].rstrip("0123456789") + word for word in words]
    return tuple(DataType[name] for name in names if name in DataType.__members__)


def _range(text: str) -> range:
    low, _, high = text.partition("-")
    return range(int(low, 16), int(high or low, 16) + 1)


# Read on import: an axis names objects inside the scan, which must not wait for a disk.
ROWS = tuple(
    _row(standard, line)
    for standard, package in ((CIA_301, "axisbus.cia301"), (CIA_402, "axisbus.cia402"))
    for line in rows(package, "objects.tsv")
)
_BY_INDEX = {
    index: found
    for indices, lines in groupby(ROWS, lambda row: row.indices)
    for found in [tuple(lines)]
    for index in indices
}
NAMES: Mapping[str, tuple[int, int]] = {
    row.name.lower(): (row.index, 0)
    for row in (found[0] for found in reversed(_BY_INDEX.values()))
    if row.subindices == range(1)
}
