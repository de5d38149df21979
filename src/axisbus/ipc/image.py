"""The process image of a cycle in shared memory: the snapshots of all axes, of one cycle, for any number of readers.

Theory of operation
-------------------
The writer never waits: it fills one slot after the other and then publishes the number of the newest. A slot begins and ends with
its number. A reader copies the newest slot and compares both numbers. If the writer has changed the slot meanwhile, which needs a
full round through all slots, the reader repeats this. A slow, stopped or faulty reader can thus disturb no other process.

Errors are texts of any length: the image contains the number of an axis's error; the error itself is sent separately
(``messages.ErrorMessage``).
"""

from __future__ import annotations

import mmap
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from axisbus.cia402.state import PowerState
from axisbus.errors import AxisbusError
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import AxisState

_SLOTS = 8
_TRIES = 100
_NUMBER = struct.Struct("<Q")
_BEGIN = struct.Struct("<Qd")  # of a slot: its number, and the start of the cycle
_AXIS = struct.Struct("<ddddqqqqqqqqQIHBB")
_HEAD = 64  # bytes: the newest number, and reserve
_STATES, _POWERS = tuple(AxisState), tuple(PowerState)
_STATE_AT = {state: number for number, state in enumerate(_STATES)}
_POWER_AT = {power: number for number, power in enumerate(_POWERS)}
_THERE, _HOMED, _OPERATIONAL, _DEMAND_LEADS = 0x100, 0x200, 0x400, 0x800
# The values that may be unknown, each with its bit; in the order of the structure.
_STATUSWORD, _MODE, _POSITION, _DEMAND, _VELOCITY, _TORQUE, _TARGET = (1 << bit for bit in range(7))

ErrorOf = Callable[[int], AxisbusError | None]


def size_of(axes: int) -> int:
    """Return the size in bytes of the image of this number of axes."""
    return _HEAD + _SLOTS * _slot(axes)


def _slot(axes: int) -> int:
    return _BEGIN.size + axes * _AXIS.size + _NUMBER.size


def number_of(memory: mmap.mmap) -> int:
    """Return the number of images written."""
    number: int = _NUMBER.unpack_from(memory, 0)[0]
    return number


class ImageWriter:
    """Writes images into ``memory``; for one thread. Holds the number of the newest."""

    def __init__(self, memory: mmap.mmap, names: Sequence[str]) -> None:
        """``names``: every axis that may come, in order."""
        self._memory = memory
        self._names = tuple(names)
        self._slot = _slot(len(names))
        self._number = 0

    def write(self, now: float, snapshots: Mapping[str, Snapshot], errors: Mapping[str, int]) -> None:
        """Write the image of the cycle at ``now`` (s, monotonic); ``errors``: the number of each axis's error (none: 0)."""
        self._number = number = self._number + 1
        memory, at = self._memory, _HEAD + number % _SLOTS * self._slot
        _BEGIN.pack_into(memory, at, 0, now)
        entry_start = at + _BEGIN.size
        for name in self._names:
            _put(memory, entry_start, snapshots.get(name), errors.get(name, 0))
            entry_start += _AXIS.size
        _NUMBER.pack_into(memory, entry_start, number)
        _NUMBER.pack_into(memory, at, number)
        _NUMBER.pack_into(memory, 0, number)

    @property
    def newest(self) -> bytes:
        """The newest image as bytes, which ``ImageReader.image`` reads."""
        at = _HEAD + self._number % _SLOTS * self._slot
        return self._memory[at : at + self._slot]


class ImageReader:
    """Reads images from ``memory``; for any thread of any process."""

    def __init__(self, memory: mmap.mmap, names: Sequence[str], error_of: ErrorOf) -> None:
        """``names`` as those of the writer; ``error_of`` returns an error by its number."""
        self._memory = memory
        self._entry_starts = {
            name: _BEGIN.size + entry_start * _AXIS.size for entry_start, name in enumerate(names)
        }
        self._slot = _slot(len(names))
        self._error_of = error_of
        self._last = CellImage(b"", {}, error_of)

    @property
    def number(self) -> int:
        """The number of images written."""
        return number_of(self._memory)

    def read(self) -> CellImage:
        """Return the newest image; if the writer is repeatedly too fast for that, the previous one."""
        for _ in range(_TRIES):
            number = self.number
            at = _HEAD + number % _SLOTS * self._slot
            found = self._memory[at : at + self._slot]
            if not number:
                break
            if (
                _NUMBER.unpack_from(found, 0)[0]
                == number
                == _NUMBER.unpack_from(found, self._slot - _NUMBER.size)[0]
            ):
                self._last = self.image(found)
                break
        return self._last

    def image(self, data: bytes) -> CellImage:
        """Return the image from its bytes."""
        return CellImage(data, self._entry_starts, self._error_of)


class CellImage(Mapping[str, Snapshot]):
    """The axes of one cycle by name; each snapshot is made when it is read."""

    __slots__ = ("_data", "_entry_starts", "_error_of")

    def __init__(self, data: bytes, entry_starts: Mapping[str, int], error_of: ErrorOf) -> None:
        self._data = data
        self._entry_starts = entry_starts
        self._error_of = error_of

    def __getitem__(self, name: str) -> Snapshot:
        """Return an axis; raises KeyError if it is absent."""
        values = _AXIS.unpack_from(self._data, self._entry_starts[name])
        if not values[-3] & _THERE:
            raise KeyError(name)
        return _snapshot(values, self._error_of)

    @property
    def time(self) -> float:
        """Start of the cycle, in seconds of the monotonic clock; 0 if there was none."""
        time: float = _BEGIN.unpack_from(self._data)[1] if self._data else 0.0
        return time

    def __iter__(self) -> Iterator[str]:
        return (name for name in self._entry_starts if name in self)

    def __len__(self) -> int:
        return sum(1 for _ in self)

    def __contains__(self, name: object) -> bool:
        entry_start = self._entry_starts.get(name)  # type: ignore[call-overload]
        return entry_start is not None and bool(_AXIS.unpack_from(self._data, entry_start)[-3] & _THERE)


def _put(memory: mmap.mmap, entry_start: int, axis: Snapshot | None, error: int) -> None:
    if axis is None:
        _AXIS.pack_into(memory, entry_start, *(0,) * 17)
        return
    (
        now,
        state,
        power,
        word,
        mode,
        position,
        stamp,
        demand,
        velocity,
        torque,
        target,
        origin,
        homed,
        operational,
        _,
        override,
        cell_override,
        latched,
        demand_leads,
    ) = axis
    flags = _THERE | (_HOMED if homed else 0) | (_OPERATIONAL if operational else 0)
    flags |= _DEMAND_LEADS if demand_leads else 0
    flags |= (
        (word is not None and _STATUSWORD)
        | (mode is not None and _MODE)
        | (position is not None and _POSITION)
        | (demand is not None and _DEMAND)
        | (velocity is not None and _VELOCITY)
        | (torque is not None and _TORQUE)
        | (target is not None and _TARGET)
    )
    _AXIS.pack_into(
        memory,
        entry_start,
        now,
        stamp,
        override,
        cell_override,
        word or 0,
        mode or 0,
        position or 0,
        demand or 0,
        velocity or 0,
        torque or 0,
        target or 0,
        origin,
        latched,
        error,
        flags,
        _STATE_AT[state],
        _POWER_AT[power],
    )


def _snapshot(values: tuple[Any, ...], error_of: ErrorOf) -> Snapshot:
    now, stamp, own, cell, word, mode, position, demand, velocity, torque, *rest = values
    target, origin, latched, error, flags, state, power = rest
    return Snapshot(
        now,
        _STATES[state],
        _POWERS[power],
        word if flags & _STATUSWORD else None,
        mode if flags & _MODE else None,
        position if flags & _POSITION else None,
        stamp,
        demand if flags & _DEMAND else None,
        velocity if flags & _VELOCITY else None,
        torque if flags & _TORQUE else None,
        target if flags & _TARGET else None,
        origin,
        bool(flags & _HOMED),
        bool(flags & _OPERATIONAL),
        error_of(error) if error else None,
        own,
        cell,
        latched,
        bool(flags & _DEMAND_LEADS),
    )
