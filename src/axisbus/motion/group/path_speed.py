"""Move along a path: one step per executed cycle, at the requested speed, or at the speed that the path allows if that is lower.

Theory of operation
-------------------
The state is the path position ``s`` and the speed. In each cycle the speed approaches the requested speed by no more than the
acceleration of the speed zone. It also stays low enough to leave the speed zone at the permitted exit speed or slower. This
condition is a quadratic equation for the speed w after the cycle, because the cycle itself covers (v + w) T / 2. If a cycle reaches
the end of a speed zone, the rest of its time is spent in the next speed zone. So the motion can be slowed down, held, accelerated
and stopped at any time without leaving the path: only the speed along the path changes.

If the jerk along the path is limited, the position is the mean of the positions of the last cycles (``window``). The mean lies on
the path as well. Its speed and acceleration are no higher, and its acceleration changes by no more than twice the acceleration in
the time of those cycles. At a stop on the path, the motion waits until the mean has arrived there. Hard braking drops the mean: the
motion brakes at once, from its position and with its speed.

If several commands share a path (``blending``), each speed zone has its own requested velocity and its own requested exit velocity.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from axisbus.motion.group.path import NOWHERE

_NEXT = 1e-12  # relative to the length: the resolution of the numbers
_LEAST = 1e-9  # of the speed change in one cycle: a lower speed counts as standstill
_Row = Sequence[float] | Mapping[int, float]


class PathGeometry(Protocol):
    """The path to follow: a ``Path``, or a path that grows meanwhile. Rows are indexed by the number of the speed zone."""

    @property
    def marks(self) -> _Row:
        """Start of each speed zone; the start of the next one is its end."""

    @property
    def tops(self) -> _Row:
        """Highest speed."""

    @property
    def ramps(self) -> _Row:
        """Acceleration."""

    @property
    def leaves(self) -> _Row:
        """Highest speed at the end of the speed zone."""

    @property
    def length(self) -> float:
        """Length of the whole path."""

    def number(self, s: float) -> int:
        """Return the number of the speed zone that contains ``s``."""

    def is_last(self, number: int) -> bool:
        """Whether no speed zone follows."""


class SpeedRequest(NamedTuple):
    """The requested velocity in each speed zone of a path, and the requested velocity at its end."""

    velocities: Sequence[float]
    exits: Sequence[float]


class PathSpeed:
    """Position ``t`` and speed along a path, and whether it brakes. Serves as the axes' clock (``Follow``)."""

    __slots__ = (
        "_ahead",
        "_asked",
        "_gone",
        "_near",
        "_number",
        "_places",
        "_way",
        "braking",
        "factor",
        "hard",
        "speed",
        "t",
        "velocity",
    )

    def __init__(self) -> None:
        self._way: PathGeometry = NOWHERE
        self._asked: SpeedRequest | None = None  # set if the requested velocity differs between speed zones
        self.velocity = 0.0
        self.factor = 1.0  # the override
        self.hard = 0.0  # the lowest deceleration to brake with, along the path
        self.t = self._ahead = 0.0  # position, and the position without a limit of jerk
        self._places: deque[float] = deque(maxlen=1)
        self._gone = 0.0  # distance in the last cycle
        self.speed = 0.0
        self.braking = False
        self._number = 0
        self._near = 0.0

    def begin(self, way: PathGeometry, velocity: float, at: float = 0.0, window: int = 1) -> None:
        """Start at rest at position ``at`` of the path, with the requested ``velocity`` (above 0).

        ``window``: number of cycles in the mean; more than one only if the jerk is limited.
        """
        self._way, self.velocity, self.t = way, velocity, at
        self._ahead, self._places = at, deque([at] * window, maxlen=window)
        self._gone = 0.0
        self._number = way.number(at)
        self._near = _NEXT * way.length

    @property
    def ahead(self) -> float:
        """The position without a limit of jerk."""
        return self._ahead

    def take(self, way: PathGeometry, asked: SpeedRequest) -> None:
        """Continue along ``way``: a path that is identical up to the present position, with the same path positions."""
        self._way, self._asked = way, asked
        self._number = way.number(self._ahead)
        self._near = _NEXT * way.length

    def scale(self, way: PathGeometry, by: float) -> None:
        """Continue along ``way``: the same path, with path positions multiplied by ``by``."""
        self._way, self.velocity, self.speed = way, self.velocity * by, self.speed * by
        self.t, self._ahead, self._gone = self.t * by, self._ahead * by, self._gone * by
        self._places = deque([place * by for place in self._places], maxlen=self._places.maxlen)
        self._near = _NEXT * way.length

    def fits(self, way: PathGeometry, period: float) -> bool:
        """Return whether the motion can continue along ``way`` at the present speed, within the limits of its speed zone.

        If the speed zone ends within this cycle, the speed at its end decides, not the speed after the cycle.
        """
        v, number = self.speed, way.number(self._ahead)
        ramp, top, leave = way.ramps[number], way.tops[number], way.leaves[number]
        left = way.marks[number + 1] - self._ahead
        bound = slow_enough(v, leave, ramp, left, period)
        in_time = v * v * (1.0 - _LEAST) <= leave * leave + 2.0 * ramp * left
        return (in_time and v - ramp * period <= min(top, bound) + _LEAST * v) or v == 0.0

    @property
    def stopped(self) -> bool:
        """Whether it is at standstill because it was braked."""
        return self.braking and self.speed == 0.0 and self.t == self._ahead

    def told(self, t: float) -> str:
        """Return path position ``t`` as text for messages."""
        return f"{t / (self._way.length or 1.0):.1%} of the path"

    def brake(self) -> None:
        """Brake to rest on the path; a second call has no effect."""
        self.braking = True

    def advance(self, period: float) -> None:
        """Advance by one cycle of ``period`` seconds; the cycle may cross the ends of several speed zones."""
        if self.hard and self.braking and self._places.maxlen != 1:
            self._let_go(period)
        left = period
        while left > 0.0:
            left = self._go(left)
        places, ahead, before = self._places, self._ahead, self.t
        places.append(ahead)
        self.t = ahead if places[0] == ahead else sum(places) / len(places)
        self._gone = self.t - before

    def _let_go(self, period: float) -> None:
        """Drop the limit of jerk: continue from the present position at the present speed."""
        self._ahead, self._places = self.t, deque([self.t], maxlen=1)
        self._number = self._way.number(self.t)
        self.speed = self._gone / period

    def _go(self, period: float) -> float:
        """Advance within the speed zone; return the time that remains if its end is reached earlier."""
        way, number, v = self._way, self._number, self.speed
        ramp, mark = way.ramps[number], way.marks[number + 1]
        if v == 0.0 and self._places[0] != self._ahead == way.marks[number]:
            return 0.0  # a stop on the path: wait for the mean to arrive
        if self.braking and self.hard > ramp:
            ramp = self.hard
        if self._asked is not None:
            self._ask(self._asked, period)
        w = self._wanted(ramp * period, way.tops[number], self._bound(number, period))
        covered = 0.5 * v * v / ramp if w == 0.0 and v < ramp * period else 0.5 * (v + w) * period
        if self._ahead + covered < mark - self._near:
            self._ahead, self.speed = self._ahead + covered, w
            return 0.0
        is_last, leave = way.is_last(number), way.leaves[number]
        distance, self._ahead = max(mark - self._ahead, 0.0), mark
        self._number = number if is_last else number + 1
        if is_last or leave == 0.0:  # the end, or a stop on the path
            self.speed = 0.0
            return 0.0
        rate = (w - v) / period
        self.speed = min(math.sqrt(max(v * v + 2.0 * rate * distance, 0.0)), leave)
        mean = 0.5 * (v + self.speed)
        return period - distance / mean if mean * period > distance else 0.0

    def _wanted(self, change: float, top: float, bound: float) -> float:
        """Return the next speed, which differs by ``change`` at most and does not exceed ``top`` and ``bound``."""
        v, wanted = self.speed, 0.0 if self.braking else self.velocity * self.factor
        w = min(v + change, max(v - change, min(wanted, top)), bound)
        return 0.0 if w < v and w < _LEAST * change else w

    def _bound(self, number: int, period: float) -> float:
        """Return the highest speed after ``period`` that still permits leaving the speed zone at its exit speed."""
        way = self._way
        left = way.marks[number + 1] - self._ahead
        return slow_enough(self.speed, way.leaves[number], way.ramps[number], left, period)

    def _ask(self, asked: SpeedRequest, period: float) -> None:
        """Set the requested velocity for this cycle, so that the speed zone is left at its requested exit velocity."""
        number, factor = self._number, self.factor
        ramp, left = self._way.ramps[number], self._way.marks[number + 1] - self._ahead
        self.velocity = asked.velocities[number]
        if asked.exits[number] < self.velocity and factor > 0.0:
            bound = slow_enough(self.speed, factor * asked.exits[number], ramp, left, period)
            self.velocity = min(self.velocity, bound / factor)


def slow_enough(v: float, leave: float, ramp: float, left: float, period: float) -> float:
    """Return the highest speed after ``period``, from ``v``, that permits a speed of at most ``leave`` after distance ``left``."""
    half = 0.5 * ramp * period
    more = leave * leave + ramp * (
        2.0 * left - v * period
    )  # added to half²; written like this to avoid cancellation
    return more / (math.sqrt(half * half + more) + half) if more > 0.0 else 0.0
