"""The commands that share one motion: each ends well when its end has been passed, and the next has control then."""

from __future__ import annotations

import math
from collections import deque

from axisbus.motion.command_status import CommandStatus, Status, end_as


class CommandEnds:
    """Holds the tickets whose ends are ahead, in order; that of the last command is with who runs the motion."""

    __slots__ = ("_ahead", "_marks")

    def __init__(self) -> None:
        self._ahead: deque[tuple[CommandStatus, CommandStatus]] = deque()
        self._marks: dict[CommandStatus, float] = {}  # as far as they are known

    def __len__(self) -> int:
        return len(self._ahead)

    def add(self, ticket: CommandStatus, following: CommandStatus) -> None:
        """Let ``ticket`` end where ``following`` takes over (``mark`` tells where); what ends that one badly ends this as well."""
        self._ahead.append((ticket, following))
        following.then(lambda: self._end(following))

    def pass_to(self, place: float) -> bool:
        """End what has been passed at ``place``; return whether anything has."""
        found = False
        while self._ahead and place >= self._marks.get(self._ahead[0][0], math.inf):
            ticket, following = self._ahead.popleft()
            del self._marks[ticket]
            ticket.finish(Status.DONE)
            if following.busy:
                following.begin()
            found = True
        return found

    def mark(self, ticket: CommandStatus, place: float) -> None:
        """Note where ``ticket`` ends."""
        self._marks[ticket] = place

    def _end(self, last: CommandStatus) -> None:
        """``last`` has ended: so has all that was still ahead before it."""
        while any(following is last for _, following in self._ahead):
            ticket = self._ahead.popleft()[0]
            self._marks.pop(ticket, None)
            error = last.error
            ticket.finish(Status.DONE if error is None else end_as(error), error)
