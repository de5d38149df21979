"""Event timers (18xxh:05) of event-driven TPDOs: the ones that booting changes, and the result.

Theory of operation
-------------------
Many drives send an event-driven TPDO when its content changes, and again when its event timer expires; some send it only then. With
a timer of one second such a drive shows each of the two edges of a set-point handshake up to a second late, and the loss of the
drive is noticed only after three seconds. So a timer that is too long is shortened if the drive permits writing it. On a bus
without SYNC a timer that is off is started as well. A time set by the user is not changed.
"""

from __future__ import annotations

from dataclasses import dataclass

LIMIT = 20  # ms: a handshake then takes about as long as with SYNC, and the values are as fresh


@dataclass(frozen=True, slots=True)
class EventTimer:
    """One event timer to be changed, in ms (0: off): ``was`` before, ``wanted``, and ``now`` as read back."""

    pdo: str
    values: tuple[str, ...]
    was: int
    wanted: int
    now: int

    @property
    def changed(self) -> bool:
        """Whether the drive has accepted another time."""
        return self.now != self.was

    def __str__(self) -> str:
        what = f"{self.pdo} ({', '.join(name.replace('_', ' ') for name in self.values)})"
        if not self.changed:
            return f"{what} stays {_time(self.was)}: the drive does not accept {_time(self.wanted)}"
        return f"{what} was {_time(self.was)}, is now {_time(self.now)}"


def quicker(timer: int | None, limit: int, *, start: bool) -> int | None:
    """Return the event timer (ms) that a TPDO shall have; None if the drive has none. ``start``: also start one that is off."""
    if timer is None or 0 < timer <= limit:
        return timer
    return limit if timer or start else 0


def _time(milliseconds: int) -> str:
    return f"{milliseconds} ms" if milliseconds else "off"
