"""SDO abort codes (CiA 301 table 22) with texts and hints for the user."""

from __future__ import annotations

from typing import NamedTuple

from axisbus.cia301.tables import rows


class AbortText(NamedTuple):
    """The meaning of an abort code, and a hint for the user of a CiA 402 master (may be empty)."""

    text: str
    hint: str


TOGGLE = 0x0503_0000
TIMED_OUT = 0x0504_0000
UNKNOWN_COMMAND = 0x0504_0001
WRONG_BLOCK_SIZE = 0x0504_0002
WRONG_SEQUENCE = 0x0504_0003
WRONG_CHECKSUM = 0x0504_0004
OUT_OF_MEMORY = 0x0504_0005
OBJECT_MISSING = 0x0602_0000
SUBINDEX_MISSING = 0x0609_0011
READ_ONLY = 0x0601_0002
WRITE_ONLY = 0x0601_0001
TOO_LONG = 0x0607_0012
TOO_SHORT = 0x0607_0013
GENERAL = 0x0800_0000
# The object exists, and the device may serve it later: general, under local control, in this device state.
BUSY = frozenset({0x0800_0020, 0x0800_0021, 0x0800_0022})
VALUE_REFUSED = frozenset({0x0609_0030, 0x0609_0031, 0x0609_0032})  # invalid, too high, too low


# Read on import: the first abort is explained while an axis is commanded, and the scan must not wait for a disk.
_TABLE = {int(row["code"], 16): AbortText(row["text"], row["hint"]) for row in rows(__package__, "abort.tsv")}


def explain(code: int) -> AbortText:
    """Return the standard's text for ``code``; the text for an unknown code says that it is specific to the device."""
    return _TABLE.get(code) or AbortText("not in CiA 301, specific to this device", "see the drive's manual")


def describe(code: int) -> str:
    """Return code and text in one line, such as ``0x06020000, Object does not exist in the object dictionary``."""
    return f"0x{code:08X}, {explain(code).text}"
