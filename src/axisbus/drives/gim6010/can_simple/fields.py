"""One field of a message: its position in the data, its type and unit, and its permitted values.

Theory of operation. Nearly all fields are little-endian (manual v2.2, 4.1.1): bit ``start`` counts from the lowest bit of byte 0,
so that byte 5 begins at 40 and its bit 7 is 47. Only the fields of MIT control have the opposite order: bit 0 is the highest of
byte 0, and a field continues from there into the following bytes. Sent values must be within the field's bounds; received values
are decoded without a check.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum

from axisbus.errors import ArgumentError, LimitError

Number = int | float


class FieldEncoding(Enum):
    """Encoding of a number in the bits of a field."""

    UNSIGNED = "unsigned"
    SIGNED = "signed"
    FLOAT = "IEEE 754"


class GearSide(Enum):
    """Side of the gear for a value; one turn of the output is ``gear ratio`` turns of the rotor."""

    NONE = ""
    ROTOR = "rotor"
    OUTPUT = "output"


@dataclass(frozen=True, slots=True)
class FieldType:
    """A type of the manual's tables: its size in bits, and whether its highest bit comes first on the wire."""

    name: str
    bits: int
    kind: FieldEncoding = FieldEncoding.UNSIGNED
    high_first: bool = False

    @property
    def bounds(self) -> tuple[int, int]:
        """Lowest and highest integer of the type."""
        half = 1 << self.bits - 1
        return (-half, half - 1) if self.kind is FieldEncoding.SIGNED else (0, 2 * half - 1)


BIT = FieldType("bit", 1)
FLOAT32 = FieldType("float32", 32, FieldEncoding.FLOAT)
_TYPES = {
    each.name: each
    for each in (
        BIT,
        FLOAT32,
        *(FieldType(f"uint{bits}", bits) for bits in (8, 16, 32, 64)),
        *(FieldType(f"int{bits}", bits, FieldEncoding.SIGNED) for bits in (16, 32)),
        FieldType("4 bytes", 32),
        FieldType("8 bits", 8, high_first=True),
        *(FieldType(f"{bits} bits, highest first", bits, high_first=True) for bits in (12, 16)),
    )
}


@dataclass(frozen=True, slots=True)
class MessageField:
    """One field; ``name`` is the manual's.

    ``start`` is its first bit, counted as in the module's docstring. One ``unit`` is ``per_unit`` on the wire. ``values`` are all
    permitted values with their meaning, if the manual lists them. ``low`` and ``high`` (in ``unit``) limit sent values more
    narrowly than the type does. ``path`` is the parameter that it writes or reports, as over USB and endpoints.
    """

    name: str
    type: FieldType
    start: int = 0
    unit: str = ""
    per_unit: int = 1
    side: GearSide = GearSide.NONE
    values: Mapping[int, str] = field(default_factory=dict)
    low: float = -math.inf
    high: float = math.inf
    path: str = ""

    @property
    def end(self) -> int:
        return self.start + self.type.bits

    def place(self, value: Number) -> int:
        """Return the value as an integer, shifted to the field's position in eight bytes read as one little-endian number.

        Raises:
            ArgumentError: not a number, not finite, or not in the manual's list of values.
            LimitError: beyond the field's bounds or its type.
        """
        return self.place_raw(self.raw(value))

    def raw(self, value: Number) -> int:
        """Return the field's bits for a value in its unit; raises as ``place``."""
        self._check(value)
        if self.type.kind is FieldEncoding.FLOAT:
            return int.from_bytes(self._packed(value), "little")
        whole = round(value * self.per_unit)
        low, high = self.type.bounds
        if not low <= whole <= high:
            raise self._beyond(value, low / self.per_unit, high / self.per_unit)
        return whole & (1 << self.type.bits) - 1

    def place_raw(self, raw: int) -> int:
        """Return the field's bits, shifted to its position in eight bytes read as one little-endian number."""
        if not self.type.high_first:
            return raw << self.start
        return int.from_bytes((raw << 64 - self.end).to_bytes(8, "big"), "little")

    def take_raw(self, data: bytes) -> int:
        """Return the field's bits from data of sufficient length."""
        if self.type.high_first:
            number, shift = int.from_bytes(data, "big"), 8 * len(data) - self.end
        else:
            number, shift = int.from_bytes(data, "little"), self.start
        return number >> shift & (1 << self.type.bits) - 1

    def take(self, data: bytes) -> Number:
        """Return the field's value in its unit from data of sufficient length; a float32 may be NaN or infinite."""
        raw = self.take_raw(data)
        if self.type.kind is FieldEncoding.FLOAT:
            (value,) = struct.unpack("<f", raw.to_bytes(4, "little"))
            return float(value)
        if self.type.kind is FieldEncoding.SIGNED and raw >> self.type.bits - 1:
            raw -= 1 << self.type.bits
        return raw if self.per_unit == 1 else raw / self.per_unit

    def _check(self, value: Number) -> None:
        if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
            raise ArgumentError(f"{self.name}: {value!r} is not a number that can be sent")
        whole = self.type.kind is not FieldEncoding.FLOAT and self.per_unit == 1
        if whole and not isinstance(value, int):
            raise ArgumentError(f"{self.name}: {value!r} is not a whole number")
        if self.values and value not in self.values:
            listed = ", ".join(f"{number} ({words})" for number, words in self.values.items())
            raise ArgumentError(
                f"{self.name}: {value} is not in the manual's list", remedy=f"there are {listed}"
            )
        if not self.low <= value <= self.high:
            raise self._beyond(value, self.low, self.high)

    def _packed(self, value: Number) -> bytes:
        try:
            return struct.pack("<f", value)
        except OverflowError:
            raise LimitError(f"{self.name}: {value:g} is beyond the range of float32") from None

    def _beyond(self, value: Number, low: float, high: float) -> LimitError:
        unit = f" {self.unit}" if self.unit else ""
        bounds = " ".join(
            text
            for text, bound in ((f"from {low:.10g}", low), (f"to {high:.10g}", high))
            if math.isfinite(bound)
        )
        return LimitError(
            f"{self.name}: {value:.10g}{unit} cannot be sent", remedy=f"give a value {bounds}{unit}"
        )


def from_row(row: Mapping[str, str], values: Mapping[int, str]) -> MessageField:
    """Return the field of a row of a table, whose columns are named as the attributes; an empty cell is the default."""
    return MessageField(
        row["name"],
        _TYPES[row["type"]],
        int(row.get("start", 0)),
        row["unit"],
        int(row.get("per_unit") or 1),
        GearSide(row["side"]),
        values,
        float(row["low"] or -math.inf),
        float(row["high"] or math.inf),
        row["path"],
    )
