"""The last commands of a core, from any program, with their results."""

from __future__ import annotations

from collections.abc import Callable

from axisbus.errors import with_alarm
from axisbus.motion.command_status import ENDED, Status
from axisbus.session import CommandEvent, CommandSeen

_KEPT = 256


class CommandLog:
    """Holds the commands by their numbers, oldest first. Every method may be called in any thread; none waits for another."""

    def __init__(self, clock: Callable[[], float]) -> None:
        """``clock`` returns the time of the cycles, in seconds."""
        self._clock = clock
        self._seen: dict[int, CommandSeen] = {}

    @property
    def seen(self) -> list[CommandSeen]:
        """All stored commands, oldest first."""
        return list(self._seen.values())

    def give(self, number: int, name: str) -> None:
        """Store a command before it is submitted; if there are too many, remove the oldest."""
        self._seen[number] = CommandSeen(self._clock(), name, Status.BUSY)
        if len(self._seen) > _KEPT:
            for oldest in list(self._seen)[:-_KEPT]:
                self._seen.pop(oldest, None)

    def retract(self, number: int) -> None:
        """Remove a command that was not submitted, because the same one is already queued."""
        self._seen.pop(number, None)

    def hear(self, event: CommandEvent) -> None:
        """Store a change of a command's status."""
        seen = self._seen.get(event.number)
        if seen is not None:
            ended = self._clock() if event.status in ENDED else None
            error = "" if event.error is None else with_alarm(event.error.message, event.error)
            self._seen[event.number] = seen._replace(status=event.status, ended=ended, error=error)
