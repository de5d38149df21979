"""The event timers (18xxh:05) of event-driven TPDOs: which ones a boot sets to another time, and what has become of them.

Theory of operation
-------------------
Many drives send an event-driven TPDO when its content changes, and again when its event timer has run out; some only then. With a
timer of a second such a drive shows each of the two edges of a set-point handshake up to a second late, and a drive that is gone is
noticed only after three. So a timer that runs too slowly is shortened wherever the drive lets it be written; on a bus without SYNC
one that is off is started as well. A time that the user has set stays.
"""

from __future__ import annotations

from dataclasses import dataclass

LIMIT = 20  # ms: a handshake then costs about as much as with SYNC, and the values are as fresh


@dataclass(frozen=True, slots=True)
class EventTimer:
    """One event timer that was to be changed, in ms (0: off): what it ``was``, what was ``wanted``, and what it is ``now``."""

    pdo: str
    values: tuple[str, ...]
    was: int
    wanted: int
    now: int

    @property
    def changed(self) -> bool:
        """Whether the drive has taken another time."""
        return self.now != self.was

    def __str__(self) -> str:
        what = f"{self.pdo} ({', '.join(name.replace('_', ' ') for name in self.values)})"
        if not self.changed:
            return f"{what} stays {_time(self.was)}: the drive does not take {_time(self.wanted)}"
        return f"{what} was {_time(self.was)}, is now {_time(self.now)}"


def quicker(timer: int | None, limit: int, *, start: bool) -> int | None:
    """Return the event timer (ms) that a TPDO shall have; None where the drive has none. ``start``: also one that is off."""
    if timer is None or 0 < timer <= limit:
        return timer
    return limit if timer or start else 0


def _time(milliseconds: int) -> str:
    return f"{milliseconds} ms" if milliseconds else "off"
