"""Begin and end of a planned fault, by time and by a condition; without access to the devices."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Any

Condition = Callable[[Any], bool]


@dataclass(frozen=True, slots=True)
class Moment:
    """Begin and duration of a fault; times in seconds.

    begin: time since the drives started; or ``when``: the fault begins ``after`` s after this condition becomes true. A condition
    that
        is true from the start must first become false.
    every: time from one begin to the next; with ``when`` it is the shortest such time (None: only once)
    lasts: duration (None: permanent)
    """

    begin: float | None = None
    when: Condition | None = None
    after: float = 0.0
    every: float | None = None
    lasts: float | None = None


class Turn(Enum):
    """Result of a step."""

    NOTHING = 0
    BEGINS = 1
    ENDS = 2


class Cue:
    """Timing of one fault: the time of its next begin and of its end."""

    def __init__(self, moment: Moment) -> None:
        self._moment = moment
        self._due = moment.begin
        self._over: float | None = None
        self._next = 0.0  # earliest time of the next begin
        self._held = True  # whether the condition was true in the previous step
        self._ended = False  # whether it will not begin again

    def step(self, now: float, values: Any) -> Turn:
        """Return the change due at ``now``; ``values`` are for the condition. At most one change per step."""
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
            self._due = max(due + moment.every, now)  # missed begins are skipped
