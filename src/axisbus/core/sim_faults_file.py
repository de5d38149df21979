"""Read a file of faults for simulated drives: a table for each fault; every problem is reported with its line.

Theory of operation
-------------------
Each table has its own name, and contains the drive (``axis`` or ``node``), the time (``begin`` or ``when``), the duration, and the
fault: a fault code, a restart, a replacement of the drive (``swap``), or fault settings by their names. It is read as a
cell file is, and never stops at one problem.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any

from axisbus.cell.model import CellConfig
from axisbus.cell.problem import errors
from axisbus.eds.dictionary import Dictionary
from axisbus.errors import ArgumentError
from axisbus.record.condition import Condition, condition
from axisbus.sim.fault_injection import DriveFaults, LssFaults, NodeFaults, ProgramFaults
from axisbus.sim.fault_plan import FaultSetting, FaultTiming, PlannedFault
from axisbus.toml import document as toml
from axisbus.toml import value_readers as v
from axisbus.toml.problem import as_exception
from axisbus.toml.tables import CellKey, Fields, Keys, Tables
from axisbus.toml.value_readers import InvalidValue, ValueReader

# The values for conditions: the drive's own view of its axis, in the axis's units.
KINDS: Mapping[str, str] = {
    "position": "number",
    "velocity": "number",
    "torque": "number",
    "state": "string",
    "mode": "integer",
    "statusword": "integer",
}
_time = v.duration("0ms", "1440min")
_TIME_KEYS: Keys = {
    "begin": CellKey(_time),
    "when": CellKey(v.text),
    "after": CellKey(_time),
    "every": CellKey(v.duration("10ms", "1440min")),
    "for": CellKey(v.duration("1ms", "1440min")),
}
_TARGET_KEYS: Keys = {"axis": CellKey(v.text), "node": CellKey(v.integer(1, 127))}
_ACTION_KEYS: Keys = {
    "fault": CellKey(v.integer(1, 0xFFFF)),
    "maker_bits": CellKey(v.integer(0, 0xFFFF_FFFF)),
    "restart": CellKey(v.boolean),
}
_NO_NODE_ID = 255
_number_of_32_bits = v.integer(0, 0xFFFF_FFFF)
_SWAP: Keys = {
    "serial": CellKey(_number_of_32_bits),
    "node_id": CellKey(v.integer(1, _NO_NODE_ID)),
    "revision": CellKey(_number_of_32_bits),
    "software_version": CellKey(v.text),
    "product_code": CellKey(_number_of_32_bits),
}


# -- How each fault setting of a simulated drive is read from a file of faults, by its type ----------------------------


NEVER = "never"
_fault_value_readers_time = v.duration("0ms", "60min")
_whole = v.integer(-0x8000_0000, 0xFFFF_FFFF)
_OBJECTS = Dictionary(None)


def _amount(value: Any) -> float:
    """Read a number in the setting's own unit, a time with its unit, or "never"."""
    if value == NEVER:
        return math.inf
    try:
        return float(_fault_value_readers_time(value) if isinstance(value, str) else v.finite(value))
    except InvalidValue as invalid:
        raise InvalidValue(
            'a number, a time with its unit such as "300ms", or "never"', invalid.remedy
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


def _keys(settings: type) -> Keys:
    return {
        field.name: CellKey(_BY_TYPE[str(field.type)]) for field in fields(settings) if field.type in _BY_TYPE
    }


AXIS_KEYS: Keys = _keys(DriveFaults)
NODE_KEYS: Keys = _keys(NodeFaults)
PARTS: Mapping[str, Keys] = {"lss": _keys(LssFaults), "program": _keys(ProgramFaults)}
SWAP = "swap"
_TABLES: Mapping[str, Keys] = {**PARTS, SWAP: _SWAP}


# -- faults file -------------------------------------------------------------------------------------------------------


_KEYS: Keys = {**_TARGET_KEYS, **_TIME_KEYS, **_ACTION_KEYS, **AXIS_KEYS, **NODE_KEYS}


def load_faults(path: str | Path, cell: CellConfig) -> tuple[PlannedFault, ...]:
    """Read a file of faults for the simulated drives of a cell; blocks until it is read.

    Raises:
        ConfigError: the file cannot be read, is no TOML, or contains an error; the first error, with the others listed.
    """
    reading = _Reading(toml.load(path), cell)
    faults = reading.faults()
    if wrong := errors(sorted(reading.problems, key=lambda problem: problem.rank)):
        raise as_exception(wrong)
    return faults


class _Reading(Tables):
    """One pass through a file of faults."""

    def __init__(self, document: toml.TomlDocument, cell: CellConfig) -> None:
        super().__init__(document)
        self._cell = cell

    def faults(self) -> tuple[PlannedFault, ...]:
        """Return all faults without a problem."""
        found = [self._fault(name, raw) for name, raw in self._document.data.items()]
        return tuple(fault for fault in found if fault is not None)

    def _fault(self, name: str, raw: Any) -> PlannedFault | None:
        before = len(self.problems)
        table = self._table((name,), raw)
        fields = self._fields((name,), table, _KEYS, _TABLES)
        parts = {
            part: self._sub((name,), table, part, keys) for part, keys in _TABLES.items() if part in table
        }
        swap_table = parts.pop(SWAP, None)
        swap = None if swap_table is None else {key: swap_table[key] for key in _SWAP if key in swap_table}
        node, axis = self._node_and_axis(name, fields)
        settings = _settings(fields, parts)
        self._require_action(name, table)
        self._require_swap(name, swap)
        self._require_timing(name, table)
        timing = self._timing(name, fields)
        if len(self.problems) > before:
            return None
        return PlannedFault(
            name, _description(table), timing, node, axis, settings,
            fields.get("fault", 0), fields.get("maker_bits", 0), fields.get("restart", False), swap,
        )  # fmt: skip

    def _node_and_axis(self, name: str, fields: Fields) -> tuple[int, int]:
        axes, nodes = self._cell.driven, self._cell.nodes
        if ("axis" in fields) == ("node" in fields):
            self._error(
                (name,), f"[{name}] needs an axis or a node", remedy='write axis = "..." or node = ...'
            )
        elif "axis" in fields and fields["axis"] in axes:
            if nodes[axes[fields["axis"]].node].module is not None:
                self._module((name, "axis"), axes[fields["axis"]].node)
            return axes[fields["axis"]].node, axes[fields["axis"]].drive_axis
        elif "axis" in fields:
            known, what = f"there are {', '.join(axes)}", f"the cell has no axis {fields['axis']!r}"
            if fields["axis"] in self._cell.axes:
                what = f"axis {fields['axis']} is virtual: there is no drive to fail"
            self._error((name, "axis"), what, known, "give one of them")
        elif fields["node"] not in nodes:
            known = f"there are {', '.join(map(str, nodes))}"
            self._error((name, "node"), f"the cell has no node {fields['node']}", known, "give one of them")
        elif nodes[fields["node"]].module is not None:
            self._module((name, "node"), fields["node"])
        return fields.get("node", 0), 1

    def _module(self, where: tuple[str, ...], node_id: int) -> None:
        """Report a CAN Simple module: the faults of this file are those of CANopen nodes."""
        self._error(
            where,
            f"node {node_id} uses CAN Simple, and the file cannot plan faults for such a module",
            remedy="change its fault settings by --control and axisbus.SimulationControl: "
            "plant.simulated_node(NODE).module.dials",
        )

    def _require_action(self, name: str, table: Fields) -> None:
        if not set(table) - set(_TARGET_KEYS) - set(_TIME_KEYS):
            what = f"[{name}] does not say which fault occurs"
            self._error(
                (name,), what, remedy="write fault = 0x2310, restart = true, or a dial: blocked = true"
            )
        of_axis = [key for key in table if key in AXIS_KEYS or key in ("fault", "maker_bits")]
        if "node" in table and of_axis:
            remedy = 'write axis = "..." instead of node'
            self._error(
                (name, of_axis[0]), f"{of_axis[0]!r} is a key of an axis, not of a node", remedy=remedy
            )
        if "for" in table and not any(key in AXIS_KEYS or key in NODE_KEYS or key in PARTS for key in table):
            self._error(
                (name, "for"), "a fault, a restart and a swap have no duration", remedy="leave 'for' out"
            )

    def _require_swap(self, name: str, swap: Fields | None) -> None:
        if swap is None:
            return
        if "serial" not in swap:
            self._error(
                (name, SWAP), f"[{name}] swap needs a serial number", remedy="write swap = { serial = 4712 }"
            )
        if 127 < swap.get("node_id", 0) < _NO_NODE_ID:
            self._error(
                (name, SWAP, "node_id"),
                f"{swap['node_id']} is not a node-ID",
                remedy="write 1 to 127, or 255 for a drive without one",
            )

    def _require_timing(self, name: str, table: Fields) -> None:
        if ("begin" in table) == ("when" in table):
            remedy = 'write begin = "10s" (since the drives began), or when = "x.position > 45"'
            self._error((name,), f"[{name}] needs either 'begin' or 'when'", remedy=remedy)
        if "after" in table and "when" not in table:
            self._error((name, "after"), "'after' requires 'when'", remedy="add its time to 'begin' instead")

    def _timing(self, name: str, fields: Fields) -> FaultTiming:
        begin, when, every, duration = (fields.get(key) for key in ("begin", "when", "every", "for"))
        if every is not None and duration is not None and duration >= every:
            what = "it would begin again before it has ended"
            self._error((name, "every"), what, remedy="make 'every' longer than 'for'")
        is_met = None if when is None else self._condition(name, when)
        return FaultTiming(begin, is_met, fields.get("after", 0.0), every, duration)

    def _condition(self, name: str, text: str) -> Condition | None:
        try:
            return condition(text, self._cell.driven, KINDS)
        except ArgumentError as error:
            self._error((name, "when"), error.message, error.observed or "", error.remedy or "")
            return None


def _settings(fields: Fields, parts: Mapping[str, Fields]) -> tuple[FaultSetting, ...]:
    """Return the fault settings of a table, and those of its parts."""
    own = [
        FaultSetting(key, fields[key], key in AXIS_KEYS) for key in (*AXIS_KEYS, *NODE_KEYS) if key in fields
    ]
    return (
        *own,
        *(
            FaultSetting(key, found[key], False, part)
            for part, found in parts.items()
            for key in PARTS[part]
            if key in found
        ),
    )


def _description(table: Mapping[str, Any]) -> str:
    """Return a table in a line, as its user has written it, without its times."""
    return ", ".join(f"{key} = {_value(key, value)}" for key, value in table.items() if key not in _TIME_KEYS)


def _value(key: str, value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{each} = {_value(each, item)}" for each, item in value.items()) + " }"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:X}h" if key == "fault" or (isinstance(value, int) and value > 0xFFFF) else str(value)
