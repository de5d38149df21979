"""How each fault setting of a simulated drive is read from a file of faults, by its type."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any

from axisbus.cell import value_readers as v
from axisbus.cell.schema import CellKey, Keys
from axisbus.cell.value_readers import InvalidValue, ValueReader
from axisbus.eds.dictionary import Dictionary
from axisbus.errors import ArgumentError
from axisbus.sim.fault_injection import DriveFaults, LssDials, NodeFaults, ProgramDials

NEVER = "never"
_time = v.duration("0ms", "60min")
_whole = v.integer(-0x8000_0000, 0xFFFF_FFFF)
_OBJECTS = Dictionary(None)


def _amount(value: Any) -> float:
    """Read a number in the setting's own unit, a time with its unit, or "never"."""
    if value == NEVER:
        return math.inf
    try:
        return float(_time(value) if isinstance(value, str) else v.finite(value))
    except InvalidValue as unfit:
        raise InvalidValue(
            'a number, a time with its unit such as "300ms", or "never"', unfit.remedy
        ) from None


def _table(read_key: Callable[[str], Any], read: ValueReader, example: str) -> ValueReader:
    def read_table(value: Any) -> dict[Any, Any]:
        if not isinstance(value, dict):
            raise InvalidValue(f"a table such as {example}")
        return {read_key(key): read(item) for key, item in value.items()}

    return ValueReader(read_table, {"type": "object"})


def _number(key: str) -> int:
    if not key.isdigit():
        raise InvalidValue("a table with numbers as its keys")
    return int(key)


def _object(key: str) -> tuple[int, int]:
    try:
        found = _OBJECTS.resolve(key)
    except ArgumentError as error:
        raise InvalidValue(f"a table with objects as its keys, and not {key!r}", error.remedy or "") from None
    return found.index, found.subindex


_amounts = ValueReader(_amount, {"type": ["number", "string"]})
_wholes = v.list_of(_whole, "whole numbers", empty=True)
_BY_TYPE: Mapping[str, ValueReader] = {
    "bool": v.boolean,
    "int": _whole,
    "int | None": _whole,
    "float": _amounts,
    "set[int]": ValueReader(lambda value: set(_wholes(value)), _wholes.json),
    "frozenset[int]": ValueReader(lambda value: frozenset(_wholes(value)), _wholes.json),
    "dict[int, float]": _table(_number, _amounts, '{ 4 = "2s" }'),
    "dict[int, int]": _table(_number, _whole, "{ 1 = 0x06090030 }"),
    "dict[tuple[int, int], int]": _table(_object, _whole, '{ "6060:00" = 0x08000022 }'),
}


def _keys(dials: type) -> Keys:
    return {
        field.name: CellKey(_BY_TYPE[str(field.type)]) for field in fields(dials) if field.type in _BY_TYPE
    }


OF_AXIS: Keys = _keys(DriveFaults)
OF_NODE: Keys = _keys(NodeFaults)
PARTS: Mapping[str, Keys] = {"lss": _keys(LssDials), "program": _keys(ProgramDials)}
