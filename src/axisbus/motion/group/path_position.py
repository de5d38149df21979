"""Where the axes of a group are to be along their way: one place for all of them in a cycle, and each axis's share of it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from axisbus.motion.group.path import Path, least
from axisbus.motion.group.segments import Place
from axisbus.motion.parameters import AxisLimits

_SLOPE = 100.0  # units of way for one of what the beginning is off


class PathPosition:
    """A way as it is gone along from ``begin`` on; holds the place that was asked for last.

    Axes stand where they stand, within a window of where the way has them: what they are off is taken back little by little.
    """

    __slots__ = ("_begin", "_fade", "_last", "_off", "_place", "way")

    def __init__(self, way: Path, begin: float, here: Place) -> None:
        """``here``: where the axes stand."""
        self.way = way
        self._begin = begin
        self._off = tuple(a - b for a, b in zip(here, way.at(begin), strict=True))
        rest = way.length - begin
        piece, gone = way.piece(begin)
        own = piece.length - gone
        self._fade = min(rest, max(own, _SLOPE * math.hypot(*self._off)))
        self._last = math.nan
        self._place: Place = here

    def eased(self, limits: Sequence[AxisLimits], velocity: float) -> Path:
        """Return the way, so slow (at ``velocity`` at most) that what is taken back leads no axis beyond its limits."""
        if not self._fade or not any(self._off):
            return self.way
        slopes = tuple(abs(off) / self._fade for off in self._off)
        fastest, hardest = min(velocity, max(self.way.tops)), max(self.way.ramps)
        more_speed = fastest / least([limit.velocity for limit in limits], slopes)
        more_ramp = hardest / least([limit.acceleration for limit in limits], slopes)
        return self.way.slower(1.0 / (1.0 + max(more_speed, more_ramp)))

    def scale(self, way: Path, by: float) -> None:
        """Go on along ``way``, which is the same with places ``by`` times as large."""
        self.way, self._begin, self._fade, self._last = way, self._begin * by, self._fade * by, math.nan

    def at(self, s: float) -> Place:
        """Return the place at ``s``."""
        if s == self._last:
            return self._place
        place, gone = self.way.at(s), s - self._begin
        if gone < self._fade:
            left = 1.0 - gone / self._fade
            place = tuple([a + left * b for a, b in zip(place, self._off, strict=True)])
        self._last, self._place = s, place
        return place


class AxisPathShare:
    """One axis's share of a way, as the trajectory that it follows: what goes on is the place on the way (``PathSpeed``)."""

    def __init__(self, along: PathPosition, number: int, fastest: float) -> None:
        """``number``: which axis of a place it is; ``fastest``: the highest velocity along the way that can be asked for."""
        self._along = along
        self._number = number
        way = along.way
        self.duration = way.length
        self.span = way.lowest[number], way.highest[number]
        self.top_speed = min(fastest * way.shares[number], way.speeds[number])
        self.top_acceleration = way.accelerations[number]

    def position(self, s: float) -> float:
        """Return the position at the place ``s`` of the way."""
        return self._along.at(s)[self._number]
