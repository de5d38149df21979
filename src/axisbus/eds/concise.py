"""The concise DCF of CiA 302-3: the writes that configure a node, as the octets of 1F22h.

Theory of operation. The stream contains the number of entries (4 octets), and for each entry index (2), sub-index (1), size (4) and
data, all little endian. A device executes the writes in their order; ``configuration`` determines the right order.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable
from typing import NamedTuple

from axisbus.errors import EdsError
from axisbus.wording import counted

_COUNT = struct.Struct("<I")
_HEAD = struct.Struct("<HBI")


class ConciseWrite(NamedTuple):
    """One write to a device: ``data`` as SDO sends it, little endian."""

    index: int  # type: ignore[assignment]  # hides tuple.index, which is not used
    subindex: int
    data: bytes


def encode(writes: Iterable[ConciseWrite]) -> bytes:
    """Return the stream of these writes, in their order."""
    all_writes = tuple(writes)
    parts = [_COUNT.pack(len(all_writes))]
    for write in all_writes:
        parts += (_HEAD.pack(write.index, write.subindex, len(write.data)), write.data)
    return b"".join(parts)


class DecodedStream(NamedTuple):
    """The decoded parts of a stream: the number of entries in its head, the complete writes, and the number of remaining octets."""

    declared: int
    writes: tuple[ConciseWrite, ...]
    remaining: int


def decode_leniently(data: bytes) -> DecodedStream:
    """Return the complete writes of a stream, whatever number its head contains; never raises."""
    if len(data) < _COUNT.size:
        return DecodedStream(0, (), len(data))
    (count,) = _COUNT.unpack_from(data)
    writes, at = [], _COUNT.size
    while (write := _complete_write(data, at)) is not None:
        writes.append(write)
        at += _HEAD.size + len(write.data)
    return DecodedStream(count, tuple(writes), len(data) - at)


def _complete_write(data: bytes, at: int) -> ConciseWrite | None:
    """Return the entry at an octet, None if it is incomplete."""
    start = at + _HEAD.size
    if start > len(data):
        return None
    index, subindex, size = _HEAD.unpack_from(data, at)
    return ConciseWrite(index, subindex, data[start : start + size]) if start + size <= len(data) else None


def decode(data: bytes, source: str = "") -> tuple[ConciseWrite, ...]:
    """Return the writes of a stream, in their order; ``source`` is the name in messages.

    Raises:
        EdsError: the stream is incomplete, or its number of entries is wrong.
    """
    if len(data) < _COUNT.size:
        raise _broken(source, f"it has {counted(len(data), 'octet')}, the number of entries alone takes 4")
    count, complete, _ = decode_leniently(data)
    writes = complete[:count]
    at = _COUNT.size + sum(_HEAD.size + len(write.data) for write in writes)
    if len(writes) < count and at < len(data):
        raise _broken(source, f"entry {len(writes) + 1} {_cut_off(data, at)}")
    if len(writes) < count or at < len(data):
        raise _broken(
            source,
            f"it says {counted(count, 'entry', 'entries')}, and holds {len(writes)} "
            f"and {counted(len(data) - at, 'octet')} more",
        )
    return writes


def _cut_off(data: bytes, at: int) -> str:
    left = len(data) - at - _HEAD.size
    if left < 0:
        return f"at octet {at} is cut off in its head"
    index, subindex, size = _HEAD.unpack_from(data, at)
    return f"({index:04X}h:{subindex:02X}) has {left} of {counted(size, 'octet')}"


def _broken(source: str, observed: str) -> EdsError:
    return EdsError(
        "this is not a complete concise DCF",
        file=source,
        observed=observed,
        remedy="make it again from the DCF, or read it again from 1F22h",
    )
