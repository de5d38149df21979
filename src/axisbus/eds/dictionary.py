"""The objects of a node as the master uses them: by the EDS, and for missing information by the standard.

For the objects of CiA 402, the standard's signedness takes precedence over the file's: many files define a target velocity as
unsigned, but negative velocities are real. The file's size takes precedence over the standard's, because the device decides how
many bytes it accepts.
"""

from __future__ import annotations

import difflib
import re
from dataclasses import dataclass

from axisbus.cia301.datatypes import DataType
from axisbus.cia402 import dictionary as catalogue
from axisbus.eds.model import Eds, Number, Variable
from axisbus.errors import ArgumentError

_ADDRESS = re.compile(
    r"(?:0x(?P<a>[0-9a-f]{1,4})|(?P<b>[0-9a-f]{4})h|(?P<c>[0-9][0-9a-f]{3}))(?:[:/.](?:0x)?(?P<sub>[0-9a-f]{1,2})h?)?",
    re.IGNORECASE,
)


@dataclass(frozen=True, slots=True)
class DictionaryEntry:
    """One object as the master uses it; ``data_type`` is None if neither file nor standard gives it; limits likewise."""

    index: int
    subindex: int
    name: str = ""
    data_type: DataType | None = None
    low: int | float | None = None
    high: int | float | None = None

    def __str__(self) -> str:
        where = f"{self.index:04X}h:{self.subindex:02X}"
        return f"{where} ({self.name})" if self.name else where


class Dictionary:
    """The objects of one node, from its EDS (None: only the standard's); frozen after construction."""

    def __init__(self, eds: Eds | None = None, node_id: int | None = None) -> None:
        self.eds = eds
        self._node_id = node_id

    def has(self, index: int, subindex: int = 0) -> bool | None:
        """Whether the EDS has the entry; None if there is no EDS."""
        return None if self.eds is None else self.eds.get(index, subindex) is not None

    def entry(self, index: int, subindex: int = 0) -> DictionaryEntry:
        """Return the known properties of an entry, even if none is known."""
        variable = self.eds.get(index, subindex) if self.eds is not None else None
        name, standard_type = standard(index, subindex)
        if variable is None:
            return DictionaryEntry(index, subindex, name, standard_type)
        data_type = merged_type(variable.data_type, standard_type)
        low, high = _limits(variable, data_type, self._node_id)
        return DictionaryEntry(index, subindex, variable.name or name, data_type, low, high)

    def resolve(self, key: int | str, subindex: int = 0) -> DictionaryEntry:
        """Return the entry of an index (0 to FFFFh) or a text.

        A text is a name of the EDS or of the standard (``"Profile velocity"``), or hexadecimal digits with an optional sub-index,
        also hexadecimal: ``"6081h"``, ``"0x6099:01"``.

        Raises:
            ArgumentError: no such name; the remedy names similar ones.
        """
        if isinstance(key, int):
            return self.entry(*_checked(key, subindex))
        named = self._named(key)
        if named is not None:
            return self.entry(*named)
        found = _ADDRESS.fullmatch(key.strip())
        if found is None:
            raise self._unknown(key)
        index = int(found["a"] or found["b"] or found["c"], 16)
        return self.entry(*_checked(index, int(found["sub"], 16) if found["sub"] else subindex))

    def _named(self, name: str) -> tuple[int, int] | None:
        if self.eds is not None:
            variable = self.eds.find(name)
            if variable is not None:
                return variable.index, variable.subindex
        return catalogue.named(name)

    def _unknown(self, key: str) -> ArgumentError:
        known = list(catalogue.NAMES)
        if self.eds is not None:
            known += [sub.name.lower() for entry in self.eds for sub in entry.subs.values()]
        similar = difflib.get_close_matches(key.strip().lower(), dict.fromkeys(known), n=3)
        where = (
            f"in {self.eds.source} or in CiA 301 and 402" if self.eds is not None else "in CiA 301 and 402"
        )
        return ArgumentError(
            f"there is no object {key!r} {where}",
            remedy=(f"did you mean {' or '.join(repr(name) for name in similar)}? " if similar else "")
            + "an index is written 6081h or 0x6081, a sub-index after a colon: 6099h:01",
        )


def merged_type(file_type: DataType, standard_type: DataType | None) -> DataType:
    """Return the type for reads and writes: the file's size, with the standard's signedness if both types are integers."""
    if standard_type is None or not file_type.integer or not standard_type.integer:
        return file_type
    if file_type.signed is standard_type.signed or file_type is DataType.BOOLEAN:
        return file_type
    return _BY_SHAPE[standard_type.signed, file_type.bits or 0]


def standard(index: int, subindex: int) -> tuple[str, DataType | None]:
    """Return the standard's name and type of an entry; ``""`` and None if the standard does not define it."""
    row = catalogue.entry(index, subindex)
    if row is not None and len(row.subindices) == 1:
        return row.name, row.data_type
    whole = catalogue.whole(index)
    if whole is None or not whole.single or whole.object_type == "VAR":
        return "", None
    return whole.name, DataType.UNSIGNED8 if subindex == 0 else whole.data_type


_BY_SHAPE = {
    (data_type.signed, data_type.bits): data_type
    for data_type in DataType
    if data_type.integer and data_type is not DataType.BOOLEAN
}


def _checked(index: int, subindex: int) -> tuple[int, int]:
    if not 0 <= index <= 0xFFFF or not 0 <= subindex <= 0xFF:
        raise ArgumentError(
            f"{index:X}h:{subindex:X} is not an object",
            remedy="an index has 16 bits, a sub-index 8",
        )
    return index, subindex


def _limits(
    variable: Variable, data_type: DataType, node_id: int | None
) -> tuple[int | float | None, int | float | None]:
    """Return the file's limits; None if they have no effect: both 0 (often meant as "none"), or low above high."""
    low, high = (_limit(value, data_type, node_id) for value in (variable.low, variable.high))
    if low is not None and high is not None and (low > high or low == high == 0):
        return None, None
    return low, high


def _limit(value: Number | float | None, data_type: DataType, node_id: int | None) -> int | float | None:
    if not isinstance(value, Number):
        return value
    number = value.resolve(node_id)
    if data_type.integer and data_type.signed and number > data_type.range[1]:
        return number - (1 << (data_type.bits or 0))  # written as two's complement
    return number
