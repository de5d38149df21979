"""What a rescue needs of a core that is gone, in shared memory: how far it was, and the last frames with a controlword.

Theory of operation
-------------------
A drive is stopped by the frame that it was sent last, with another controlword: any other value in it, such as a target, is one
that it has had already. Offsets of feed-forward alone become 0: they belong to a motion that is over. The core puts each such
frame here when it has been given to the adapter; a table made once says where in it the controlword is, and the offsets. A frame is
copied in one piece of eight bytes: one who reads after the core's death finds no half of one.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import NamedTuple

from axisbus.cia402.controlword import PowerCommand

_HEAD = struct.Struct("<BxHxxxx")  # stage, count of entries
_COUNT, _COUNT_AT = struct.Struct("<H"), 2
# COB-ID, shift of the controlword in bits, length, flags, axis, bits that become 0, data
_ENTRY = struct.Struct("<IBBBBQ8s")
_DATA_AT = _ENTRY.size - 8
_FLAGS_AT = 6
_SENT, _TOUCHED = 1, 2
_MOST = 6  # RPDOs with a controlword or an offset for each axis
_WORD = 0xFFFF
NO_WORD = 0xFF  # the shift where an RPDO holds no controlword
_NO_FRAME = 0xFFFF_FFFF  # of an axis whose controlword no RPDO carries


class CoreStage(IntEnum):
    """How far a core is."""

    OPENING = 0
    RUNNING = 1
    LEAVING = 2
    LEFT = 3


class RescueRpdo(NamedTuple):
    """An RPDO that holds a controlword, or offsets of feed-forward: of which axis (by number), and what a stop changes in it.

    ``shift``: how many bits before the controlword are others'. ``zero``: the bits of offsets, which become 0.
    """

    axis: int
    cob_id: int = _NO_FRAME
    shift: int = 0
    zero: int = 0


class RescueTargets(NamedTuple):
    """What there is to stop: the axes (by number) that were commanded, and the frames of their quick stop."""

    axes: tuple[int, ...]
    frames: tuple[tuple[int, bytes], ...]


def size_of(axes: int) -> int:
    """Return how many bytes the lifeline of so many axes takes."""
    return _HEAD.size + axes * _MOST * _ENTRY.size


class LifelineWriter:
    """Writes into ``memory`` from ``at`` on; for one thread at a time."""

    def __init__(self, memory: mmap.mmap, at: int) -> None:
        self._memory = memory
        self._at = at
        self._places: dict[int, list[int]] = {}  # of the entries of an axis
        self._frames: dict[int, int] = {}  # of the entry of a COB-ID
        self._count = 0

    def enter(self, held: Sequence[RescueRpdo]) -> None:
        """Enter RPDOs, before anything is sent by them."""
        for one in held:
            place = self._at + _HEAD.size + self._count * _ENTRY.size
            _ENTRY.pack_into(self._memory, place, one.cob_id, one.shift, 0, 0, one.axis, one.zero, b"")
            self._places.setdefault(one.axis, []).append(place)
            self._frames[one.cob_id] = place
            self._count += 1
        _COUNT.pack_into(self._memory, self._at + _COUNT_AT, self._count)

    def stage(self, stage: CoreStage) -> None:
        """Say how far the core is."""
        self._memory[self._at] = stage

    def sent(self, frames: Mapping[int, bytes]) -> None:
        """Note the last frames, by their COB-IDs; those in which a stop changes nothing are passed over."""
        memory = self._memory
        for cob_id, data in frames.items():
            place = self._frames.get(cob_id)
            if place is not None:
                start = place + _DATA_AT
                memory[start : start + 8] = data.ljust(8, b"\0")
                memory[place + 5] = len(data)
                memory[place + _FLAGS_AT] |= _SENT

    def touched(self, axis: int) -> None:
        """Note that an axis was commanded."""
        for place in self._places.get(axis, ()):
            self._memory[place + _FLAGS_AT] |= _TOUCHED


def stage_of(memory: mmap.mmap, at: int) -> CoreStage:
    """Return how far the core is, or was."""
    return CoreStage(memory[at])


def found(memory: mmap.mmap, at: int) -> RescueTargets:
    """Return what there is to stop."""
    _, count = _HEAD.unpack_from(memory, at)
    entries = [_ENTRY.unpack_from(memory, at + _HEAD.size + number * _ENTRY.size) for number in range(count)]
    axes = {axis: None for *_, flags, axis, _, _ in entries if flags & _TOUCHED}
    frames = [
        (cob_id, _quick_stop(data[:length], shift, zero))
        for cob_id, shift, length, flags, _, zero, data in entries
        if flags & _SENT
    ]
    return RescueTargets(tuple(axes), tuple(frames))


def _quick_stop(data: bytes, shift: int, zero: int) -> bytes:
    """Return the frame with the controlword of a quick stop, and without offsets."""
    raw = int.from_bytes(data, "little") & ~zero
    if shift != NO_WORD:
        raw = raw & ~(_WORD << shift) | PowerCommand.QUICK_STOP.word << shift
    return raw.to_bytes(len(data), "little")
