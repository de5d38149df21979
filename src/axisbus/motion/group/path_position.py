"""Commanded positions of a group's axes along their path: one position vector per cycle, and each axis's component of it."""

from __future__ import annotations

import math
from collections.abc import Sequence

from axisbus.motion.group.path import Path, least
from axisbus.motion.group.segments import Place
from axisbus.motion.parameters import AxisLimits

_SLOPE = 100.0  # units of path over which one unit of start offset is removed


class PathPosition:
    """Positions along a path from path position ``begin`` on; caches the result of the last query.

    The axes start within a window around the path's start. The offset of each axis from the path is removed gradually.
    """

    __slots__ = ("_begin", "_ease", "_fade", "_last", "_off", "_place", "way")

    def __init__(self, way: Path, begin: float, here: Place) -> None:
        """``here``: the actual positions of the axes, in units."""
        self.way = way
        self._begin = begin
        self._off = tuple(a - b for a, b in zip(here, way.at(begin), strict=True))
        rest = way.length - begin
        piece, gone = way.piece(begin)
        own = piece.length - gone
        self._fade = min(rest, max(own, _SLOPE * math.hypot(*self._off)))
        self._last = math.nan
        self._place: Place = here
        self._ease = 1.0

    def eased(self, limits: Sequence[AxisLimits], velocity: float) -> Path:
        """Return the path, slowed so that removing the start offset at ``velocity`` or less exceeds no axis's limits."""
        if not self._fade or not any(self._off):
            return self.way
        slopes = tuple(abs(off) / self._fade for off in self._off)
        fastest, hardest = min(velocity, max(self.way.tops)), max(self.way.ramps)
        more_speed = fastest / least([limit.velocity for limit in limits], slopes)
        more_ramp = hardest / least([limit.acceleration for limit in limits], slopes)
        self._ease = 1.0 / (1.0 + max(more_speed, more_ramp))
        return self.way.slower(self._ease)

    def ease(self, s: float) -> float:
        """Return the factor by which a path must be slower that is appended while the axes are at ``s``; 1.0 without an offset."""
        return self._ease if s - self._begin < self._fade else 1.0

    def scale(self, way: Path, by: float) -> None:
        """Continue along ``way``: the same path, with path positions multiplied by ``by``."""
        self.way, self._begin, self._fade, self._last = way, self._begin * by, self._fade * by, math.nan

    def at(self, s: float) -> Place:
        """Return the axis positions at path position ``s``."""
        if s == self._last:
            return self._place
        place, gone = self.way.at(s), s - self._begin
        if gone < self._fade:
            left = 1.0 - gone / self._fade
            place = tuple([a + left * b for a, b in zip(place, self._off, strict=True)])
        self._last, self._place = s, place
        return place


class AxisPathShare:
    """One axis's component of a path, as a trajectory to follow. Its parameter is the path position (``PathSpeed``), not time."""

    def __init__(self, along: PathPosition, number: int, fastest: float) -> None:
        """``number``: index of the axis in a ``Place``; ``fastest``: the highest path velocity that can be requested."""
        self._along = along
        self._number = number
        way = along.way
        self.duration = way.length
        self.span = way.lowest[number], way.highest[number]
        self.top_speed = min(fastest * way.shares[number], way.speeds[number])
        self.top_acceleration = way.accelerations[number]

    def position(self, s: float) -> float:
        """Return the axis position at path position ``s``."""
        return self._along.at(s)[self._number]
