"""PDO mapping (CiA 301 7.4.9, 7.5.2.35-38) and a codec that is compiled once for each PDO."""

from __future__ import annotations

import struct
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

from axisbus.cia301.datatypes import DataType
from axisbus.errors import ArgumentError
from axisbus.wording import counted

MAX_BITS = 64
_DUMMY_TYPES = range(1, 8)  # mapping entries 0001h to 0007h reserve space without an object (CiA 301 7.4.7)


class MappedObject(NamedTuple):
    """One entry of a mapping parameter: the object and its number of mapped bits."""

    index: int  # type: ignore[assignment]  # hides tuple.index, which is not needed here
    subindex: int
    bits: int

    @classmethod
    def from_entry(cls, entry: int) -> MappedObject:
        """Read the UNSIGNED32 of 16xxh or 1Axxh."""
        return cls(entry >> 16, entry >> 8 & 0xFF, entry & 0xFF)

    @property
    def entry(self) -> int:
        """The UNSIGNED32 for 16xxh or 1Axxh."""
        return self.index << 16 | self.subindex << 8 | self.bits

    @property
    def is_dummy(self) -> bool:
        """Whether the entry only reserves space."""
        return self.index in _DUMMY_TYPES

    def __str__(self) -> str:
        return f"{self.index:04X}:{self.subindex:02X}/{self.bits}"


class PdoLocation(NamedTuple):
    """Location of an object: the PDO ``pdo`` (``TPDO1``) in the frames of ``can_id``, ``bits`` bits from the bit ``shift`` on."""

    can_id: int
    pdo: str
    shift: int
    bits: int


# Transmission types of a TPDO that is sent in answer to a remote frame (CiA 301 table 72): sampled at SYNC, or at once.
RTR_TYPES = (252, 253)


def is_synchronous(transmission_type: int) -> bool:
    """Whether a PDO of this transmission type is synchronous (types 0 to 240; CiA 301 table 69 and 72)."""
    return transmission_type <= 240


@dataclass(frozen=True, slots=True)
class PdoConfiguration:
    """The parameters of one PDO as the drive holds them.

    ``number`` counts from 1. ``inhibit_time`` is in 100 µs, ``event_timer`` in ms (0 = off, None = the drive has no such entry).
    ``sync_start`` is the SYNC counter at which a TPDO begins to count SYNCs (0: at once; None: no such entry).
    """

    number: int
    cob_id: int
    valid: bool
    transmission_type: int
    mapping: tuple[MappedObject, ...]
    inhibit_time: int | None = None
    event_timer: int | None = None
    sync_start: int | None = None

    @property
    def bits(self) -> int:
        """Sum of the mapped bits."""
        return sum(entry.bits for entry in self.mapping)

    @property
    def size(self) -> int:
        """Data bytes of the frame."""
        return (self.bits + 7) // 8

    @property
    def synchronous(self) -> bool:
        """Whether the PDO is synchronous (types 0 to 240)."""
        return is_synchronous(self.transmission_type)

    @property
    def on_request(self) -> bool:
        """Whether a TPDO is sent only in answer to a remote frame."""
        return self.transmission_type in RTR_TYPES


class PdoCodec:
    """Packs and unpacks the values of one mapping, in the order of its entries (dummies included).

    ``struct`` is used if every entry has 1, 2, 4 or 8 bytes. Otherwise the values are packed bit by bit, the least significant bit
    first. Frozen after construction; safe to share between threads.
    """

    __slots__ = ("_fields", "_struct", "pack_each", "size", "unpack_from")

    def __init__(self, mapping: Sequence[MappedObject], signed: Sequence[bool]) -> None:
        """Compile the codec; ``signed[i]``: entry ``i`` is two's complement.

        Raises:
            ArgumentError: more than 64 bits are mapped.
        """
        bits = sum(entry.bits for entry in mapping)
        if bits > MAX_BITS:
            raise ArgumentError(
                f"a PDO cannot carry {counted(bits, 'bit')}",
                observed=f"the mapped objects are {', '.join(map(str, mapping))}",
                remedy="a CAN frame holds 64 bits: split the mapping over two PDOs",
            )
        self.size = (bits + 7) // 8
        self._fields = _fields(mapping, signed)
        self._struct = known = _struct(mapping, signed)
        # Faster variants of ``unpack`` and ``pack``; with a value that does not fit, ``pack_each`` may raise ``struct.error``.
        self.unpack_from: Callable[[bytes], tuple[int, ...]] = (
            self.unpack if known is None else known.unpack_from
        )
        self.pack_each: Callable[..., bytes] = self._pack_bits if known is None else known.pack

    def pack(self, values: Sequence[int]) -> bytes:
        """Return the frame's data; a value that does not fit is cut to its bits, such as a negative one in an unsigned entry."""
        if self._struct is not None:
            try:
                return self._struct.pack(*values)
            except struct.error:
                pass  # cut below, for drives that declare a signed object as unsigned
        return self._pack_bits(*values)

    def _pack_bits(self, *values: int) -> bytes:
        raw = 0
        for value, (shift, mask, _) in zip(values, self._fields, strict=True):
            raw |= (value & mask) << shift
        return raw.to_bytes(self.size, "little")

    def unpack(self, data: bytes) -> tuple[int, ...]:
        """Return the values of a frame that holds at least ``size`` bytes."""
        if self._struct is not None:
            return self._struct.unpack_from(data)
        raw = int.from_bytes(data[: self.size], "little")
        return tuple(_sign(raw >> shift & mask, half) for shift, mask, half in self._fields)


_LETTERS = {8: "b", 16: "h", 32: "i", 64: "q"}


def _struct(mapping: Sequence[MappedObject], signed: Sequence[bool]) -> struct.Struct | None:
    if any(entry.bits not in _LETTERS for entry in mapping):
        return None
    letters = (
        _LETTERS[entry.bits] if sign else _LETTERS[entry.bits].upper()
        for entry, sign in zip(mapping, signed, strict=True)
    )
    return struct.Struct("<" + "".join(letters))


def _fields(mapping: Sequence[MappedObject], signed: Sequence[bool]) -> tuple[tuple[int, int, int], ...]:
    fields, shift = [], 0
    for entry, sign in zip(mapping, signed, strict=True):
        half = 1 << (entry.bits - 1) if sign and entry.bits else 0
        fields.append((shift, (1 << entry.bits) - 1, half))
        shift += entry.bits
    return tuple(fields)


def _sign(value: int, half: int) -> int:
    return value - (half << 1) if half and value & half else value


def dummy_type(entry: MappedObject) -> DataType | None:
    """Return the data type of a dummy entry, None for a real object."""
    return DataType(entry.index) if entry.is_dummy else None
