"""Commands that wait until the command before them has ended (PLCopen's buffer mode *Buffered*)."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from typing import NamedTuple

from axisbus.errors import AxisbusError, StateError, Stopped
from axisbus.motion.command_status import CommandStatus, Status

MOST = 100  # commands that wait for one axis or group


class _Waiting(NamedTuple):
    """A command, the function that begins it, and whether it begins as soon as the one before it has begun, to blend with it."""

    ticket: CommandStatus
    begin: Callable[[], None]
    joins: bool


class Queue:
    """Holds the waiting commands in order, each with the function that begins it; a failed command ends all that wait behind it."""

    __slots__ = ("_waiting",)

    def __init__(self) -> None:
        self._waiting: deque[_Waiting] = deque()

    def __bool__(self) -> bool:
        return bool(self._waiting)

    def add(self, ticket: CommandStatus, begin: Callable[[], None], *, joins: bool = False) -> None:
        """Queue a command. If it ``joins`` the command before it, it begins with that command, or itself waits for its end.

        Raises:
            StateError: too many commands wait already.
        """
        if len(self._waiting) >= MOST:
            raise StateError(
                f"{ticket.name}: {MOST} commands are waiting already",
                remedy="wait for some of their handles before you give more commands",
            )
        self._waiting.append(_Waiting(ticket, begin, joins))

    def next(self) -> None:
        """Begin the first waiting command, if any, and the commands that join it: the command before it has ended successfully."""
        while self._waiting:
            ticket, begin, _ = self._waiting.popleft()
            # A command that takes over ends those that wait behind another one.
            rest, self._waiting = self._waiting, deque()
            begin()
            waits = bool(self._waiting)  # it has queued itself again
            self._waiting.extend(rest)
            if ticket.error is not None:
                self.drop(ticket.name, ticket.error)
            if waits or not self._waiting or not self._waiting[0].joins:
                return

    def drop(self, before: str, error: AxisbusError | None) -> bool:
        """End all waiting commands, because the command ``before`` failed with ``error`` or was replaced; return if any waited."""
        found = bool(self._waiting)
        while self._waiting:
            _end(self._waiting.popleft().ticket, before, error)
        return found


def _end(ticket: CommandStatus, before: str, error: AxisbusError | None) -> None:
    why = Stopped(
        f"{ticket.name} did not begin, because {before} failed",
        observed="" if error is None else error.message,
        remedy="clear that error first, then give the commands that were to follow it",
    )
    ticket.finish(Status.ABORTED, why)
