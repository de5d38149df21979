"""The commands that share one motion: each ends as done when its end has been passed, and the next one takes over."""

from __future__ import annotations

import math
from collections import deque

from axisbus.motion.command_status import CommandStatus, Status, end_as


class CommandEnds:
    """Holds the tickets whose ends are ahead, in order. The owner of the motion holds the ticket of the last command."""

    __slots__ = ("_ahead", "_marks")

    def __init__(self) -> None:
        self._ahead: deque[tuple[CommandStatus, CommandStatus]] = deque()
        self._marks: dict[CommandStatus, float] = {}  # by ticket, as far as known

    def __len__(self) -> int:
        return len(self._ahead)

    def add(self, ticket: CommandStatus, following: CommandStatus) -> None:
        """Let ``ticket`` end when ``following`` takes over (see ``mark``); an error of ``following`` ends ``ticket`` too."""
        self._ahead.append((ticket, following))
        following.then(lambda: self._end(following))

    def pass_to(self, place: float) -> bool:
        """End the commands whose ends have been passed at ``place``; return whether there were any."""
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
        """Set the path position, time or count at which ``ticket`` ends."""
        self._marks[ticket] = place

    def _end(self, last: CommandStatus) -> None:
        """End all commands before ``last``, which has ended."""
        while any(following is last for _, following in self._ahead):
            ticket = self._ahead.popleft()[0]
            self._marks.pop(ticket, None)
            error = last.error
            ticket.finish(Status.DONE if error is None else end_as(error), error)
