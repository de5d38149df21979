"""Samples of some axes, packed cycle by cycle into bytes.

Python's garbage collector does not inspect packed samples, so that an hour of recording pauses no cycle. One thread appends; others
may read meanwhile the rows that existed when they began.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from struct import Struct
from typing import NamedTuple

from axisbus.cia402.state import PowerState
from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import AxisState

BLOCK = 4096  # rows
_AXIS = "qqqqqqhHBBB"  # the values in the order of AxisSample; then the state, the power, and the bits for known values
_STATES, _POWERS = tuple(AxisState), tuple(PowerState)
_STATE_AT = {state: number for number, state in enumerate(_STATES)}
_POWER_AT = {power: number for number, power in enumerate(_POWERS)}
# One bit for each value that may be unknown, and one for whether the axis is homed.
_POSITION, _VELOCITY, _TORQUE, _TARGET, _DEMAND, _MODE, _STATUSWORD, _HOMED = (1 << bit for bit in range(8))


class AxisSample(NamedTuple):
    """An axis in one cycle, in the drive's increments and units; None is unknown."""

    position: int | None
    velocity: int | None
    torque: int | None
    target: int | None
    demand: int | None
    origin: int
    mode: int | None
    statusword: int | None
    state: AxisState
    power: PowerState
    homed: bool


class RowForm:
    """The packing of a row: one time and the samples of a number of axes."""

    def __init__(self, axes: int) -> None:
        self.struct = Struct("<d" + _AXIS * axes)

    def values(self, now: float, snapshots: Sequence[Snapshot]) -> list[float]:
        """Return the values of a cycle for ``struct``."""
        values: list[float] = [now]
        for snapshot in snapshots:
            values += _packed(snapshot)
        return values

    def rows(self, data: bytes | memoryview) -> Iterator[tuple[float, list[AxisSample]]]:
        """Yield the rows in these bytes."""
        for row in self.struct.iter_unpack(data):
            yield row[0], [_sample(*row[at : at + len(_AXIS)]) for at in range(1, len(row), len(_AXIS))]


class PackedRows:
    """Rows of ``axes`` axes each; holds ``limit`` rows, and up to a block more."""

    def __init__(self, axes: int, limit: int) -> None:
        self._form = RowForm(axes)
        self._size = self._form.struct.size
        self._most = -(-limit // BLOCK) + 1
        self._blocks: dict[int, bytearray] = {}
        self._end = 0  # rows so far, including dropped ones

    def __len__(self) -> int:
        return self._end - BLOCK * next(iter(self._blocks.copy()), 0)

    def append(self, now: float, snapshots: Sequence[Snapshot]) -> None:
        """Store a row; drop the oldest block if there are too many."""
        block, row = divmod(self._end, BLOCK)
        if not row:
            self._blocks[block] = bytearray(BLOCK * self._size)
            self._blocks.pop(block - self._most, None)
        self._form.struct.pack_into(self._blocks[block], row * self._size, *self._form.values(now, snapshots))
        self._end += 1

    def __iter__(self) -> Iterator[tuple[float, list[AxisSample]]]:
        """Yield the present rows, oldest first."""
        end, blocks = self._end, self._blocks.copy()
        for number, block in blocks.items():
            used = min(BLOCK, end - number * BLOCK)
            yield from self._form.rows(memoryview(block)[: max(0, used) * self._size])


def sample_of(snapshot: Snapshot) -> AxisSample:
    """Return the recorded values of an axis in a cycle."""
    _, state, power, word, mode, position, _, demand, velocity, torque, target, origin, homed, *_ = snapshot
    return AxisSample(position, velocity, torque, target, demand, origin, mode, word, state, power, homed)


def _packed(snapshot: Snapshot) -> tuple[int, ...]:
    _, state, power, word, mode, position, _, demand, velocity, torque, target, origin, homed, *_ = snapshot
    known = (
        (position is not None and _POSITION)
        | (velocity is not None and _VELOCITY)
        | (torque is not None and _TORQUE)
        | (target is not None and _TARGET)
        | (demand is not None and _DEMAND)
        | (mode is not None and _MODE)
        | (word is not None and _STATUSWORD)
        | (homed and _HOMED)
    )
    return (
        position or 0,
        velocity or 0,
        torque or 0,
        target or 0,
        demand or 0,
        origin,
        mode or 0,
        word or 0,
        _STATE_AT[state],
        _POWER_AT[power],
        known,
    )


def _sample(
    position: int,
    velocity: int,
    torque: int,
    target: int,
    demand: int,
    origin: int,
    mode: int,
    word: int,
    state: int,
    power: int,
    known: int,
) -> AxisSample:
    return AxisSample(
        position if known & _POSITION else None,
        velocity if known & _VELOCITY else None,
        torque if known & _TORQUE else None,
        target if known & _TARGET else None,
        demand if known & _DEMAND else None,
        origin,
        mode if known & _MODE else None,
        word if known & _STATUSWORD else None,
        _STATES[state],
        _POWERS[power],
        bool(known & _HOMED),
    )
