"""Cells with a virtual axis ``v``, and its values in each cycle: an axis without a plant is known by its values alone."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

from axisbus.machine.axis import Axis
from axisbus.motion.snapshot import Snapshot
from kit.cell import Cell

PERIOD = 0.01  # s
HARDEST = 500.0  # deg/s² of v's ramps, if its cell does not say another
VIRTUAL = """
[axes.v]
virtual = true
unit = "deg"
{axis}
[axes.v.defaults]
velocity = 100.0
acceleration = 500.0
[axes.v.stop]
{stop}
"""


def virtual(axis: str = "max_velocity = 400.0", stop: str = "") -> str:
    """Return the tables of ``v``: lines of its own table, and of that of its stop."""
    return VIRTUAL.format(axis=axis, stop=stop)


class Trail:
    """Where a virtual axis was in each cycle, in its unit and seconds."""

    def __init__(self, cell: Cell, name: str = "v") -> None:
        self.axis: Axis = cell[name]
        self.times: list[float] = []
        self.positions: list[float] = []
        self._name, self._scale = name, cell.scale_of(name)
        cell.each_cycle(self._note)

    def _note(self, now: float, snapshots: Mapping[str, Snapshot]) -> None:
        seen = snapshots[self._name]
        assert seen.position is not None
        self.times.append(now)
        self.positions.append((seen.position - seen.origin) / self._scale)

    @property
    def speeds(self) -> list[float]:
        """From cycle to cycle, per second of motion: one period each."""
        return [(after - before) / PERIOD for before, after in pairwise(self.positions)]

    @property
    def hardest(self) -> float:
        """The hardest change of speed from cycle to cycle, per s²."""
        return max((abs(after - before) / PERIOD for before, after in pairwise(self.speeds)), default=0.0)

    def must_be_smooth(self, hardest: float = HARDEST) -> None:
        """Its targets never exceeded its ramps: a slave could follow. Positions are whole increments."""
        rounding = 4.0 / self._scale / PERIOD**2
        assert self.hardest <= hardest * 1.001 + rounding, f"{self.hardest:g} deg/s²"
