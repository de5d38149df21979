"""The pre-defined error field 1003h (CiA 301 7.5.2.4): the list of errors that a device keeps, the newest first."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from axisbus.cia301 import emcy
from axisbus.cia301.objects import PREDEFINED_ERROR_FIELD

LONGEST = 254


class ErrorEntry(NamedTuple):
    """One entry: ``number`` from 1 for the newest, the error code, and 16 manufacturer-specific bits."""

    number: int
    code: int
    additional: int

    def __str__(self) -> str:
        more = f", additional information 0x{self.additional:04X}" if self.additional else ""
        return f"{self.number}. {emcy.describe(self.code)}{more}"


def decode(number: int, value: int) -> ErrorEntry:
    """Read one UNSIGNED32: the error code in the low half, manufacturer-specific information in the high half."""
    return ErrorEntry(number, value & 0xFFFF, value >> 16 & 0xFFFF)


def read(upload: Callable[[int, int], int | None]) -> tuple[ErrorEntry, ...] | None:
    """Read 1003h through ``upload(index, subindex)``, which returns None if the device refuses.

    Returns None if the device has no 1003h. If the device reports more entries than it has, the existing entries are returned.
    Raises and blocks as ``upload`` does.
    """
    count = upload(PREDEFINED_ERROR_FIELD, 0)
    if count is None:
        return None
    entries = []
    for number in range(1, min(count, LONGEST) + 1):
        value = upload(PREDEFINED_ERROR_FIELD, number)
        if value is None:
            break
        entries.append(decode(number, value))
    return tuple(entries)
