"""A smooth curve through the samples of a path.

Theory of operation
-------------------
At the time of a sample the curve is exactly that sample. Between two samples it is the cubic with the speeds at both ends. The
speed at a sample is that of the parabola through it and its neighbours: straight lines and constant accelerations are reproduced
exactly, and the speed never jumps. The path rests at its beginning, at its end, and in two or more intervals without motion in a
row. There the speed is 0, and the curve does not overshoot the position of rest.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass

BEHIND = AHEAD = 2  # samples before and after an interval that determine the curve within it
_SAME = 1e-6  # share of a step within which two times count as equal, because of rounding


def following(t: float, step: float, duration: float) -> float:
    """Return the time of the sample after ``t``: steps are added one by one, as in the scan; the last one is ``duration``."""
    return t + step if t + step < duration else duration


@dataclass(frozen=True, slots=True)
class Curve:
    """Samples ``step`` seconds apart (the last interval may be shorter); the first one has the number ``first``.

    ``times`` in seconds, as many as ``positions``, at least one. ``span``: the lowest and the highest position of the path if they
    are known: the curve between samples does not exceed them.
    """

    step: float
    first: int
    times: tuple[float, ...]
    positions: tuple[float, ...]
    span: tuple[float, float] | None = None

    @property
    def after(self) -> int:
        """The number of the sample after the last."""
        return self.first + len(self.times)

    def joined(self, times: Sequence[float], positions: Sequence[float]) -> Curve:
        """Return the curve with more samples at its end."""
        return Curve(self.step, self.first, (*self.times, *times), (*self.positions, *positions), self.span)

    def without(self, t: float, behind: int) -> Curve:
        """Return the curve without the samples that are more than ``behind`` samples before ``t``."""
        gone = bisect_right(self.times, t) - 1 - behind
        if gone <= 0:
            return self
        return Curve(self.step, self.first + gone, self.times[gone:], self.positions[gone:], self.span)

    def at(self, t: float) -> float:
        """Return the position at ``t``, which must lie between the first and the last time."""
        index = bisect_right(self.times, t) - 1
        begin, here = self.times[index], self.positions[index]
        if t == begin:
            return here
        width, way = self.times[index + 1] - begin, self.positions[index + 1] - here
        share, enter, leave = (t - begin) / width, self._speed(index), self._speed(index + 1)
        left = 1.0 - share
        bend = left * (enter * width - way) - share * (leave * width - way)
        gone = share * (way + left * bend)
        if not enter or not leave:  # at rest at one end
            gone = min(max(gone, min(way, 0.0)), max(way, 0.0))
        if self.span is None:
            return here + gone
        return min(max(here + gone, self.span[0]), self.span[1])

    def _speed(self, index: int) -> float:
        """Return the signed speed at a sample."""
        before, after = self._slope(index - 1), self._slope(index)
        if not before and not self._slope(index - 2):
            return 0.0
        if not after and not self._slope(index + 1):
            return 0.0
        earlier, later = self._time(index) - self._time(index - 1), self._time(index + 1) - self._time(index)
        return (later * before + earlier * after) / (earlier + later)

    def _slope(self, index: int) -> float:
        """Return the mean speed between a sample and the next one; 0 beyond the ends, where a path rests."""
        within = 0 <= index < len(self.times) - 1
        width = self.times[index + 1] - self.times[index] if within else 0.0
        if width <= _SAME * self.step:
            return 0.0
        return (self.positions[index + 1] - self.positions[index]) / width

    def _time(self, index: int) -> float:
        return self.times[min(max(index, 0), len(self.times) - 1)]
