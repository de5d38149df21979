"""Parameters of a simulated module by the names of the USB tree: in RAM, in flash, and factory settings.

The numbers of the endpoints differ between versions: a list is named by its version, and the list of another version is wrong from
some number on. Of lists other than v8 only some numbers were published; numbers in between are shifted like their published
neighbours.
"""

from __future__ import annotations

import struct
from functools import cache
from pathlib import Path
from typing import NamedTuple

from axisbus.sim.can_simple.firmware import Firmware

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

    @property
    def is_function(self) -> bool:
        """Whether it is called instead of written."""
        return self.access == "x"


@cache
def rows() -> tuple[Row, ...]:
    """Return the table ``parameters.tsv``, which is stored beside this module."""
    text = Path(__file__).with_suffix(".tsv").read_text("utf-8")
    return tuple(_row(line) for line in text.splitlines() if line and not line.startswith("#"))


def _row(line: str) -> Row:
    path, number, kind, access, factory = line.split("\t")
    value: Value = float(factory) if kind == "float" else int(factory)
    return Row(path, int(number.rstrip("!")), kind, access, value)


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
        """Copy RAM to flash."""
        self._flash = dict(self.values)

    def load(self) -> None:
        """Copy flash to RAM, as a restart does."""
        self.values = dict(self._flash)

    def erase(self) -> None:
        """Reset flash to the factory settings, and clear the calibration flags; RAM is not changed."""
        written = {row.path: row.factory for row in rows() if row.access == "rw"}
        self._flash |= written | dict.fromkeys(CALIBRATED, 0)
