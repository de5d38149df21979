"""The data types of CiA 301 7.4.7 with their size, range and little-endian encoding."""

from __future__ import annotations

import struct
from enum import IntEnum

from axisbus.errors import ArgumentError, LimitError


class DataType(IntEnum):
    """Index of a data type in the object dictionary (CiA 301 table 44); an unknown index becomes a member, too."""

    BOOLEAN = 0x01
    INTEGER8 = 0x02
    INTEGER16 = 0x03
    INTEGER32 = 0x04
    UNSIGNED8 = 0x05
    UNSIGNED16 = 0x06
    UNSIGNED32 = 0x07
    REAL32 = 0x08
    VISIBLE_STRING = 0x09
    OCTET_STRING = 0x0A
    UNICODE_STRING = 0x0B
    TIME_OF_DAY = 0x0C
    TIME_DIFFERENCE = 0x0D
    DOMAIN = 0x0F
    INTEGER24 = 0x10
    REAL64 = 0x11
    INTEGER40 = 0x12
    INTEGER48 = 0x13
    INTEGER56 = 0x14
    INTEGER64 = 0x15
    UNSIGNED24 = 0x16
    UNSIGNED40 = 0x18
    UNSIGNED48 = 0x19
    UNSIGNED56 = 0x1A
    UNSIGNED64 = 0x1B
    PDO_COMMUNICATION_PARAMETER = 0x20
    PDO_MAPPING = 0x21
    SDO_PARAMETER = 0x22
    IDENTITY = 0x23

    @classmethod
    def _missing_(cls, value: object) -> DataType | None:
        if not isinstance(value, int) or not 0 <= value <= 0xFFFF:
            return None
        member = int.__new__(cls, value)
        member._name_ = f"TYPE_{value:04X}"
        member._value_ = value
        return member

    @property
    def bits(self) -> int | None:
        """Size in bits, None for types without a fixed size."""
        return _BITS.get(self)

    @property
    def signed(self) -> bool:
        """Whether the type is one of the INTEGERn types."""
        return self in _SIGNED

    @property
    def integer(self) -> bool:
        """Whether the type is BOOLEAN, INTEGERn or UNSIGNEDn."""
        return self in _BITS and self not in _REALS and self not in _TIMES

    @property
    def range(self) -> tuple[int, int]:
        """Smallest and largest value of an integer type.

        Raises:
            ArgumentError: the type is not an integer type.
        """
        bits = self.bits
        if bits is None or not self.integer:
            raise ArgumentError(f"{self.name} has no range")
        if self.signed:
            return -(1 << (bits - 1)), (1 << (bits - 1)) - 1
        return 0, (1 << bits) - 1


_SIGNED = {
    DataType.INTEGER8: 8,
    DataType.INTEGER16: 16,
    DataType.INTEGER24: 24,
    DataType.INTEGER32: 32,
    DataType.INTEGER40: 40,
    DataType.INTEGER48: 48,
    DataType.INTEGER56: 56,
    DataType.INTEGER64: 64,
}
_UNSIGNED = {
    DataType.UNSIGNED8: 8,
    DataType.UNSIGNED16: 16,
    DataType.UNSIGNED24: 24,
    DataType.UNSIGNED32: 32,
    DataType.UNSIGNED40: 40,
    DataType.UNSIGNED48: 48,
    DataType.UNSIGNED56: 56,
    DataType.UNSIGNED64: 64,
}
_REALS = {DataType.REAL32: 32, DataType.REAL64: 64}
_TIMES = {DataType.TIME_OF_DAY: 48, DataType.TIME_DIFFERENCE: 48}
_BITS: dict[DataType, int] = {DataType.BOOLEAN: 1, **_SIGNED, **_UNSIGNED, **_REALS, **_TIMES}
_TEXT = {DataType.VISIBLE_STRING: "latin-1", DataType.UNICODE_STRING: "utf-16-le"}

Value = int | float | str | bytes


def size_in_bytes(data_type: DataType) -> int | None:
    """Return the size in bytes of a ``data_type`` value in an SDO transfer; None if it varies."""
    bits = data_type.bits
    return None if bits is None else (bits + 7) // 8


def check_range(value: int, data_type: DataType, what: str) -> int:
    """Return ``value`` if ``data_type`` can hold it.

    Raises:
        LimitError: it cannot; the text names ``what``, the type and its range.
    """
    low, high = data_type.range
    if not low <= value <= high:
        raise LimitError(
            f"{what}: {value} does not fit {data_type.name}",
            observed=f"{data_type.name} holds {low} to {high}",
            remedy="give a smaller value, or check the scale",
        )
    return value


def encode(value: Value, data_type: DataType, what: str = "value") -> bytes:
    """Encode ``value`` as ``data_type`` according to CiA 301 7.1.4 (little endian); bytes are returned unchanged.

    Raises:
        ArgumentError: the value has the wrong Python type.
        LimitError: an integer does not fit.
    """
    if isinstance(value, (bytes, bytearray)):
        return bytes(value)
    if isinstance(value, str):
        if data_type not in _TEXT:
            raise ArgumentError(f"{what}: {value!r} is text, {data_type.name} is not")
        return value.encode(_TEXT[data_type], errors="replace")
    if data_type in _REALS:
        return struct.pack("<f" if data_type is DataType.REAL32 else "<d", value)
    if not data_type.integer or value != int(value):
        raise ArgumentError(f"{what}: {value!r} cannot be written as {data_type.name}")
    size = size_in_bytes(data_type)
    assert size is not None  # every integer type has one
    return check_range(int(value), data_type, what).to_bytes(size, "little", signed=data_type.signed)


def decode(data: bytes, data_type: DataType) -> Value:
    """Decode received data; if its length differs from the size of an integer type, decode the integer that it holds.

    Some devices send an UNSIGNED32 for an UNSIGNED8; the surplus bytes are ignored. Data of types without a codec is returned as
    bytes.
    """
    if data_type in _TEXT:
        return data.decode(_TEXT[data_type], errors="replace").rstrip("\0")
    if data_type in _REALS and len(data) * 8 == _REALS[data_type]:
        value: float = struct.unpack("<f" if data_type is DataType.REAL32 else "<d", data)[0]
        return value
    if not data_type.integer or not data:
        return data
    size = size_in_bytes(data_type)
    return int.from_bytes(data[:size], "little", signed=data_type.signed)
