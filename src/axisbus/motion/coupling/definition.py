"""The law of a coupling: the position of a slave as a function of its master's position, by gear or cam."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from enum import Enum
from typing import NamedTuple

from axisbus.motion.spline import SplineSegment


class SlaveReference(NamedTuple):
    """The slave's set-point, its derivative by the master's position (``slope``, unit per unit), and the slope's derivative."""

    position: float
    slope: float
    bend: float


@dataclass(frozen=True, slots=True)
class Gear:
    """The slave moves ``ratio`` units for one unit of its master; below 0 in the opposite direction."""

    ratio: float

    def at(self, master: float) -> SlaveReference:
        """Return the slave's set-point with its derivatives."""
        return SlaveReference(self.ratio * master, self.ratio, 0.0)

    def position(self, master: float) -> float:
        """Return the slave's set-point only, as each cycle needs it."""
        return self.ratio * master

    def accumulated_lift(self, _: float) -> float:
        """Return 0: a gear has no turns."""
        return 0.0


@dataclass(frozen=True, slots=True)
class CamLaw:
    """The curve of a cam: ``parts`` from the master's position ``first`` on; each part begins at its ``mark`` (starting at 0).

    ``period``: length of the cam in units of the master. If the cam repeats, each turn begins ``lift`` units of the slave farther.
    If it does not repeat (``lift`` None), the slave is at standstill before the cam's beginning and after its end.
    """

    first: float
    marks: tuple[float, ...]
    parts: tuple[SplineSegment, ...]
    period: float
    lift: float | None

    def at(self, master: float) -> SlaveReference:
        """Return the slave's set-point with its derivatives."""
        part, s, is_inside = self._found(master)
        if not is_inside:
            return SlaveReference(part.at(s), 0.0, 0.0)
        return SlaveReference(self.accumulated_lift(master) + part.at(s), part.speed_at(s), part.bend_at(s))

    def position(self, master: float) -> float:
        """Return the slave's set-point only, as each cycle needs it."""
        part, s, is_inside = self._found(master)
        return part.at(s) + (self.accumulated_lift(master) if is_inside else 0.0)

    def _found(self, master: float) -> tuple[SplineSegment, float, bool]:
        """Return the part for a position of the master, the distance along the part, and whether the master is within the cam."""
        along = master - self.first
        if self.lift is not None:
            along -= math.floor(along / self.period) * self.period
        within = min(max(along, 0.0), self.period)
        number = max(bisect_right(self.marks, within) - 1, 0)
        return self.parts[number], within - self.marks[number], within == along

    def accumulated_lift(self, master: float) -> float:
        """Return the distance of the slave over all completed turns of the cam."""
        return 0.0 if self.lift is None else math.floor((master - self.first) / self.period) * self.lift


Law = Gear | CamLaw


# ----------------------------------------------------------------------------------------------------------------------
# Options of a coupling as frozen values: the master's value to follow, and how the slave synchronises with its master.


class MasterValue(Enum):
    """The value of the master to follow: its commanded position or its actual position."""

    COMMAND = "command"
    ACTUAL = "actual"


@dataclass(frozen=True, slots=True)
class SyncAtSpeed:
    """MC_GearIn: the slave accelerates to the required speed with ``acceleration`` (unit/s²), and is then synchronised."""

    acceleration: float


@dataclass(frozen=True, slots=True)
class SyncAtPositions:
    """MC_GearInPos: slave at ``slave`` when master at ``master``; synchronise within ``master_distance`` units of the master."""

    master: float
    slave: float
    master_distance: float


@dataclass(frozen=True, slots=True)
class SyncFromPresent:
    """MC_CamIn: synchronise from the present positions within ``master_distance`` units of the master.

    0: the slave must be at its set-point. ``relative``: the slave's present position counts as its set-point.
    """

    master_distance: float = 0.0
    relative: bool = False


Entry = SyncAtSpeed | SyncAtPositions | SyncFromPresent
