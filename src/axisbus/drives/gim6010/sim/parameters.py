"""Parameters of a simulated module by the names of the USB tree: in RAM, in flash, and factory settings.

The numbers of the endpoints differ between versions: a list is named by its version, and the list of another version is wrong from
some number on. Of lists other than v8 only some numbers were published; numbers in between are shifted like their published
neighbours.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

from axisbus.drives.gim6010.sim.constants import Firmware

Value = float | int


# By type: struct format of the value. The wire has four bytes for it, so that only the low half of 64 bits is transferred.
FORMATS = {
    "float": "<f",
    "uint32": "<I",
    "int32": "<i",
    "uint16": "<H",
    "uint8": "<B",
    "bool": "<?",
    "uint64": "<Q",
}
CALIBRATED = ("axis0.motor.config.pre_calibrated", "axis0.encoder.config.pre_calibrated")
_FIRST_V8 = Firmware(0, 6, 1)
# By list: (first v8 number, amount by which the numbers from there on are lower).
_SHIFTS: dict[str, tuple[tuple[int, int], ...]] = {
    "0.5.13": ((500, 49), (361, 38), (281, 13), (131, 4), (0, 0)),
    "0.6.0": ((500, 29), (361, 24), (281, 4), (131, 1), (0, 0)),
    "v8": ((0, 0),),
}


class Row(NamedTuple):
    """One parameter or function; ``kind`` is its type, empty for a function without an argument."""

    path: str
    number: int  # in v8
    kind: str
    access: str
    factory: Value
    live: str = ""  # attribute of the module, for a measured value

    @property
    def is_function(self) -> bool:
        return self.access == "x"


@cache
def rows() -> tuple[Row, ...]:
    """Return the table ``parameters.tsv``, which is stored beside this module."""
    text = Path(__file__).with_suffix(".tsv").read_text("utf-8")
    return tuple(_row(line) for line in text.splitlines() if line and not line.startswith("#"))


def _row(line: str) -> Row:
    path, number, kind, access, factory, *live = line.split("\t")
    value: Value = float(factory) if kind == "float" else int(factory)
    return Row(path, int(number.rstrip("!")), kind, access, value, *live)


def list_of(firmware: Firmware) -> str:
    """Return the name of the endpoint list for a version."""
    if firmware < (0, 6, 0):
        return "0.5.13"
    return "0.6.0" if firmware < _FIRST_V8 else "v8"


def number_in(name: str, number: int) -> int:
    """Return the number in the list ``name`` of the entry with ``number`` in v8."""
    return next(number - shift for first, shift in _SHIFTS[name] if number >= first)


def fitted(kind: str, value: Value) -> Value | None:
    """Return a value as its type stores it; None if it does not fit."""
    try:
        stored = struct.unpack(FORMATS[kind], struct.pack(FORMATS[kind], value))[0]
    except (struct.error, OverflowError):
        return None
    return int(stored) if kind != "float" else float(stored)


class Parameters:
    """Values in RAM by path, and those in flash, which a restart restores."""

    def __init__(self, **given: Value) -> None:
        """Start with the factory settings; ``given``: other values, by path or its last part (``node_id=5``; the first such row).

        Raises:
            KeyError: there is no such parameter.
        """
        known = {row.path.rpartition(".")[2]: row.path for row in reversed(rows())}
        known |= {row.path: row.path for row in rows()}
        self.values: dict[str, Value] = {row.path: row.factory for row in rows() if not row.is_function}
        self.values |= {known[name]: value for name, value in given.items()}
        self._flash = dict(self.values)

    def __getitem__(self, path: str) -> Value:
        return self.values[path]

    def __setitem__(self, path: str, value: Value) -> None:
        if path not in self.values:
            raise KeyError(path)
        self.values[path] = value

    @property
    def node_id(self) -> int:
        """``axis0.config.can.node_id``; only the six bits that fit into an identifier."""
        return int(self.values["axis0.config.can.node_id"]) & 0x3F

    def save(self) -> None:
        self._flash = dict(self.values)

    def load(self) -> None:
        """Copy flash to RAM, as a restart does."""
        self.values = dict(self._flash)

    def erase(self) -> None:
        """Reset flash to the factory settings, and clear the calibration flags; RAM is not changed."""
        written = {row.path: row.factory for row in rows() if row.access == "rw"}
        self._flash |= written | dict.fromkeys(CALIBRATED, 0)


# -- Endpoints: parameters and functions by number, as accessed by RxSdo, and the list of their names ------------------


class Endpoints:
    """Reads, writes and calls by path or number; stores the arguments of functions until they are called.

    The number of a function's argument follows that of the function. The argument is written first, then the function is called.
    """

    def __init__(
        self,
        parameters: Parameters,
        name: str,
        live: Mapping[str, Callable[[], Value]],
        acts: Mapping[str, Callable[[Value], None]],
    ) -> None:
        """``name``: the list whose numbers are used. ``live``: measured values. ``acts``: actions of a write or call."""
        self.name = name
        self._parameters = parameters
        self._live = live
        self._acts = acts
        self._by_number = {number_in(name, row.number): row for row in rows()}
        self._by_path = {row.path: row for row in rows()}
        self._argument_of = {
            number + 1: row for number, row in self._by_number.items() if row.is_function and row.kind
        }
        self._given: dict[str, Value] = {}

    def number(self, path: str) -> int:
        return number_in(self.name, self._by_path[path].number)

    def read(self, path: str) -> Value:
        live = self._live.get(path)
        row = self._by_path[path]
        if live is None:
            return self._parameters[path]
        value = fitted(row.kind, live())
        return 0 if value is None else value

    def write(self, path: str, value: Value = 0) -> None:
        """Write a value, or call a function, by its path; a value that does not fit its type is ignored."""
        row = self._by_path[path]
        held = value if not row.kind else fitted(row.kind, value)
        if row.access == "r" or held is None:
            return
        if not row.is_function:
            self._parameters[path] = held
        act = self._acts.get(path)
        if act is not None:
            act(held)

    def read_bytes(self, number: int) -> bytes | None:
        """Return the four bytes of the answer to RxSdo; None if the endpoint cannot be read."""
        row = self._by_number.get(number)
        if row is None or row.is_function:
            return None
        return struct.pack(FORMATS[row.kind], self.read(row.path)).ljust(4, b"\0")[:4]

    def path_of(self, number: int) -> str | None:
        """Return the path of the parameter or function with this number, if it can be written or called."""
        row = self._by_number.get(number)
        return None if row is None or row.access == "r" else row.path

    def write_bytes(self, number: int, data: bytes) -> None:
        """Write the four bytes of RxSdo, or call; a missing or read-only endpoint is ignored."""
        argument = self._argument_of.get(number)
        if argument is not None:
            self._given[argument.path] = _unpacked(argument.kind, data)
            return
        path = self.path_of(number)
        if path is None:
            return
        row = self._by_path[path]
        self.write(path, self._given.get(path, 0) if row.is_function else _unpacked(row.kind, data))

    def as_json(self) -> list[dict[str, Any]]:
        """Return the list in the format of the firmware's file: nested, functions with their arguments and without access."""
        top: list[dict[str, Any]] = [{"name": "", "id": 0, "type": "json", "access": "r"}]
        for row in rows():
            *folders, name = row.path.split(".")
            _folder(top, folders).append(self._leaf(row, name))
        return top

    def _leaf(self, row: Row, name: str) -> dict[str, Any]:
        number = number_in(self.name, row.number)
        if not row.is_function:
            kind = "uint16" if row.path == "can.config.protocol" and self.name == "v8" else row.kind
            return {"name": name, "id": number, "type": kind, "access": row.access}
        inputs = []
        if row.kind:
            inputs = [{"name": "value", "id": number + 1, "type": row.kind, "access": "rw"}]
        return {"name": name, "id": number, "type": "function", "inputs": inputs, "outputs": []}


def _unpacked(kind: str, data: bytes) -> Value:
    size = struct.calcsize(FORMATS[kind])
    value: Value = struct.unpack(FORMATS[kind], data.ljust(size, b"\0")[:size])[0]
    return value


def _folder(members: list[dict[str, Any]], folders: list[str]) -> list[dict[str, Any]]:
    for name in folders:
        found = next((one for one in members if one["name"] == name and "members" in one), None)
        if found is None:
            found = {"name": name, "type": "object", "members": []}
            members.append(found)
        members = found["members"]
    return members
