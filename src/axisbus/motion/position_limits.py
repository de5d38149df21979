"""Computations with position limits: the permitted range of a motion, the braking distance, and motion from outside the limits.

All kinds of motion use these functions: the supervision of velocity and torque, moves, paths, slaves of a master, gantry pairs,
and the check of a call.

Theory of operation
-------------------
A *position range* is the range within which a motion keeps an axis. It consists of the position limits, extended to the start:
an axis outside a limit may return, and moves no farther out. While it returns, the range shrinks with it (``narrowed``), so that it
does not move out again.

A measured position is noisy: an encoder varies by ±2 increments, so two positions at rest differ by up to ``NOISE`` increments.
``window`` is this value in the unit of the positions: a position outside a limit by no more than that counts as on the limit.

For an axis without a modulo, the count of its drive is such a range as well: 607Ah and 6064h are INTEGER32, and a target beyond one
end appears at the other end.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable

from axisbus.motion.moves.profile import braking_distance
from axisbus.units import INT32_HALF, INT32_LEAST, wrap

# Scan periods: an axis that needs more of them to the end of its range is braked by any deceleration.
_MOST_STEPS = 1e9
_END_OF_COUNT = 10  # increments, more than the noise of a position


class PositionRange(NamedTuple):
    """The lowest and the highest permitted position of a motion."""

    low: float
    high: float

    def has(self, position: float) -> bool:
        """Return whether ``position`` is within the range."""
        return self.low <= position <= self.high


UNLIMITED = PositionRange(-math.inf, math.inf)


def widened(limits: tuple[float, float], start: float, margin: float) -> PositionRange:
    """Return the range of a motion from ``start``: from outside the limits, it may return but not move farther out."""
    return PositionRange(min(limits[0], start) - margin, max(limits[1], start) + margin)


def narrowed(
    allowed: PositionRange, limits: tuple[float, float], position: float, window: float
) -> PositionRange:
    """Return the range of a motion that has reached ``position``: the part beyond ``limits`` that it has left is excluded."""
    low, high = min(limits[0], position) - window, max(limits[1], position) + window
    return PositionRange(max(allowed.low, low), min(allowed.high, high))


def is_beyond(limits: tuple[float, float], position: float, window: float = 0.0) -> bool:
    """Return whether ``position`` is outside ``limits`` by more than ``window``."""
    return not limits[0] - window <= position <= limits[1] + window


def path_range(
    limits: tuple[float, float], start: float, window: float, margin: float
) -> tuple[float, float]:
    """Return the range for a path from ``start`` that may pass ``start`` again.

    If the path begins outside a limit by at most ``window``, ``start`` becomes the limit, plus ``margin`` for rounding errors.
    """
    if not is_beyond(limits, start) or is_beyond(limits, start, window):
        return limits
    return widened(limits, start, margin)


def allowed_end(limits: tuple[float, float], start: float, end: float, window: float = 0.0) -> float | None:
    """Return the permitted end of a motion from ``start`` to ``end``; None if the motion leaves ``limits``.

    From outside a limit, the motion may end outside it, but no farther out than it began. If ``end`` is outside a limit by at most
    ``window``, it is replaced by the limit.
    """
    if widened(limits, start, 0.0).has(end):
        return end
    return None if is_beyond(limits, end, window) else min(max(end, limits[0]), limits[1])


def rest_position(position: float, velocity: float, deceleration: float) -> float:
    """Return the position at which an axis comes to rest if it brakes now."""
    return position + math.copysign(braking_distance(velocity, deceleration), velocity)


def rest_beyond(
    allowed: PositionRange, position: float, velocity: float, deceleration: float
) -> float | None:
    """Return the position of rest if the axis brakes now and leaves ``allowed`` in its direction of motion; otherwise None."""
    stop = rest_position(position, velocity, deceleration)
    if velocity > 0.0:
        return stop if stop > allowed.high else None
    return stop if stop < allowed.low else None


def braking(
    allowed: PositionRange, position: float, velocity: float, usual: float, hardest: float, period: float
) -> float:
    """Return the deceleration for braking in steps (``steps_to_rest``): ``usual``, or more if that is needed to stay in the range.

    The result is at most ``hardest``, also if even that does not keep the axis in the range.
    """
    left = max(allowed.high - position if velocity > 0.0 else position - allowed.low, 0.0)
    speed = abs(velocity)
    step = speed * period
    if not step or step * _MOST_STEPS <= left:  # at standstill, or far from the end of the range
        return usual
    # In n steps the speed falls to 0 if the deceleration is from v/(n+1)T to v/nT; the distance is T (n v - d T n (n+1) / 2).
    steps = max(1, math.ceil(2.0 * left / step))
    needed = 2.0 * (steps * speed - left / period) / (period * steps * (steps + 1))
    return max(usual, min(needed, hardest))


def steps_to_rest(position: float, velocity: float, deceleration: float, period: float) -> list[float]:
    """Return the positions of an axis that brakes now: the present one, and one for each cycle.

    ``velocity`` is that of the previous cycle. It falls by the permitted deceleration in each cycle: no braking is shorter.
    """
    positions, speed = [position, position], abs(velocity)
    while (speed := speed - deceleration * period) > 0.0:
        positions[-1] = position = position + math.copysign(speed * period, velocity)
        positions.append(position)
    return positions


def count_range(position: int) -> PositionRange:
    """Return the range of unwrapped increments within which a drive at ``position`` can be held without a wrap of its count.

    It ends a little earlier than the count, unless the axis is there already: at the very end, noise alone would wrap the position,
    and a drive may go the long way round to a target that has wrapped.
    """
    lap = position - wrap(position)
    low, high = lap + INT32_LEAST + _END_OF_COUNT, lap + INT32_HALF - 1 - _END_OF_COUNT
    return PositionRange(min(low, position), max(high, position))


# ----------------------------------------------------------------------------------------------------------------------
# Check that a trajectory stays within position limits: as a whole if it is known in advance, else as far ahead as braking
# takes.
#
# Theory of operation
# A path is braked by slowing down its time (``PathClock``). From a speed v with a deceleration a, braking covers at most v²/2a of
# the path, in at most v/a of its time. Before each period, the part of the path beyond the end of the period is checked. If this
# part leaves the limits, the path is braked at once, from the previous point, whose own part of the path was found to lie within
# the limits. So the last target lies within the limits, whatever the trajectory does. A trajectory that itself brakes in time,
# however hard, is not changed.


Path = Callable[[float], float]


@runtime_checkable
class LookaheadTrajectory(Protocol):
    """A trajectory whose span and highest speed are known in advance."""

    @property
    def span(self) -> tuple[float, float]:
        """The lowest and the highest position."""

    @property
    def top_speed(self) -> float:
        """The highest speed in unit/s."""


class Excess(NamedTuple):
    """How a path would leave the limits: ``here`` at ``speed`` it would only stop at ``stop``; it is at ``there`` at ``time``."""

    here: float
    speed: float
    stop: float
    there: float
    time: float


def excess(
    path: Path, t: float, period: float, limits: tuple[float, float], deceleration: float
) -> Excess | None:
    """Return how the path would leave ``limits`` if it continued from ``t`` for one more period and then braked; None if not.

    ``path`` gives the position at any time (after its end, the end); ``deceleration`` in unit/s², above 0.
    """
    here, ahead = path(t), path(t + period)
    step = ahead - here
    speed = abs(step) / period
    distance = braking_distance(speed, deceleration)
    stop = ahead + (distance if step > 0 else -distance)
    if _within(ahead, limits) and _within(stop, limits):
        return None
    left = _leaves(path, t + period, period, limits, distance, speed / deceleration)
    return None if left is None else Excess(here, speed, stop, *left)


def _leaves(
    path: Path, t: float, period: float, limits: tuple[float, float], distance: float, time: float
) -> tuple[float, float] | None:
    """Return the position and time at which the path is first outside, within the next ``distance`` and ``time`` of it."""
    here = path(t)
    end, travelled = t + time, 0.0
    while _within(here, limits):
        if travelled >= distance or t >= end:
            return None
        t += period
        before, here = here, path(t)
        travelled += abs(here - before)
    return here, t


def _within(position: float, limits: tuple[float, float]) -> bool:
    return limits[0] <= position <= limits[1]
