"""When a planned fault begins and when it is over, by the time and by a condition; decides alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

Condition = Callable[[Any], bool]


@dataclass(frozen=True, slots=True)
class Moment:
    """When a fault begins, and for how long; times in seconds.

    begin: since the drives began; or ``when``: as soon as that becomes true, and ``after`` s later. What is so from the beginning
        must have been otherwise in between.
    every: again after so long; with ``when`` it is the shortest time from one begin to the next (None: only once)
    lasts: how long (None: for good)
    """

    begin: float | None = None
    when: Condition | None = None
    after: float = 0.0
    every: float | None = None
    lasts: float | None = None


class Turn(Enum):
    """What a cue says."""

    NOTHING = 0
    BEGINS = 1
    ENDS = 2


class Cue:
    """One fault's place in time; holds when it is due next, and when what is under way is over."""

    def __init__(self, moment: Moment) -> None:
        self._moment = moment
        self._due = moment.begin
        self._over: float | None = None
        self._next = 0.0  # not before
        self._held = True  # whether the condition was met in the step before
        self._ended = False  # whether it will not begin again

    def step(self, now: float, values: Any) -> Turn:
        """Say what is to be done at ``now``; ``values`` are for the condition. One thing at each step."""
        self._watch(now, values)
        if self._over is not None and now >= self._over:
            self._over = None
            return Turn.ENDS
        if self._due is None or now < self._due or self._over is not None:
            return Turn.NOTHING
        self._begin(now)
        return Turn.BEGINS

    def _watch(self, now: float, values: Any) -> None:
        if self._moment.when is None:
            return
        holds = bool(self._moment.when(values))
        rises, self._held = holds and not self._held, holds
        if rises and self._due is None and not self._ended and now >= self._next:
            self._due = now + self._moment.after

    def _begin(self, now: float) -> None:
        moment, due = self._moment, self._due
        assert due is not None
        self._over = None if moment.lasts is None else now + moment.lasts
        self._due, self._ended = None, moment.every is None
        if moment.every is None:
            return
        self._next = now + moment.every
        if moment.when is None:
            self._due = max(due + moment.every, now)  # what was missed is not made up for
