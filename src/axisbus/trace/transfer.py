"""The state of one SDO transfer on the bus, and the fields of its frames (CiA 301 7.2.4.3)."""

from __future__ import annotations

import binascii
from dataclasses import dataclass, field
from enum import Enum

from axisbus.trace.decoded import DecodedSdo
from axisbus.wording import counted


class TransferPhase(Enum):
    """The phase of a transfer; block data need it, because their segments have no command specifier."""

    ASKED = "asked"
    SEGMENTS = "segments"
    BLOCK = "block"
    BLOCK_END = "end of block transfer"


@dataclass(slots=True)
class TracedTransfer:
    """One transfer; holds state: its phase and the bytes so far."""

    index: int
    subindex: int
    write: bool
    asked: float
    phase: TransferPhase = TransferPhase.ASKED
    size: int | None = None
    data: bytearray = field(default_factory=bytearray)
    toggle: int = 0
    block: dict[int, bytes] = field(default_factory=dict)
    last: bool = False
    checked: bool = False  # both sides offered the CRC


@dataclass(frozen=True, slots=True)
class TransferText:
    """The contents of one frame: the object (None: unknown), the transfer's step, and the value if the frame completes it.

    ``sized``: the length of ``value`` was given. ``settled``: the object now has this value.
    """

    sdo: DecodedSdo
    address: tuple[int, int] | None = None
    value: bytes | None = None
    sized: bool = True
    settled: bool = False
    note: str = ""
    problem: str = ""


def address(data: bytes) -> tuple[int, int]:
    """Return index and sub-index of a frame that has a multiplexer."""
    return data[1] | data[2] << 8, data[3]


def expedited(data: bytes) -> tuple[bytes | None, bool]:
    """Return the bytes of an expedited transfer and whether their number was given; None if the data come in segments."""
    if not data[0] & 2:
        return None, False
    if not data[0] & 1:
        return bytes(data[4:8]), False
    return bytes(data[4 : 8 - (data[0] >> 2 & 3)]), True


def size(data: bytes, given: bool) -> int | None:
    """Return the announced number of bytes; None if it is not ``given``."""
    return int.from_bytes(data[4:8], "little") if given else None


def toggled(transfer: TracedTransfer, command: int, *, turn: bool = True, last: int = 0) -> str:
    """Check the toggle bit; ``turn``: the bit changes after this frame, ``last`` 1: it has changed already."""
    expected = transfer.toggle ^ last
    bit = command >> 4 & 1
    if turn:
        transfer.toggle ^= 1
    return f"toggle bit {bit} where {expected} was due" if bit != expected else ""


def trim(transfer: TracedTransfer, data: bytes) -> str:
    """Remove the padding of the last segment, and check the CRC if both sides offered one."""
    unused = data[0] >> 2 & 7
    if unused:
        del transfer.data[-unused:]
    if not transfer.checked:
        return ""
    given, computed = data[1] | data[2] << 8, binascii.crc_hqx(bytes(transfer.data), 0)
    return f"CRC 0x{given:04X} where the data have 0x{computed:04X}" if given != computed else ""


def length(transfer: TracedTransfer) -> str:
    """Return the difference between announced and actual length; empty if there is none."""
    if transfer.size is None or transfer.size == len(transfer.data):
        return ""
    return f"{counted(len(transfer.data), 'byte')} came, announced were {transfer.size}"
