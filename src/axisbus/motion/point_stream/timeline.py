"""The known spans of a stream, as a path to move along: the position is a time of the stream, the speed is the pace.

Theory of operation
-------------------
A pace of 1 is that of the points. The known part ends, so the pace at the end of each span is limited: with the ramps of the
following spans, the axes can come to rest at the end of the last span. Each added span updates these limits, from the end
backwards, as far as they change. So the axes are always ready to come to rest at their last point, and brake only if no more points
come in time. Neither an underrun nor a point that is delayed on its way to the core needs a reaction.
"""

from __future__ import annotations

import math

from axisbus.motion.point_stream.commands import Span
from axisbus.motion.point_stream.quintic import at


class StreamTimeline:
    """Holds the spans by number (from 0), starting a little behind the axes."""

    def __init__(self) -> None:
        self.ramps: dict[int, float] = {}
        self.tops: dict[int, float] = {}
        self.leaves: dict[int, float] = {}
        self.marks: dict[int, float] = {0: 0.0}
        self._spans: dict[int, Span] = {}
        self._oldest = self.count = 0
        self._place: tuple[float, ...] = ()
        self._at = math.nan

    @property
    def length(self) -> float:
        """Known duration of the stream in seconds."""
        return self.marks[self.count]

    @property
    def waiting(self) -> int:
        """The number of stored spans."""
        return self.count - self._oldest

    def is_last(self, number: int) -> bool:
        """Whether a span is the last known one."""
        return number + 1 >= self.count

    def number(self, s: float) -> int:
        """Return the number of the span that contains ``s``; at a boundary, the second span."""
        number = self._oldest
        while not self.is_last(number) and self.marks[number + 1] <= s:
            number += 1
        return number

    def add(self, span: Span) -> None:
        """Append a span."""
        number = self.count
        self._spans[number], self.ramps[number], self.tops[number] = span, span.ramp, 1.0
        self.marks[number + 1] = self.marks[number] + span.seconds
        self.leaves[number] = 0.0
        self.count = number + 1
        while number > self._oldest:
            gain = 2.0 * self.ramps[number] * (self.marks[number + 1] - self.marks[number])
            leave = min(math.sqrt(self.leaves[number] ** 2 + gain), 1.0)
            number -= 1
            if self.leaves[number] == leave:
                return
            self.leaves[number] = leave

    def forget(self, number: int) -> None:
        """Drop the spans before ``number``."""
        while self._oldest < min(number, self.count - 1):
            for row in (self._spans, self.ramps, self.tops, self.leaves, self.marks):
                del row[self._oldest]
            self._oldest += 1

    def place(self, s: float) -> tuple[float, ...]:
        """Return the axis positions at ``s``; cached, because all axes ask for the same ``s`` within a cycle."""
        if s != self._at:
            number = self.number(s)
            span = self._spans[number]
            t = min(max(s - self.marks[number], 0.0), span.seconds)
            self._place, self._at = tuple([at(curve, t) for curve in span.curves]), s
        return self._place
