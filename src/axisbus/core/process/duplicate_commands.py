"""Commands that are one with another that waits: what happens to that one happens to them."""

from __future__ import annotations

import threading

from axisbus.motion.command_status import ENDED
from axisbus.session import CommandEvent

_REMEMBERED = 256  # commands that have ended


class DuplicateCommands:
    """Holds who is one with whom, and how the last commands have ended; for any thread."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._same: dict[int, list[int]] = {}  # by the number of the one that waits
        self._over: dict[int, CommandEvent] = {}

    def join(self, number: int, kept: int) -> CommandEvent | None:
        """Let ``number`` be one with ``kept``; return how that has ended, where it has meanwhile."""
        with self._lock:
            over = self._over.get(kept)
            if over is not None:
                return over._replace(number=number)
            self._same.setdefault(kept, []).append(number)
        return None

    def all_of(self, event: CommandEvent) -> list[CommandEvent]:
        """Return what is to be told: the event of a command, and the same of each that is one with it."""
        with self._lock:
            same = self._same.get(event.number, [])
            if event.status in ENDED:
                self._same.pop(event.number, None)
                self._over[event.number] = event
            if len(self._over) > _REMEMBERED:
                del self._over[next(iter(self._over))]
        return [event, *(event._replace(number=number) for number in same)]
