"""Commands that are identical to a queued one: they share its events."""

from __future__ import annotations

import threading

from axisbus.motion.command_status import ENDED
from axisbus.session import CommandEvent

_REMEMBERED = 256  # ended commands


class DuplicateCommands:
    """Holds the identical commands, and the ends of the last commands; for any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._same: dict[int, list[int]] = {}  # by the number of the queued one
        self._over: dict[int, CommandEvent] = {}

    def join(self, number: int, kept: int) -> CommandEvent | None:
        """Make ``number`` share the events of ``kept``; return the end of that, if it has ended meanwhile."""
        with self._lock:
            over = self._over.get(kept)
            if over is not None:
                return over._replace(number=number)
            self._same.setdefault(kept, []).append(number)
        return None

    def all_of(self, event: CommandEvent) -> list[CommandEvent]:
        """Return the event of a command, and a copy for each command that is identical to it."""
        with self._lock:
            same = self._same.get(event.number, [])
            if event.status in ENDED:
                self._same.pop(event.number, None)
                self._over[event.number] = event
            if len(self._over) > _REMEMBERED:
                del self._over[next(iter(self._over))]
        return [event, *(event._replace(number=number) for number in same)]
