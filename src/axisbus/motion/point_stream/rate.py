"""Move along a stream: as close to the pace of its points as its spans allow, computed exactly at each boundary of two spans.

Theory of operation
-------------------
Within a span, the square of the highest pace is a linear function of the distance to the span's end (v² = leave² + 2 ramp *
distance). The pace rises at the span's ramp to the requested pace, stays there, and falls along that line or to the requested pace.
So a cycle consists of a few phases of constant change. Each ends where the next begins, at a span boundary, or with the cycle.
Spans may be shorter than a cycle, and their ramps differ by powers of ten. Therefore no phase crosses a span boundary, unlike in
``PathSpeed``.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from axisbus.motion.group.path_speed import PathSpeed

_PHASES = 256  # per cycle at most; the phases of eight points take a tenth of a cycle
_SAME = 1e-12


class _Phase(NamedTuple):
    """The change of pace (per s), the longest duration (s), and the pace at its end."""

    rate: float
    seconds: float
    end: float


class StreamTravel(PathSpeed):
    """Motion along a stream: its position is a time of the stream, its speed is the pace."""

    __slots__ = ()

    def told(self, t: float) -> str:
        """Return a time of the stream as text for messages."""
        return f"{t:.3f} s of the stream"

    @property
    def wanted(self) -> float:
        """The requested pace: 1, less with an override, 0 during a halt."""
        return 0.0 if self.braking else min(self.velocity * self.factor, 1.0)

    def advance(self, period: float) -> None:
        """Advance by one cycle of ``period`` seconds."""
        left = period
        for _ in range(_PHASES):
            left = self._go(left)
            if left <= 0.0:
                break
        self.t = self._ahead

    def _go(self, period: float) -> float:
        """Advance by one phase of at most ``period`` seconds; return the time that remains."""
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
        """Return the next phase of the pace, with ``left`` seconds of the span remaining."""
        v, wanted = self.speed, self.wanted
        room = leave * leave + 2.0 * ramp * left - v * v  # below 0: faster than the known points allow
        if v > wanted:
            return _Phase(-ramp, (v - wanted) / ramp, wanted)
        # A distance of ``_SAME`` is below the resolution of a time of the stream.
        if room <= _SAME * max(1.0, ramp):
            return _Phase(-ramp, max(v - leave, 0.0) / ramp, leave) if v > leave else _Phase(0.0, math.inf, v)
        if v == wanted:
            return _Phase(0.0, room / (2.0 * ramp * v) if v else math.inf, v)
        top = math.sqrt(v * v + 0.5 * room)  # intersection of acceleration and deceleration
        end = min(top, wanted)
        return _Phase(ramp, (end - v) / ramp, end)

    def _pass_joint(self) -> bool:
        """Enter the next span; return False at the end of the known part, where the motion rests."""
        way, number = self._way, self._number
        self.speed = min(self.speed, way.leaves[number])
        if way.is_last(number):
            self.speed = 0.0
            return False
        self._number = number + 1
        return True
