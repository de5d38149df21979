"""Emergency messages (CiA 301 7.2.7) and the texts of their error codes."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from axisbus.cia301.objects import PREDEFINED_ERROR_FIELD
from axisbus.cia301.tables import rows


class Emcy(NamedTuple):
    """One emergency message: error code, error register (1001h), five manufacturer-specific bytes, receipt time in seconds."""

    code: int
    register: int
    data: bytes
    stamp: float

    @property
    def is_reset(self) -> bool:
        """Whether the message reports that an error is gone (codes 00xxh)."""
        return self.code & 0xFF00 == 0


# Bits of the error register (CiA 301 7.5.2.2).
REGISTER_BITS = {
    0: "generic error",
    1: "current",
    2: "voltage",
    3: "temperature",
    4: "communication",
    5: "device profile",
    6: "reserved",
    7: "manufacturer-specific",
}


def parse(data: bytes, stamp: float) -> Emcy:
    """Read an emergency message; one shorter than 8 bytes (some drives send them) is filled with zeros."""
    full = bytes(data[:8]).ljust(8, b"\0")
    return Emcy(int.from_bytes(full[:2], "little"), full[2], full[3:8], stamp)


def _codes() -> tuple[dict[int, str], dict[int, str]]:
    exact: dict[int, str] = {}
    classes: dict[int, str] = {}
    for row in rows(__package__, "emcy.tsv"):
        code = int(row["code"], 16)
        (exact if row["match"] == "exact" else classes)[code] = row["name"]
    return exact, classes


# Read on import: the first fault is explained inside the scan, which must not wait for a disk.
_EXACT, _CLASSES = _codes()


def explain(code: int) -> str:
    """Return the standard's text for an error code, or that of its class if the code has none."""
    if code in _EXACT:
        return _EXACT[code]
    for mask in (0xFFFF, 0xFF00, 0xF000):
        if code & mask in _CLASSES:
            text = _CLASSES[code & mask]
            return text if code & mask == code else f"{text} (class of this code)"
        if code & mask in _EXACT and mask != 0xFFFF:
            return f"{_EXACT[code & mask]} (class of this code)"
    return "not in CiA 301 or CiA 402"


def describe(code: int) -> str:
    """Return code and text in one line, such as ``0x8611, Following error``."""
    return f"0x{code:04X}, {explain(code)}"


def register_words(register: int) -> list[str]:
    """Return the names of the bits set in an error register."""
    return [name for bit, name in REGISTER_BITS.items() if register >> bit & 1]


# -- The pre-defined error field 1003h (CiA 301 7.5.2.4): the list of errors that a device keeps, the newest first -----


LONGEST = 254


class ErrorEntry(NamedTuple):
    """One entry: ``number`` from 1 for the newest, the error code, and 16 manufacturer-specific bits."""

    number: int
    code: int
    additional: int

    def __str__(self) -> str:
        more = f", additional information 0x{self.additional:04X}" if self.additional else ""
        return f"{self.number}. {describe(self.code)}{more}"


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
