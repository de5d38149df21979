"""Travelling along a course: as near to the pace of its points as its spans allow, exactly up to each joint.

Theory of operation
-------------------
Within a span the square of the highest pace falls along a straight line to that at its end (v² = leave² + 2 ramp * way left). The
pace goes up to what is wanted by the span's ramp, keeps it, and goes down along that line or to what is wanted: so a cycle is a few
phases of constant change, each of which ends where the next begins, at a joint, or with the cycle. Spans may be shorter than a
cycle, and their ramps differ by powers of ten; so no phase reaches over a joint, as those of ``PathSpeed`` along a way do.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from axisbus.motion.group.path_speed import PathSpeed

_PHASES = 256  # of one cycle at most: eight points take a tenth of it
_SAME = 1e-12


class _Phase(NamedTuple):
    """How the pace changes (per s), for how long at most (s), and what it is then."""

    rate: float
    seconds: float
    end: float


class StreamTravel(PathSpeed):
    """The travel along a course: its place is a time of the stream, its speed the pace."""

    __slots__ = ()

    def told(self, t: float) -> str:
        """Return a time for people."""
        return f"{t:.3f} s of the stream"

    @property
    def wanted(self) -> float:
        """The pace that is wanted: 1, less by an override, 0 in a halt."""
        return 0.0 if self.braking else min(self.velocity * self.factor, 1.0)

    def advance(self, period: float) -> None:
        """Go on by one cycle of ``period`` seconds."""
        left = period
        for _ in range(_PHASES):
            left = self._go(left)
            if left <= 0.0:
                break
        self.t = self._ahead

    def _go(self, period: float) -> float:
        """Go on by one phase of at most ``period`` seconds; return what is left of them."""
        way, v = self._way, self.speed
        left = way.marks[self._number + 1] - self._ahead
        if left <= _SAME:
            return period if self._pass_joint() else 0.0
        phase = self._phase(way.ramps[self._number], way.leaves[self._number], left)
        if not v and not phase.end:
            return 0.0
        seconds = min(period, phase.seconds)
        after = phase.end if seconds == phase.seconds else max(v + phase.rate * seconds, 0.0)
        if 0.5 * (v + after) * seconds >= left - _SAME:
            after = math.sqrt(max(v * v + 2.0 * phase.rate * left, 0.0))
            seconds = min(seconds, 2.0 * left / (v + after))
            self._ahead, self.speed = way.marks[self._number + 1], after
            self._pass_joint()
        else:
            self._ahead, self.speed = self._ahead + 0.5 * (v + after) * seconds, after
        return period - seconds

    def _phase(self, ramp: float, leave: float, left: float) -> _Phase:
        """Return how the pace goes on from here, where ``left`` seconds of the span are still to go."""
        v, wanted = self.speed, self.wanted
        room = leave * leave + 2.0 * ramp * left - v * v  # below 0: faster than what is known allows
        if v > wanted:
            return _Phase(-ramp, (v - wanted) / ramp, wanted)
        if room <= _SAME * max(1.0, ramp):  # a way of ``_SAME``: less than a time of the stream can tell
            return _Phase(-ramp, max(v - leave, 0.0) / ramp, leave) if v > leave else _Phase(0.0, math.inf, v)
        if v == wanted:
            return _Phase(0.0, room / (2.0 * ramp * v) if v else math.inf, v)
        top = math.sqrt(v * v + 0.5 * room)  # where up meets down
        end = min(top, wanted)
        return _Phase(ramp, (end - v) / ramp, end)

    def _pass_joint(self) -> bool:
        """Go on to the next span; False at the end of what is known, where it rests."""
        way, number = self._way, self._number
        self.speed = min(self.speed, way.leaves[number])
        if way.is_last(number):
            self.speed = 0.0
            return False
        self._number = number + 1
        return True
