"""Travelling along a way: one step per executed cycle, at the speed that is asked for, or what the way allows where that is less.

Theory of operation
-------------------
The place ``s`` and the speed are all there is. In each cycle the speed comes nearer to what is wanted by no more than the stretch's
acceleration, and stays low enough to leave the stretch no faster than it may be left: of the speed after this cycle, w, and the way
that the cycle itself makes, (v + w) T / 2, that is a quadratic equation. A cycle that comes to a joint ends there, and the rest of
its time is gone on with in the next stretch. So the way can be slowed down, held, gone along faster and stopped at any time, and
nothing of that leads off it: what changes is the speed along it.

Where the jerk along the way is limited, the place is the mean of those of the last cycles (``window``). It is on the way, too, is
no faster and no harder, and its acceleration changes by no more than twice the acceleration in the time of those cycles. At a
stop on the way it waits until the mean has come there, too. What is braked hard lets go of the mean: it brakes at once, from where
it is, and with the speed that it has.

Where several commands share a way (``blending``), each stretch has its own velocity, and that with which it is to be left.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from typing import NamedTuple, Protocol

from axisbus.motion.group.path import NOWHERE

_NEXT = 1e-12  # of the length: as near as numbers come
_LEAST = 1e-9  # of the change within a cycle: what is slower stands
_Row = Sequence[float] | Mapping[int, float]


class PathGeometry(Protocol):
    """What is gone along: a ``Way``, or what grows meanwhile; its stretches by their numbers."""

    @property
    def marks(self) -> _Row:
        """Where each begins; that of the next is its end."""

    @property
    def tops(self) -> _Row:
        """Its highest speed."""

    @property
    def ramps(self) -> _Row:
        """Its acceleration."""

    @property
    def leaves(self) -> _Row:
        """The speed at its end."""

    @property
    def length(self) -> float:
        """Of all."""

    def number(self, s: float) -> int:
        """Return which one ``s`` lies on."""

    def is_last(self, number: int) -> bool:
        """Whether nothing follows it."""


class SpeedRequest(NamedTuple):
    """What is asked for on each stretch of a way: its velocity, and that at its end."""

    velocities: Sequence[float]
    exits: Sequence[float]


class PathSpeed:
    """Goes along a way; holds the place ``t``, the speed, and whether it brakes. To the axes it is their clock (``Follow``)."""

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
        self._asked: SpeedRequest | None = None  # where it is not the same velocity everywhere
        self.velocity = 0.0
        self.factor = 1.0  # the override
        self.hard = 0.0  # the least deceleration with which it is braked, along the way
        self.t = self._ahead = 0.0  # where it is, and where it would be without a limit of jerk
        self._places: deque[float] = deque(maxlen=1)
        self._gone = 0.0  # in the last cycle
        self.speed = 0.0
        self.braking = False
        self._number = 0
        self._near = 0.0

    def begin(self, way: PathGeometry, velocity: float, at: float = 0.0, window: int = 1) -> None:
        """Take the way, with the ``velocity`` that is asked for (above 0), and the place to begin at, at rest.

        ``window``: of how many cycles the mean is taken; more than one only where the way is one stretch.
        """
        self._way, self.velocity, self.t = way, velocity, at
        self._ahead, self._places = at, deque([at] * window, maxlen=window)
        self._gone = 0.0
        self._number = way.number(at)
        self._near = _NEXT * way.length

    @property
    def ahead(self) -> float:
        """Where it would be without a limit of jerk."""
        return self._ahead

    def take(self, way: PathGeometry, asked: SpeedRequest) -> None:
        """Go on along ``way``, which is the same up to where this is, and has the same numbers for places."""
        self._way, self._asked = way, asked
        self._number = way.number(self._ahead)
        self._near = _NEXT * way.length

    def scale(self, way: PathGeometry, by: float) -> None:
        """Go on along ``way``, which is the same with places ``by`` times as large."""
        self._way, self.velocity, self.speed = way, self.velocity * by, self.speed * by
        self.t, self._ahead, self._gone = self.t * by, self._ahead * by, self._gone * by
        self._places = deque([place * by for place in self._places], maxlen=self._places.maxlen)
        self._near = _NEXT * way.length

    def fits(self, way: PathGeometry, period: float) -> bool:
        """Whether ``way`` can be gone on along from here with the present speed, within what its stretch allows.

        Where the stretch ends within this cycle, what the speed is at its end tells, not what it is after the cycle.
        """
        v, number = self.speed, way.number(self._ahead)
        ramp, top, leave = way.ramps[number], way.tops[number], way.leaves[number]
        left = way.marks[number + 1] - self._ahead
        bound = slow_enough(v, leave, ramp, left, period)
        in_time = v * v * (1.0 - _LEAST) <= leave * leave + 2.0 * ramp * left
        return (in_time and v - ramp * period <= min(top, bound) + _LEAST * v) or v == 0.0

    @property
    def stopped(self) -> bool:
        """Whether it stands because it was braked."""
        return self.braking and self.speed == 0.0 and self.t == self._ahead

    def told(self, t: float) -> str:
        """Return a place for people."""
        return f"{t / (self._way.length or 1.0):.1%} of the way"

    def brake(self) -> None:
        """Come to rest on the way; a second call changes nothing."""
        self.braking = True

    def advance(self, period: float) -> None:
        """Go on by one cycle of ``period`` seconds; at each joint on its way the next stretch takes over."""
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
        """Go on without a limit of jerk, from where it is and as fast as it is."""
        self._ahead, self._places = self.t, deque([self.t], maxlen=1)
        self._number = self._way.number(self.t)
        self.speed = self._gone / period

    def _go(self, period: float) -> float:
        """Go on within the stretch; return the time that is left where it was left before."""
        way, number, v = self._way, self._number, self.speed
        ramp, mark = way.ramps[number], way.marks[number + 1]
        if v == 0.0 and self._places[0] != self._ahead == way.marks[number]:
            return 0.0  # a stop, to which the mean comes only now
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
        if is_last or leave == 0.0:  # the end, or a stop on the way
            self.speed = 0.0
            return 0.0
        rate = (w - v) / period
        self.speed = min(math.sqrt(max(v * v + 2.0 * rate * distance, 0.0)), leave)
        mean = 0.5 * (v + self.speed)
        return period - distance / mean if mean * period > distance else 0.0

    def _wanted(self, change: float, top: float, bound: float) -> float:
        """Return the speed to come to, by ``change`` at most; no more than ``top`` and ``bound``."""
        v, wanted = self.speed, 0.0 if self.braking else self.velocity * self.factor
        w = min(v + change, max(v - change, min(wanted, top)), bound)
        return 0.0 if w < v and w < _LEAST * change else w

    def _bound(self, number: int, period: float) -> float:
        """Return the highest speed after ``period`` with which the stretch can be left as slowly as it must."""
        way = self._way
        left = way.marks[number + 1] - self._ahead
        return slow_enough(self.speed, way.leaves[number], way.ramps[number], left, period)

    def _ask(self, asked: SpeedRequest, period: float) -> None:
        """Find the velocity that is asked for now, so that the stretch is left with what is asked for there."""
        number, factor = self._number, self.factor
        ramp, left = self._way.ramps[number], self._way.marks[number + 1] - self._ahead
        self.velocity = asked.velocities[number]
        if asked.exits[number] < self.velocity and factor > 0.0:
            bound = slow_enough(self.speed, factor * asked.exits[number], ramp, left, period)
            self.velocity = min(self.velocity, bound / factor)


def slow_enough(v: float, leave: float, ramp: float, left: float, period: float) -> float:
    """Return the highest speed after ``period``, from ``v``, with which ``left`` can be left with ``leave`` at most."""
    half = 0.5 * ramp * period
    more = leave * leave + ramp * (
        2.0 * left - v * period
    )  # than half²: as it is, so that nothing is lost by a difference
    return more / (math.sqrt(half * half + more) + half) if more > 0.0 else 0.0
