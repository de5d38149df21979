"""The state of inputs and outputs after each cycle, in shared memory after the image of the axes and the lifeline.

Theory of operation
-------------------
As with the axes (``ipc.image``): the writer never waits, a slot begins and ends with its number, and a reader compares both. After
the death of a core, its watchdog process finds here the outputs that had been set, and their values.
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Mapping, Sequence

from axisbus.cia401.port import SignalValidity
from axisbus.ipc import image, rescue_memory
from axisbus.motion.io import IoReading

_SLOTS = 8
_TRIES = 100
_NUMBER = struct.Struct("<Q")
_POINT = struct.Struct("<dqdBB6x")  # time of the cycle, value, stamp, flags, why it is unknown
_THERE, _HAS_VALUE, _SET = 1, 2, 4
_KNOWN = tuple(SignalValidity)
_AT = {known: number for number, known in enumerate(_KNOWN)}


def offset(axes: int) -> int:
    """Return its start in the memory of a machine with this number of axes."""
    return image.size_of(axes) + rescue_memory.size_of(axes)


def size_of(points: int) -> int:
    """Return the size in bytes for this number of inputs and outputs."""
    return _NUMBER.size + _SLOTS * _slot(points)


def _slot(points: int) -> int:
    return 2 * _NUMBER.size + points * _POINT.size


class IoImage:
    """Writes and reads the readings in ``memory``; one thread writes, any thread of any process reads. Holds the newest number."""

    def __init__(self, memory: mmap.mmap, axes: int, names: Sequence[str]) -> None:
        """``axes``: number of axes of the machine; ``names`` of all its inputs and outputs, in order."""
        self._memory = memory
        self._at = offset(axes)
        self._names = tuple(names)
        self._slot = _slot(len(names))
        self._number = 0
        self._last: dict[str, IoReading] = {}

    def write(self, readings: Mapping[str, IoReading]) -> None:
        """Write the readings after a cycle."""
        if not self._names:
            return
        self._number = number = self._number + 1
        at = self._slot_start(number)
        _NUMBER.pack_into(self._memory, at, 0)
        entry_start = at + _NUMBER.size
        for name in self._names:
            _put(self._memory, entry_start, readings.get(name))
            entry_start += _POINT.size
        _NUMBER.pack_into(self._memory, entry_start, number)
        _NUMBER.pack_into(self._memory, at, number)
        _NUMBER.pack_into(self._memory, self._at, number)

    def read(self) -> dict[str, IoReading]:
        """Return the newest readings; if the writer is repeatedly too fast for that, the previous ones."""
        for _ in range(_TRIES if self._names else 0):
            number: int = _NUMBER.unpack_from(self._memory, self._at)[0]
            if not number:
                break
            at = self._slot_start(number)
            data = self._memory[at : at + self._slot]
            ends = _NUMBER.unpack_from(data, 0)[0], _NUMBER.unpack_from(data, self._slot - _NUMBER.size)[0]
            if ends == (number, number):
                self._last = self._readings(data)
                break
        return self._last

    def _slot_start(self, number: int) -> int:
        return self._at + _NUMBER.size + number % _SLOTS * self._slot

    def _readings(self, data: bytes) -> dict[str, IoReading]:
        found = {}
        for entry_start, name in enumerate(self._names):
            now, value, stamp, flags, known = _POINT.unpack_from(
                data, _NUMBER.size + entry_start * _POINT.size
            )
            if flags & _THERE:
                has = value if flags & _HAS_VALUE else None
                found[name] = IoReading(now, _KNOWN[known], has, stamp, bool(flags & _SET))
        return found


def _put(memory: mmap.mmap, entry_start: int, reading: IoReading | None) -> None:
    if reading is None:
        _POINT.pack_into(memory, entry_start, 0.0, 0, 0.0, 0, 0)
        return
    flags = _THERE | (_HAS_VALUE if reading.value is not None else 0) | (_SET if reading.set else 0)
    _POINT.pack_into(
        memory, entry_start, reading.now, reading.value or 0, reading.stamp, flags, _AT[reading.known]
    )
