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

from axisbus.motion.group.path import EMPTY_PATH

_RESOLUTION = 1e-12  # relative to the length: the resolution of the numbers
_LEAST = 1e-9  # share of the speed change in one cycle; a lower speed counts as standstill
_Row = Sequence[float] | Mapping[int, float]


class PathGeometry(Protocol):
    """The path to follow: a ``Path``, or a path that grows meanwhile. Rows are indexed by the number of the speed zone."""

    @property
    def marks(self) -> _Row:
        """Start of each speed zone; the start of the next one is its end."""

    @property
    def max_speeds(self) -> _Row:
        """Highest speed."""

    @property
    def ramps(self) -> _Row:
        """Acceleration."""

    @property
    def max_exit_speeds(self) -> _Row:
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
        "_last_distance",
        "_path",
        "_recent_positions",
        "_requested",
        "_tolerance",
        "_zone",
        "braking",
        "factor",
        "min_deceleration",
        "speed",
        "t",
        "velocity",
    )

    def __init__(self) -> None:
        self._path: PathGeometry = EMPTY_PATH
        # set if the requested velocity differs between speed zones
        self._requested: SpeedRequest | None = None
        self.velocity = 0.0
        self.factor = 1.0  # the override
        self.min_deceleration = 0.0  # the lowest deceleration to brake with, along the path
        self.t = self._ahead = 0.0  # position, and the position without a limit of jerk
        self._recent_positions: deque[float] = deque(maxlen=1)
        self._last_distance = 0.0  # distance in the last cycle
        self.speed = 0.0
        self.braking = False
        self._zone = 0
        self._tolerance = 0.0

    def begin(self, path: PathGeometry, velocity: float, at: float = 0.0, window: int = 1) -> None:
        """Start at rest at position ``at`` of the path, with the requested ``velocity`` (above 0).

        ``window``: number of cycles in the mean; more than one only if the jerk is limited.
        """
        self._path, self.velocity, self.t = path, velocity, at
        self._ahead, self._recent_positions = at, deque([at] * window, maxlen=window)
        self._last_distance = 0.0
        self._zone = path.number(at)
        self._tolerance = _RESOLUTION * path.length

    @property
    def ahead(self) -> float:
        """The position without a limit of jerk."""
        return self._ahead

    def take(self, path: PathGeometry, requested: SpeedRequest) -> None:
        """Continue along ``path``: a path that is identical up to the present position, with the same path positions."""
        self._path, self._requested = path, requested
        self._zone = path.number(self._ahead)
        self._tolerance = _RESOLUTION * path.length

    def scale(self, path: PathGeometry, by: float) -> None:
        """Continue along ``path``: the same path, with path positions multiplied by ``by``."""
        self._path, self.velocity, self.speed = path, self.velocity * by, self.speed * by
        self.t, self._ahead, self._last_distance = self.t * by, self._ahead * by, self._last_distance * by
        self._recent_positions = deque(
            [position * by for position in self._recent_positions], maxlen=self._recent_positions.maxlen
        )
        self._tolerance = _RESOLUTION * path.length

    def fits(self, path: PathGeometry, period: float) -> bool:
        """Return whether the motion can continue along ``path`` at the present speed, within the limits of its speed zone.

        If the speed zone ends within this cycle, the speed at its end decides, not the speed after the cycle.
        """
        v, number = self.speed, path.number(self._ahead)
        ramp, top, exit_speed = path.ramps[number], path.max_speeds[number], path.max_exit_speeds[number]
        left = path.marks[number + 1] - self._ahead
        bound = slow_enough(v, exit_speed, ramp, left, period)
        in_time = v * v * (1.0 - _LEAST) <= exit_speed * exit_speed + 2.0 * ramp * left
        return (in_time and v - ramp * period <= min(top, bound) + _LEAST * v) or v == 0.0

    @property
    def stopped(self) -> bool:
        """Whether it is at standstill because it was braked."""
        return self.braking and self.speed == 0.0 and self.t == self._ahead

    def as_text(self, t: float) -> str:
        """Return path position ``t`` as text for messages."""
        return f"{t / (self._path.length or 1.0):.1%} of the path"

    def brake(self) -> None:
        """Brake to rest on the path; a second call has no effect."""
        self.braking = True

    def advance(self, period: float) -> None:
        """Advance by one cycle of ``period`` seconds; the cycle may cross the ends of several speed zones."""
        if self.min_deceleration and self.braking and self._recent_positions.maxlen != 1:
            self._drop_jerk_limit(period)
        left = period
        while left > 0.0:
            left = self._advance_in_zone(left)
        recent, ahead, before = self._recent_positions, self._ahead, self.t
        recent.append(ahead)
        self.t = ahead if recent[0] == ahead else sum(recent) / len(recent)
        self._last_distance = self.t - before

    def _drop_jerk_limit(self, period: float) -> None:
        """Drop the limit of jerk: continue from the present position at the present speed."""
        self._ahead, self._recent_positions = self.t, deque([self.t], maxlen=1)
        self._zone = self._path.number(self.t)
        self.speed = self._last_distance / period

    def _advance_in_zone(self, period: float) -> float:
        """Advance within the speed zone; return the time that remains if its end is reached earlier."""
        path, number, v = self._path, self._zone, self.speed
        ramp, mark = path.ramps[number], path.marks[number + 1]
        if v == 0.0 and self._recent_positions[0] != self._ahead == path.marks[number]:
            return 0.0  # a stop on the path: wait for the mean to arrive
        if self.braking and self.min_deceleration > ramp:
            ramp = self.min_deceleration
        if self._requested is not None:
            self._request_velocity(self._requested, period)
        w = self._next_speed(ramp * period, path.max_speeds[number], self._bound(number, period))
        covered = 0.5 * v * v / ramp if w == 0.0 and v < ramp * period else 0.5 * (v + w) * period
        if self._ahead + covered < mark - self._tolerance:
            self._ahead, self.speed = self._ahead + covered, w
            return 0.0
        is_last, exit_speed = path.is_last(number), path.max_exit_speeds[number]
        distance, self._ahead = max(mark - self._ahead, 0.0), mark
        self._zone = number if is_last else number + 1
        if is_last or exit_speed == 0.0:  # the end, or a stop on the path
            self.speed = 0.0
            return 0.0
        rate = (w - v) / period
        self.speed = min(math.sqrt(max(v * v + 2.0 * rate * distance, 0.0)), exit_speed)
        mean = 0.5 * (v + self.speed)
        return period - distance / mean if mean * period > distance else 0.0

    def _next_speed(self, change: float, top: float, bound: float) -> float:
        """Return the next speed, which differs by ``change`` at most and does not exceed ``top`` and ``bound``."""
        v, wanted = self.speed, 0.0 if self.braking else self.velocity * self.factor
        w = min(v + change, max(v - change, min(wanted, top)), bound)
        return 0.0 if w < v and w < _LEAST * change else w

    def _bound(self, number: int, period: float) -> float:
        """Return the highest speed after ``period`` that still permits leaving the speed zone at its exit speed."""
        path = self._path
        left = path.marks[number + 1] - self._ahead
        return slow_enough(self.speed, path.max_exit_speeds[number], path.ramps[number], left, period)

    def _request_velocity(self, requested: SpeedRequest, period: float) -> None:
        """Set the requested velocity for this cycle, so that the speed zone is left at its requested exit velocity."""
        number, factor = self._zone, self.factor
        ramp, left = self._path.ramps[number], self._path.marks[number + 1] - self._ahead
        self.velocity = requested.velocities[number]
        if requested.exits[number] < self.velocity and factor > 0.0:
            bound = slow_enough(self.speed, factor * requested.exits[number], ramp, left, period)
            self.velocity = min(self.velocity, bound / factor)


def slow_enough(v: float, exit_speed: float, ramp: float, left: float, period: float) -> float:
    """Return the highest speed after ``period``, from ``v``, that permits at most ``exit_speed`` after distance ``left``."""
    half = 0.5 * ramp * period
    more = exit_speed * exit_speed + ramp * (
        2.0 * left - v * period
    )  # added to half²; written like this to avoid cancellation
    return more / (math.sqrt(half * half + more) + half) if more > 0.0 else 0.0
