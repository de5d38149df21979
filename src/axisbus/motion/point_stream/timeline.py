"""The spans of a stream that are known, as what a travel goes along: its place is a time of the stream, its speed the pace.

Theory of operation
-------------------
A pace of 1 is that of the points. What is known ends somewhere, so the pace at the end of each span is no higher than lets the axes
come to rest at the end of the last, by what each span allows. With each span that is added this is reckoned anew, from the end on
backwards, as far as it changes anything. So the axes are always about to come to rest where their points end, and are braked for it
only if no more come in time: an underrun needs no reaction, and what is held back on its way here does not either.
"""

from __future__ import annotations

import math

from axisbus.motion.point_stream.commands import Span
from axisbus.motion.point_stream.quintic import at


class StreamTimeline:
    """Holds the spans from a little behind where the axes are, by their numbers from 0 on."""

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
        """Seconds of the stream that are known."""
        return self.marks[self.count]

    @property
    def waiting(self) -> int:
        """How many spans are held."""
        return self.count - self._oldest

    def is_last(self, number: int) -> bool:
        """Whether nothing is known beyond a span."""
        return number + 1 >= self.count

    def number(self, s: float) -> int:
        """Return which span ``s`` lies on; where two join, the second."""
        number = self._oldest
        while not self.is_last(number) and self.marks[number + 1] <= s:
            number += 1
        return number

    def add(self, span: Span) -> None:
        """Go on with one more."""
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
        """Let go of the spans before one."""
        while self._oldest < min(number, self.count - 1):
            for row in (self._spans, self.ramps, self.tops, self.leaves, self.marks):
                del row[self._oldest]
            self._oldest += 1

    def place(self, s: float) -> tuple[float, ...]:
        """Return where each axis is to be at ``s``, the same for all that ask within a cycle."""
        if s != self._at:
            number = self.number(s)
            span = self._spans[number]
            t = min(max(s - self.marks[number], 0.0), span.seconds)
            self._place, self._at = tuple([at(curve, t) for curve in span.curves]), s
        return self._place
