"""Where a slave is to be for a place of its master: by a gear, or by a cam."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass
from typing import NamedTuple

from axisbus.motion.spline import SplineSegment


class SlaveReference(NamedTuple):
    """Where the slave is due, and how that changes with the master: its slope (unit per unit), and how the slope does."""

    place: float
    slope: float
    bend: float


@dataclass(frozen=True, slots=True)
class Gear:
    """The slave goes ``ratio`` units for one unit of its master; below 0 the other way."""

    ratio: float

    def at(self, master: float) -> SlaveReference:
        """Return where the slave is due."""
        return SlaveReference(self.ratio * master, self.ratio, 0.0)

    def place(self, master: float) -> float:
        """Return that place alone: what is asked for in every cycle."""
        return self.ratio * master

    def raised(self, _: float) -> float:
        """Return how far its turns have taken the slave: a gear counts none."""
        return 0.0


@dataclass(frozen=True, slots=True)
class CamLaw:
    """The curve of a cam: ``parts`` from the master's place ``first`` on, each of which begins at its ``mark`` (from 0 on).

    ``period``: how long the cam is, in units of the master. Where it repeats, each turn begins ``lift`` units of the slave farther;
    where it does not (``lift`` None), the slave rests before its beginning and beyond its end.
    """

    first: float
    marks: tuple[float, ...]
    parts: tuple[SplineSegment, ...]
    period: float
    lift: float | None

    def at(self, master: float) -> SlaveReference:
        """Return where the slave is due."""
        part, s, inside = self._found(master)
        if not inside:
            return SlaveReference(part.at(s), 0.0, 0.0)
        return SlaveReference(self.raised(master) + part.at(s), part.speed_at(s), part.bend_at(s))

    def place(self, master: float) -> float:
        """Return that place alone: what is asked for in every cycle."""
        part, s, inside = self._found(master)
        return part.at(s) + (self.raised(master) if inside else 0.0)

    def _found(self, master: float) -> tuple[SplineSegment, float, bool]:
        """Return the part that is due, where on it, and whether the master is within the cam."""
        along = master - self.first
        if self.lift is not None:
            along -= math.floor(along / self.period) * self.period
        within = min(max(along, 0.0), self.period)
        number = max(bisect_right(self.marks, within) - 1, 0)
        return self.parts[number], within - self.marks[number], within == along

    def raised(self, master: float) -> float:
        """Return how far the turns behind the master have taken the slave."""
        return 0.0 if self.lift is None else math.floor((master - self.first) / self.period) * self.lift


Law = Gear | CamLaw
