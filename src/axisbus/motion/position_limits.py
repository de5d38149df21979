"""Position limits in numbers: where an axis may be led, where it can still stop, and what is allowed from beyond a limit.

Every kind of motion asks these functions: the watch over velocity and torque, moves, paths, followers of a master, gantry pairs,
and the check of a call.

Theory of operation
-------------------
A *room* is the range within which a motion keeps an axis. It is that of the position limits, widened to where the motion begins: an
axis that is beyond a limit may come back, and goes no farther out. While it comes back, the room follows it (``narrowed``), so that
it does not go out again.

A measured position wanders: an encoder shows ±2 increments, and two positions of an axis at rest differ by ``NOISE``. ``window`` is
that in the unit of the positions: what is beyond a limit by no more than that is at the limit.

An axis without a modulo has the room of its drive's count, too: 607Ah and 6064h are INTEGER32, and a target beyond its end is one
at its other end.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from axisbus.motion.moves.profile import braking_distance
from axisbus.units import INT32_HALF, INT32_LEAST, wrap

NOISE = 4.0  # increments


class Room(NamedTuple):
    """The lowest and the highest position that a motion may come to."""

    low: float
    high: float

    def has(self, position: float) -> bool:
        """Whether ``position`` is within it."""
        return self.low <= position <= self.high


UNLIMITED = Room(-math.inf, math.inf)


def widened(limits: tuple[float, float], start: float, margin: float) -> Room:
    """Return the room of a motion from ``start``: one from outside may come back, but go no farther out."""
    return Room(min(limits[0], start) - margin, max(limits[1], start) + margin)


def narrowed(room: Room, limits: tuple[float, float], position: float, window: float) -> Room:
    """Return the room of a motion that has come to ``position``: what it has left beyond ``limits`` it does not enter again."""
    low, high = min(limits[0], position) - window, max(limits[1], position) + window
    return Room(max(room.low, low), min(room.high, high))


def is_beyond(limits: tuple[float, float], position: float, window: float = 0.0) -> bool:
    """Whether ``position`` is outside ``limits`` by more than ``window``."""
    return not limits[0] - window <= position <= limits[1] + window


def room_of_way(
    limits: tuple[float, float], start: float, window: float, margin: float
) -> tuple[float, float]:
    """Return within what a way from ``start``, which may come by there again, must lie.

    One that begins beyond a limit by ``window`` at most begins at the limit (``margin``: what its arithmetic may be off).
    """
    if not is_beyond(limits, start) or is_beyond(limits, start, window):
        return limits
    return widened(limits, start, margin)


def allowed_end(limits: tuple[float, float], start: float, end: float, window: float = 0.0) -> float | None:
    """Return where a motion from ``start`` that is to end at ``end`` may end; None: it leads out of ``limits``.

    From beyond a limit it may end beyond it, no farther out than it began. An end that is beyond a limit by ``window`` at most
    becomes the limit.
    """
    if widened(limits, start, 0.0).has(end):
        return end
    return None if is_beyond(limits, end, window) else min(max(end, limits[0]), limits[1])


def rest(position: float, velocity: float, deceleration: float) -> float:
    """Return where an axis comes to rest that brakes now."""
    return position + math.copysign(braking_distance(velocity, deceleration), velocity)


def leaves(room: Room, position: float, velocity: float, deceleration: float) -> float | None:
    """Return where an axis comes to rest that brakes now, where that is outside in the direction in which it goes; else None."""
    stop = rest(position, velocity, deceleration)
    if velocity > 0.0:
        return stop if stop > room.high else None
    return stop if stop < room.low else None


def braking(
    room: Room, position: float, velocity: float, usual: float, hardest: float, period: float
) -> float:
    """Return with what an axis is to brake in steps (``steps_to_rest``): the ``usual`` deceleration, or what keeps it in its room.

    ``hardest`` at most, which is also the answer if nothing keeps it there.
    """
    left = max(room.high - position if velocity > 0.0 else position - room.low, 0.0)
    speed = abs(velocity)
    if not speed or left == math.inf:
        return usual
    # In n steps the speed falls to 0 if the deceleration is from v/(n+1)T to v/nT; the way is T (n v - d T n (n+1) / 2).
    steps = max(1, math.ceil(2.0 * left / (speed * period)))
    needed = 2.0 * (steps * speed - left / period) / (period * steps * (steps + 1))
    return max(usual, min(needed, hardest))


def steps_to_rest(position: float, velocity: float, deceleration: float, period: float) -> list[float]:
    """Return the positions of an axis that brakes now, one for each cycle, with the present one.

    ``velocity`` is that of the cycle before. In each cycle it is less by what the deceleration allows: no brake is shorter.
    """
    places, speed = [position, position], abs(velocity)
    while (speed := speed - deceleration * period) > 0.0:
        places[-1] = position = position + math.copysign(speed * period, velocity)
        places.append(position)
    return places


def room_of_count(position: int) -> Room:
    """Return the unwrapped increments that the drive of an axis at ``position`` shows without a wrap of its count."""
    lap = position - wrap(position)
    return Room(lap + INT32_LEAST, lap + INT32_HALF - 1)
