"""What CiA 301 and CiA 402 say of each entry, made ready for comparison with a file."""

from __future__ import annotations

import re
from functools import cache
from typing import NamedTuple

from axisbus.cia301 import objects as cia301
from axisbus.cia301.datatypes import DataType
from axisbus.cia402 import objects as cia402
from axisbus.cia402.axes import first_axis
from axisbus.eds.model import ObjectType

READ_ONLY = frozenset(("ro", "const"))
_WRITABLE = frozenset(("rw", "rww", "rwr"))
_FITTING = {  # what a file may say for an access of the standard: process data has names of its own, const is always ro
    "ro": READ_ONLY,
    "const": READ_ONLY,
    "rw": _WRITABLE,
    "wo": frozenset(("wo", *_WRITABLE)),
}

# What a master moves in PDOs on every cycle; the PDO attributes of the other objects are not public.
CYCLIC = frozenset(
    (
        *(
            cia402.CONTROLWORD,
            cia402.STATUSWORD,
            cia402.MODES_OF_OPERATION,
            cia402.MODES_OF_OPERATION_DISPLAY,
        ),
        *(cia402.POSITION_ACTUAL, cia402.VELOCITY_ACTUAL, cia402.TORQUE_ACTUAL),
        *(cia402.TARGET_POSITION, cia402.TARGET_VELOCITY, cia402.TARGET_TORQUE),
    )
)


class Row(NamedTuple):
    """One entry of a standard; empty where it leaves something open. ``sure`` tells whether breaking it is more than a note."""

    index: int  # type: ignore[assignment]  # hides tuple.index, which nobody wants here
    subindex: int
    name: str
    data_types: tuple[DataType, ...]
    access: frozenset[str]
    mappable: bool
    mandatory: bool
    sure: bool


class Whole(NamedTuple):
    """An object of a standard as a whole."""

    index: int  # type: ignore[assignment]  # hides tuple.index
    name: str
    object_type: ObjectType
    category: str
    sure: bool


def access_fits(access: str, wanted: frozenset[str]) -> bool:
    """Whether what a file says means what the standard says."""
    return not wanted or any(access in _FITTING[each] for each in wanted)


def row(index: int, subindex: int) -> Row | None:
    """Return what CiA 301 or CiA 402 (on any axis) says of an entry, None where it says nothing."""
    found = communication_rows() if index < 0x2000 else drive_rows()
    return found.get((first_axis(index), subindex))


@cache
def communication_rows() -> dict[tuple[int, int], Row]:
    """Return the entries of CiA 301 that have one index; those of ARRAYs stand for each of their sub-indices."""
    found: dict[tuple[int, int], Row] = {}
    for line in cia301.table():
        if "-" in line["index"]:
            continue
        index, access = int(line["index"], 16), _access(line["access"])
        types = _types(line["data_type"])
        mandatory, mappable = line["category"] == "mandatory", line["pdo_mappable"] != "no"
        if line["object_type"] == "ARRAY":
            for subindex in range(1, 255):
                found[index, subindex] = Row(
                    index, subindex, line["name"], types, access, mappable, False, True
                )
        elif not line["object_type"].startswith("RECORD"):
            subindex = int(line["subindex"] or "0", 16)
            found[index, subindex] = Row(
                index, subindex, line["name"], types, access, mappable, mandatory, True
            )
    return found


@cache
def communication_objects() -> dict[int, Whole]:
    """Return the objects of CiA 301 that have one index."""
    return {
        int(line["index"], 16): Whole(
            int(line["index"], 16), line["name"], _object_type(line["object_type"]), line["category"], True
        )
        for line in reversed(cia301.table())  # an object's own line comes before those of its sub-indices
        if "-" not in line["index"]
    }


@cache
def drive_rows() -> dict[tuple[int, int], Row]:
    """Return the entries of CiA 402, on the first axis."""
    found: dict[tuple[int, int], Row] = {}
    for line in cia402.table():
        if not line["subindex"]:
            continue
        key = int(line["index"], 16), int(line["subindex"], 16)
        found[key] = Row(
            *key,
            line["name"],
            _types(line["data_type"]),
            _access(line["access"]),
            line["pdo_mappable"] != "no",
            line["category"] == "mandatory",
            line["confidence"] == "H",
        )
    return found


@cache
def drive_objects() -> dict[int, Whole]:
    """Return the objects of CiA 402, on the first axis."""
    return {
        int(line["index"], 16): Whole(
            int(line["index"], 16),
            line["name"],
            _object_type(line["object_type"]),
            line["category"],
            line["confidence"] == "H",
        )
        for line in reversed(cia402.table())
    }


def _types(text: str) -> tuple[DataType, ...]:
    """Read ``UNSIGNED32``, ``UNSIGNED8/16`` and ``INTEGER8 (some drives UNSIGNED8)``."""
    words: list[str] = re.findall(r"[A-Z_]+[0-9]*|(?<=/)[0-9]+", text)
    names = [word if not word.isdigit() else words[0].rstrip("0123456789") + word for word in words]
    return tuple(DataType[name] for name in names if name in DataType.__members__)


def _access(text: str) -> frozenset[str]:
    return frozenset(text.split("/")) if text else frozenset()


def _object_type(text: str) -> ObjectType:
    return ObjectType[text.split()[0]]
