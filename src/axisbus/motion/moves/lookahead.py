"""Check that a trajectory stays within position limits: as a whole if it is known in advance, else as far ahead as braking takes.

Theory of operation
-------------------
A path is braked by slowing down its time (``PathClock``). From a speed v with a deceleration a, braking covers at most v²/2a of the
path, in at most v/a of its time. Before each period, the part of the path beyond the end of the period is checked. If this part
leaves the limits, the path is braked at once, from the previous point, whose own part of the path was found to lie within the
limits. So the last target lies within the limits, whatever the trajectory does. A trajectory that itself brakes in time, however
hard, is not changed.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable

from axisbus.motion.moves.profile import braking_distance

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
    way = braking_distance(speed, deceleration)
    stop = ahead + (way if step > 0 else -way)
    if _within(ahead, limits) and _within(stop, limits):
        return None
    left = _leaves(path, t + period, period, limits, way, speed / deceleration)
    return None if left is None else Excess(here, speed, stop, *left)


def _leaves(
    path: Path, t: float, period: float, limits: tuple[float, float], way: float, time: float
) -> tuple[float, float] | None:
    """Return the position and time at which the path is first outside, within the next ``way`` and ``time`` of it."""
    here = path(t)
    end, gone = t + time, 0.0
    while _within(here, limits):
        if gone >= way or t >= end:
            return None
        t += period
        before, here = here, path(t)
        gone += abs(here - before)
    return here, t


def _within(position: float, limits: tuple[float, float]) -> bool:
    return limits[0] <= position <= limits[1]
