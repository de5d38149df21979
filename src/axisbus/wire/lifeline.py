"""What a rescue needs of a core that is gone, in shared memory: how far it was, and the last frames with a controlword.

Theory of operation
-------------------
A drive is stopped by the frame that it was sent last, with another controlword: any other value in it, such as a target, is one
that it has had already. The core puts each such frame here when it has been given to the adapter; a table made once says where in
it the controlword is. A frame is copied in one piece of eight bytes: one who reads after the core's death finds no half of one.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import NamedTuple

from axisbus.cia402.controlword import Command

_HEAD = struct.Struct("<BxHxxxx")  # stage, count of entries
_COUNT, _COUNT_AT = struct.Struct("<H"), 2
_ENTRY = struct.Struct("<IBBBB8s")  # COB-ID, shift of the controlword in bits, length, flags, axis, data
_DATA_AT = _ENTRY.size - 8
_FLAGS_AT = 6
_SENT, _TOUCHED = 1, 2
_MOST = 4  # RPDOs with a controlword for each axis
_WORD = 0xFFFF
_NO_FRAME = 0xFFFF_FFFF  # of an axis whose controlword no RPDO carries


class Stage(IntEnum):
    """How far a core is."""

    OPENING = 0
    RUNNING = 1
    LEAVING = 2
    LEFT = 3


class Held(NamedTuple):
    """An RPDO that holds a controlword: of which axis (by number), and how many bits before it are others'."""

    axis: int
    cob_id: int = _NO_FRAME
    shift: int = 0


class Found(NamedTuple):
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

    def enter(self, held: Sequence[Held]) -> None:
        """Enter RPDOs, before anything is sent by them."""
        for one in held:
            place = self._at + _HEAD.size + self._count * _ENTRY.size
            _ENTRY.pack_into(self._memory, place, one.cob_id, one.shift, 0, 0, one.axis, b"")
            self._places.setdefault(one.axis, []).append(place)
            self._frames[one.cob_id] = place
            self._count += 1
        _COUNT.pack_into(self._memory, self._at + _COUNT_AT, self._count)

    def stage(self, stage: Stage) -> None:
        """Say how far the core is."""
        self._memory[self._at] = stage

    def sent(self, frames: Mapping[int, bytes]) -> None:
        """Note the last frames, by their COB-IDs; those without a controlword are passed over."""
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


def stage_of(memory: mmap.mmap, at: int) -> Stage:
    """Return how far the core is, or was."""
    return Stage(memory[at])


def found(memory: mmap.mmap, at: int) -> Found:
    """Return what there is to stop."""
    _, count = _HEAD.unpack_from(memory, at)
    entries = [_ENTRY.unpack_from(memory, at + _HEAD.size + number * _ENTRY.size) for number in range(count)]
    axes = {axis: None for *_, flags, axis, _ in entries if flags & _TOUCHED}
    frames = [
        (cob_id, _quick_stop(data[:length], shift))
        for cob_id, shift, length, flags, _, data in entries
        if flags & _SENT
    ]
    return Found(tuple(axes), tuple(frames))


def _quick_stop(data: bytes, shift: int) -> bytes:
    """Return the frame with the controlword of a quick stop."""
    raw = int.from_bytes(data, "little") & ~(_WORD << shift)
    return (raw | Command.QUICK_STOP.word << shift).to_bytes(len(data), "little")
