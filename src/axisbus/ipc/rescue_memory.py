"""The data for a rescue after the death of a core, in shared memory: the stage of the core, and the last frames with a controlword.

Theory of operation
-------------------
A drive is stopped by the last frame that it got, with another controlword. Any other value in the frame, such as a target, is one
that the drive already has. Only offsets of feed-forward become 0, because they belong to a motion that is over. The core stores
each such frame here when the adapter has accepted it. A table that is made once contains the location of the controlword and of the
offsets in it. A frame is copied in one piece of eight bytes: a reader after the core's death never finds half a frame.
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
NO_WORD = 0xFF  # the shift of an RPDO without a controlword
_NO_FRAME = 0xFFFF_FFFF  # for an axis without a controlword in any RPDO


class CoreStage(IntEnum):
    """The stage of a core's life."""

    OPENING = 0
    RUNNING = 1
    LEAVING = 2
    LEFT = 3
    LOST = 4  # its adapter has failed, and its scan has ended: it opens the adapter again to stop its drives
    WAITING = 5  # it has done so, as far as possible: it may open the adapter again on command
    RELEASING = 6  # it has stopped its axes, as far as possible: it ends its scan, and leaves its nodes


class RescueRpdo(NamedTuple):
    """An RPDO with a controlword, or offsets of feed-forward: its axis (by number), and the changes for a stop.

    ``shift``: number of bits before the controlword. ``zero``: the bits of offsets, which become 0.
    """

    axis: int
    cob_id: int = _NO_FRAME
    shift: int = 0
    zero: int = 0


class RescueTargets(NamedTuple):
    """The data for the stop: the axes (by number) that were commanded, and the frames of their quick stop."""

    axes: tuple[int, ...]
    frames: tuple[tuple[int, bytes], ...]


def size_of(axes: int) -> int:
    """Return the size in bytes of the lifeline of this number of axes."""
    return _HEAD.size + axes * _MOST * _ENTRY.size


class LifelineWriter:
    """Writes into ``memory``, from ``at`` on; for one thread at a time."""

    def __init__(self, memory: mmap.mmap, at: int) -> None:
        self._memory = memory
        self._at = at
        self._entries_of: dict[int, list[int]] = {}  # locations of the entries of an axis
        self._frames: dict[int, int] = {}  # location of the entry of a COB-ID
        self._count = 0

    def enter(self, rpdos: Sequence[RescueRpdo]) -> None:
        """Enter RPDOs, before anything is sent with them; they replace the earlier entries of their axes."""
        free = [
            entry_start
            for axis in {rpdo.axis for rpdo in rpdos}
            for entry_start in self._entries_of.pop(axis, ())
        ]
        for entry_start in free:
            _ENTRY.pack_into(self._memory, entry_start, _NO_FRAME, NO_WORD, 0, 0, 0, 0, b"")
        self._frames = {
            cob_id: entry_start for cob_id, entry_start in self._frames.items() if entry_start not in free
        }
        for rpdo in rpdos:
            entry_start = free.pop() if free else self._new_entry()
            _ENTRY.pack_into(
                self._memory, entry_start, rpdo.cob_id, rpdo.shift, 0, 0, rpdo.axis, rpdo.zero, b""
            )
            self._entries_of.setdefault(rpdo.axis, []).append(entry_start)
            self._frames[rpdo.cob_id] = entry_start
        _COUNT.pack_into(self._memory, self._at + _COUNT_AT, self._count)

    def _new_entry(self) -> int:
        self._count += 1
        return self._at + _HEAD.size + (self._count - 1) * _ENTRY.size

    def stage(self, stage: CoreStage) -> None:
        """Store the stage of the core."""
        self._memory[self._at] = stage

    def sent(self, frames: Mapping[int, bytes]) -> None:
        """Store the last frames, by their COB-IDs; frames that a stop does not change are skipped."""
        memory = self._memory
        for cob_id, data in frames.items():
            entry_start = self._frames.get(cob_id)
            if entry_start is not None:
                start = entry_start + _DATA_AT
                memory[start : start + 8] = data.ljust(8, b"\0")
                memory[entry_start + 5] = len(data)
                memory[entry_start + _FLAGS_AT] |= _SENT

    def touched(self, axis: int) -> None:
        """Store that an axis was commanded."""
        for entry_start in self._entries_of.get(axis, ()):
            self._memory[entry_start + _FLAGS_AT] |= _TOUCHED


def stage_of(memory: mmap.mmap, at: int) -> CoreStage:
    """Return the last stage of the core."""
    return CoreStage(memory[at])


def found(memory: mmap.mmap, at: int) -> RescueTargets:
    """Return the data for the stop."""
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
