"""Convert a value to an object's bytes, checked against the object's type and limits before anything is sent."""

from __future__ import annotations

import math

from axisbus.cia301.datatypes import DataType, Value, check_range, encode
from axisbus.eds.dictionary import DictionaryEntry
from axisbus.errors import ArgumentError, LimitError

_REALS = (DataType.REAL32, DataType.REAL64)
_REAL32_MAX = 3.4028234663852886e38


def checked_bytes(
    entry: DictionaryEntry, value: Value, data_type: DataType | None = None, *, limits: bool = True
) -> bytes:
    """Return ``value`` as the object's bytes, if the type allows it, and with ``limits`` also LowLimit and HighLimit of the EDS.

    Raises:
        ArgumentError: wrong kind, or no type known.
        LimitError: out of range.
    """
    known = data_type or entry.data_type
    if known is None:
        if isinstance(value, (bytes, bytearray)):
            return bytes(value)
        raise ArgumentError(
            f"{entry}: its data type is not known, so {value!r} cannot be encoded",
            remedy="give the node's EDS, the data type, or bytes",
        )
    _check_kind(entry, value, known)
    if isinstance(value, (int, float)):
        _check_range(entry, value, known)
        if limits:
            _check_limits(entry, value)
    return encode(value, known, str(entry))


def _check_kind(entry: DictionaryEntry, value: Value, data_type: DataType) -> None:
    kind = data_type.name
    if not isinstance(value, (int, float)):
        if data_type.integer or data_type in _REALS:
            raise ArgumentError(f"{entry}: {value!r} is not a number, the object is {kind}")
        return
    if not data_type.integer and data_type not in _REALS:
        raise ArgumentError(f"{entry}: {value!r} is a number, the object is {kind}")
    if not (data_type.integer and isinstance(value, int)) and not _is_finite(value):
        raise ArgumentError(f"{entry}: {value} is not a finite number")
    if data_type.integer and value != int(value):
        raise ArgumentError(f"{entry}: {value} is not a whole number, the object is {kind}")


def _is_finite(value: float) -> bool:
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer too large for a float
        return False


def _check_range(entry: DictionaryEntry, value: float, data_type: DataType) -> None:
    if data_type.integer:
        check_range(int(value), data_type, str(entry))
    if data_type is DataType.REAL32 and abs(value) > _REAL32_MAX:
        raise LimitError(f"{entry}: {value} does not fit REAL32")


def _check_limits(entry: DictionaryEntry, value: float) -> None:
    low, high = entry.low, entry.high
    if (low is None or value >= low) and (high is None or value <= high):
        return
    raise LimitError(
        f"{entry}: {value} is outside its limits",
        observed=f"the EDS has LowLimit {low}, HighLimit {high} (None: no limit)",
        remedy="give a value within the limits, or correct the EDS if the drive allows more",
    )
