"""The profile of one axis through the end positions of several moves, without a stop between them.

Theory of operation
-------------------
A *leg* is one move: from the end of the previous leg to its own end, with its own velocity, acceleration and deceleration. The end
between two legs, the *transition*, is passed at the velocity that the buffer mode of the second leg requests, as far as there is
room. Backwards from the last end, each leg must be able to brake to its exit velocity; forwards from the present position, it must
be able to reach that velocity. If two legs have opposite directions, or one has no length, the axis stops at the transition.

Within a leg the velocity changes to that of the leg, is constant, and changes to that of the transition. If the leg is too short
for that, the velocity has a peak below the leg's velocity. If both ends are faster than the leg, it has a valley above it. Each leg
therefore has three phases of constant acceleration.

Legs that are added later change nothing up to the present time, and can only raise transition velocities: an axis that could brake
to the planned velocity can brake to a higher one.

If the jerk is limited, the axis follows the *mean* of the profile over a time window (``jerk_limited``). To pass a transition at
the transition velocity, the profile holds that velocity for half the window before and after the transition. At a stop the profile
rests for the whole window, until the mean has arrived as well. If a leg is too short, it holds the velocity for less time, and the
mean deviates slightly from it.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

from axisbus.motion.blending.mode import BufferMode
from axisbus.motion.moves.profile_from_speed import ProfileFromSpeed

_STORED_SECONDS = 1.0  # seconds of the past that are stored


class Leg(NamedTuple):
    """One move: to ``end`` (unit) with ``velocity`` (unit/s), ``up`` and ``down`` (unit/s²), all above 0.

    ``mode``: how it takes over from the previous move.
    """

    end: float
    velocity: float
    up: float
    down: float
    mode: BufferMode = BufferMode.BUFFERED


class LegTransition(NamedTuple):
    """The end of a leg: time (s), speed, requested speed, and ``turns``: the axis reverses there, or the next leg has no length.

    ``hold_time``: seconds for which the speed is held after the transition, for the mean.
    """

    time: float
    speed: float
    requested: float
    turns: bool
    hold_time: float = 0.0


class _Piece(NamedTuple):
    """A phase of constant acceleration: its start time (s), and the position, speed and acceleration at its start."""

    begin: float
    position: float
    speed: float
    rate: float


@dataclass(frozen=True, slots=True)
class BlendedProfile:
    """A profile through the ends of legs to rest at ``end``, after ``duration`` seconds.

    ``transitions``: the transitions that were ahead when it was planned. ``mean``: length of the averaging window in seconds.
    """

    pieces: tuple[_Piece, ...]
    end: float
    duration: float
    transitions: tuple[LegTransition, ...]
    mean: float = 0.0

    @property
    def span(self) -> tuple[float, float]:
        """The lowest and the highest position."""
        positions = [piece.position for piece in self.pieces]
        return min(*positions, self.end), max(*positions, self.end)

    @property
    def top_speed(self) -> float:
        """The highest speed in unit/s."""
        return max(abs(piece.speed) for piece in self.pieces)

    @property
    def top_acceleration(self) -> float:
        """The highest acceleration in unit/s²."""
        return max(abs(piece.rate) for piece in self.pieces)

    def passed_at(self, transition: LegTransition) -> float:
        """Return the time of the mean at which the axis has passed a transition; at a stop, the mean must have arrived too."""
        return transition.time if transition.speed else transition.time + 0.5 * self.mean

    def position(self, t: float) -> float:
        """Return the position at ``t`` seconds; beyond an end, the position at that end."""
        if t >= self.duration:
            return self.end
        piece = self._at(t)
        t = max(t - piece.begin, 0.0)
        return piece.position + piece.speed * t + 0.5 * piece.rate * t * t

    def speed(self, t: float) -> float:
        """Return the velocity at ``t`` seconds (unit/s); at the end, 0."""
        if t >= self.duration:
            return 0.0
        piece = self._at(t)
        return piece.speed + piece.rate * max(t - piece.begin, 0.0)

    def _at(self, t: float) -> _Piece:
        return self.pieces[max(bisect_right(self.pieces, t, key=_begin_of) - 1, 0)]


def profile_from_rest(start: float, legs: Sequence[Leg], mean: float = 0.0) -> BlendedProfile:
    """Return the profile from rest at ``start`` through the ends of ``legs``; ``mean``: averaging window in seconds."""
    return _planned((), 0.0, start, 0.0, legs, mean)


def profile_of_move(onward: ProfileFromSpeed, mean: float = 0.0) -> BlendedProfile:
    """Return the profile of one active move, which began at the speed that its axis had."""
    pieces, t = [], 0.0
    for seconds, position, speed, rate in onward.pieces:
        pieces.append(_Piece(t, position, speed, rate))
        t += seconds
    return BlendedProfile(tuple(pieces), onward.end, t, (LegTransition(t, 0.0, 0.0, turns=False),), mean)


def extended_profile(profile: BlendedProfile, t: float, legs: Sequence[Leg]) -> BlendedProfile:
    """Return ``profile`` up to ``t`` seconds, continued through the ends of ``legs``: the legs still ahead, and new ones.

    The first leg must be the active one, with the ramps that it was planned with. If the profile holds a velocity after a
    transition for the mean, it keeps holding it.
    """
    t = max(
        [
            t,
            *(
                transition.time + transition.hold_time
                for transition in profile.transitions
                if transition.time <= t
            ),
        ]
    )
    head = tuple(piece for piece in profile.pieces if piece.begin < t)
    kept = tuple(
        piece
        for number, piece in enumerate(head, 1)
        if number == len(head) or head[number].begin > t - _STORED_SECONDS
    )
    return _planned(kept, t, profile.position(t), profile.speed(t), legs, profile.mean)


def _begin_of(piece: _Piece) -> float:
    return piece.begin


def _planned(
    head: tuple[_Piece, ...], t: float, position: float, speed: float, legs: Sequence[Leg], mean: float
) -> BlendedProfile:
    pieces, distances = list(head), _distances(position, legs)
    transitions: list[LegTransition] = []
    requests = _requested_exits(distances, legs)
    exits = _exits(abs(speed), distances, legs, requests)
    entry, hold_time = abs(speed), 0.0
    for leg, distance, requested, speed_there in zip(legs, distances, requests, exits, strict=True):
        sign = math.copysign(1.0, distance)
        phases = _phases(abs(distance), entry, speed_there, leg, hold_time, 0.5 * mean)
        if transitions and entry and mean:
            transitions[-1] = transitions[-1]._replace(hold_time=phases[0][0])
        for seconds, first, rate in phases:
            if seconds > 0.0:
                pieces.append(_Piece(t, position, sign * first, sign * rate))
                position += sign * (first * seconds + 0.5 * rate * seconds * seconds)
                t += seconds
        transitions.append(LegTransition(t, speed_there, *requested))
        position, entry, hold_time = leg.end, speed_there, 0.5 * mean
        if not speed_there and mean and len(transitions) < len(legs):
            transitions[-1] = transitions[-1]._replace(hold_time=mean)
            pieces.append(_Piece(t, position, 0.0, 0.0))
            t += mean
    if len(pieces) == len(head):
        pieces.append(_Piece(t, position, 0.0, 0.0))
    return BlendedProfile(tuple(pieces), legs[-1].end, t, tuple(transitions), mean)


def _distances(position: float, legs: Sequence[Leg]) -> list[float]:
    """Return the signed distance of each leg."""
    starts = [position, *(leg.end for leg in legs[:-1])]
    return [leg.end - start for start, leg in zip(starts, legs, strict=True)]


def _requested_exits(distances: Sequence[float], legs: Sequence[Leg]) -> list[tuple[float, bool]]:
    """Return for the end of each leg the requested speed, and whether the axis reverses there or does not move on."""
    found = []
    for (leg, after), (distance, beyond) in zip(pairwise(legs), pairwise(distances), strict=True):
        turns = after.mode.blends and not distance * beyond > 0.0
        found.append((after.mode.velocity(leg.velocity, after.velocity), turns))
    return [*found, (0.0, False)]


def _exits(
    speed: float, distances: Sequence[float], legs: Sequence[Leg], requests: Sequence[tuple[float, bool]]
) -> list[float]:
    """Return the exit speed of each leg: no higher than the axis can reach before it, or brake from after it."""
    exits = [0.0 if turns else requested for requested, turns in requests]
    for number in range(len(legs) - 2, -1, -1):
        after = number + 1
        exits[number] = min(
            exits[number], math.sqrt(exits[after] ** 2 + 2.0 * legs[after].down * abs(distances[after]))
        )
    for number, (leg, distance) in enumerate(zip(legs, distances, strict=True)):
        exits[number] = min(exits[number], math.sqrt(speed * speed + 2.0 * leg.up * abs(distance)))
        speed = exits[number]
    return exits


def _phases(
    length: float, entry: float, exit_speed: float, leg: Leg, hold_time: float, hold_after: float
) -> list[tuple[float, float, float]]:
    """Return the phases of a leg of ``length``: duration in s, initial speed and acceleration; all speeds are magnitudes.

    ``hold_time``: seconds for which the entry speed is held; ``hold_after``: seconds for which the exit speed is held. Both as far
    as there is room.
    """
    if not hold_after:
        return _between(length, entry, exit_speed, leg)
    needed = abs(exit_speed * exit_speed - entry * entry) / (
        2.0 * (leg.up if exit_speed > entry else leg.down)
    )
    kept = entry * hold_time + exit_speed * hold_after
    share = min(1.0, max(length - needed, 0.0) / kept) if kept else 0.0
    between = _between(max(length - share * kept, 0.0), entry, exit_speed, leg)
    return [
        (share * hold_time if entry else 0.0, entry, 0.0),
        *between,
        (share * hold_after if exit_speed else 0.0, exit_speed, 0.0),
    ]


def _between(length: float, entry: float, exit_speed: float, leg: Leg) -> list[tuple[float, float, float]]:
    """Return the phases between the two holds."""
    kept = _middle_speed(length, entry, exit_speed, leg)
    first = leg.up if kept > entry else -leg.down
    last = leg.up if exit_speed > kept else -leg.down
    begun, ended = (kept - entry) / first, (exit_speed - kept) / last
    left = length - 0.5 * (entry + kept) * begun - 0.5 * (kept + exit_speed) * ended
    even = max(left, 0.0) / kept if kept else 0.0
    return [(begun, entry, first), (even, kept, 0.0), (ended, kept, last)]


def _middle_speed(length: float, entry: float, exit_speed: float, leg: Leg) -> float:
    """Return the constant speed in the middle of a leg: the leg's velocity, a lower peak, or a higher valley."""
    up, down, own = leg.up, leg.down, leg.velocity
    if entry <= own and exit_speed <= own:
        peak = (2.0 * up * down * length + down * entry * entry + up * exit_speed * exit_speed) / (up + down)
        return max(min(own, math.sqrt(peak)), entry, exit_speed)
    if entry > own and exit_speed > own:
        valley = (up * entry * entry + down * exit_speed * exit_speed - 2.0 * up * down * length) / (
            up + down
        )
        return min(max(own, math.sqrt(max(valley, 0.0))), entry, exit_speed)
    return own
