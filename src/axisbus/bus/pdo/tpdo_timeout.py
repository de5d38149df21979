"""Reception deadlines: a TPDO that stops coming causes an event with its age, and so does its return."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum

HISTORY = 64


class Reception(Enum):
    """Kind of an event of a TPDO."""

    MISSING = "has stopped coming"
    RETURNED = "comes again"


@dataclass(frozen=True, slots=True)
class PdoEvent:
    """A TPDO that stopped coming, or came again after that.

    ``age`` is the time without a frame (seconds), ``deadline`` the permitted time, ``stamp`` the time of the event. ``never``: no
    frame has come since the node became operational.
    """

    node_id: int
    pdo: str
    cob_id: int
    what: Reception
    age: float
    deadline: float
    stamp: float
    never: bool = False

    def __str__(self) -> str:
        text = f"node {self.node_id}: {self.pdo} ({self.cob_id:03X}h) "
        if self.what is Reception.RETURNED:
            return f"{text}comes again after {_ms(self.age)} ms"
        if self.never:
            text += f"has not come since the node became operational {_ms(self.age)} ms ago"
        else:
            text += f"no longer comes: the last one is {_ms(self.age)} ms old"
        return f"{text}, expected within {_ms(self.deadline)} ms"


def _ms(seconds: float) -> str:
    return f"{seconds * 1000:.0f}"


class Deadline:
    """The deadline of one TPDO; holds state: the start of the wait, whether it is missing, and the excused time.

    ``age`` is the maximum number of seconds between two frames; infinity for a TPDO that is sent on change only, whose silence has
    no meaning. ``since`` is infinite while no frame is expected. If a frame has come as expected, ``Deadlines`` records it without
    ``step``.
    """

    __slots__ = ("_cob_id", "_name", "_node_id", "age", "excused", "missing", "since", "stamp")

    def __init__(self, node_id: int, name: str, cob_id: int, age: float) -> None:
        """``age``: seconds that may pass between two frames."""
        self._node_id, self._name, self._cob_id, self.age = node_id, name, cob_id, age
        self.since = math.inf  # time of the last frame, or of the start of the wait
        self.stamp = -math.inf
        self.excused = 0.0
        self.missing = False

    def step(self, now: float, stamp: float, expected: bool, held_up: float) -> PdoEvent | None:
        """Return the event since the last call, if any; all times in seconds.

        ``stamp`` is the time of the newest frame (minus infinity: never). ``expected``: the node is operational. ``held_up``: delay
        of this master just now, without a SYNC from it; it does not count as silence of the drive.
        """
        if not expected:
            self.since, self.stamp, self.missing = math.inf, -math.inf, False
            return None
        if self.since == math.inf:
            self.since, self.excused = now, 0.0
        if stamp > self.since:
            return self._came(now, stamp)
        self.excused += held_up
        if self.missing or now - self.since - self.excused <= self.age:
            return None
        self.missing = True
        return self._event(Reception.MISSING, now - self.since, now)

    def _came(self, now: float, stamp: float) -> PdoEvent | None:
        before, self.since = self.since, stamp
        was_missing, self.missing = self.missing, False
        event = self._event(Reception.RETURNED, stamp - before, now) if was_missing else None
        self.stamp, self.excused = stamp, 0.0
        return event

    def _event(self, what: Reception, age: float, now: float) -> PdoEvent:
        never = self.stamp == -math.inf
        return PdoEvent(self._node_id, self._name, self._cob_id, what, age, self.age, now, never)


class Deadlines:
    """The deadlines of one axis's TPDOs; holds state: the time of the last check."""

    def __init__(self, deadlines: Sequence[Deadline], period: float) -> None:
        """``period``: seconds between two checks in normal operation."""
        self._deadlines = tuple(deadlines)
        self._period = period
        self._before: float | None = None

    def all_met(self, stamps: Sequence[float]) -> bool:
        """Whether each TPDO came as expected: the present wait of each began with its frame in ``stamps`` (in this order)."""
        pairs = zip(self._deadlines, stamps, strict=True)
        return all(deadline.since == stamp and not deadline.missing for deadline, stamp in pairs)

    def met(self, stamps: Sequence[float], now: float) -> None:
        """Record skipped checks, the last one at ``now``: there was no event, and the last frames came at ``stamps``."""
        self._before = now
        for deadline, stamp in zip(self._deadlines, stamps, strict=True):
            if deadline.since != stamp:
                deadline.since = deadline.stamp = stamp
                deadline.excused = 0.0

    def step(self, now: float, stamps: Sequence[float], expected: bool) -> list[PdoEvent]:
        """Return the events since the last call; ``stamps`` are in the order of the deadlines."""
        gap = 0.0 if self._before is None else now - self._before
        self._before = now
        held_up = gap - 2 * self._period if gap > 2 * self._period else 0.0
        found: list[PdoEvent] = []
        for deadline, stamp in zip(self._deadlines, stamps, strict=True):
            if expected and not deadline.missing and deadline.since < stamp:  # the frame has come as expected
                deadline.since = deadline.stamp = stamp
                deadline.excused = 0.0
                continue
            event = deadline.step(now, stamp, expected, held_up)
            if event is not None:
                found.append(event)
        return found
