"""What was seen of some axes, cycle by cycle, packed into blocks of bytes.

However many there are, they are nothing that Python's collector has to look at: a recording of an hour pauses no cycle. One thread
appends, others may read meanwhile what was there when they began.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from struct import Struct
from typing import NamedTuple

from axisbus.motion.snapshot import Snapshot
from axisbus.motion.states import AxisState

BLOCK = 4096  # rows
_AXIS = "qqqqqBB"  # position, velocity, torque, target, origin; which of the first four are known; the state
_STATES = tuple(AxisState)
_NUMBERS = {state: number for number, state in enumerate(_STATES)}


class AxisSample(NamedTuple):
    """An axis in one cycle, in the drive's increments and units; None is unknown."""

    position: int | None
    velocity: int | None
    torque: int | None
    target: int | None
    origin: int
    state: AxisState


class PackedRows:
    """Rows of one time and the samples of ``axes`` axes each; holds ``limit`` rows, and up to a block more."""

    def __init__(self, axes: int, limit: int) -> None:
        self._row = Struct("<d" + _AXIS * axes)
        self._most = -(-limit // BLOCK) + 1
        self._blocks: dict[int, bytearray] = {}
        self._end = 0  # rows so far, with those that have gone

    def __len__(self) -> int:
        return self._end - BLOCK * next(iter(self._blocks.copy()), 0)

    def append(self, now: float, snapshots: Sequence[Snapshot]) -> None:
        """Keep a row; the oldest block goes where there are too many."""
        block, place = divmod(self._end, BLOCK)
        if not place:
            self._blocks[block] = bytearray(BLOCK * self._row.size)
            self._blocks.pop(block - self._most, None)
        values: list[float] = [now]
        for snapshot in snapshots:
            values += _packed(snapshot)
        self._row.pack_into(self._blocks[block], place * self._row.size, *values)
        self._end += 1

    def __iter__(self) -> Iterator[tuple[float, list[AxisSample]]]:
        """Yield what is there now, oldest first."""
        end, blocks = self._end, self._blocks.copy()
        for number, block in blocks.items():
            used = min(BLOCK, end - number * BLOCK)
            for row in self._row.iter_unpack(memoryview(block)[: max(0, used) * self._row.size]):
                yield row[0], [_sample(*row[at : at + len(_AXIS)]) for at in range(1, len(row), len(_AXIS))]


def _packed(snapshot: Snapshot) -> tuple[int, ...]:
    position, velocity, torque, target = (
        snapshot.position,
        snapshot.velocity,
        snapshot.torque,
        snapshot.target,
    )
    known = (
        (position is not None)
        | (velocity is not None) << 1
        | (torque is not None) << 2
        | (target is not None) << 3
    )
    state = _NUMBERS[snapshot.state]
    return position or 0, velocity or 0, torque or 0, target or 0, snapshot.origin, known, state


def _sample(
    position: int, velocity: int, torque: int, target: int, origin: int, known: int, state: int
) -> AxisSample:
    return AxisSample(
        position if known & 1 else None,
        velocity if known & 2 else None,
        torque if known & 4 else None,
        target if known & 8 else None,
        origin,
        _STATES[state],
    )
