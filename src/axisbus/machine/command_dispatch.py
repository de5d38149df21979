"""Sends the user's commands to the core, and passes the core's events to their handles."""

from __future__ import annotations

import itertools
import threading
from collections import deque

from axisbus.interrupt_guard import sheltered
from axisbus.machine.handle import Handle
from axisbus.motion.command_status import ENDED
from axisbus.session import AnyCommand, AxisSession, CommandEvent, Target


class CommandDispatcher:
    """Gives commands to a session; holds the handle of each active command, by its number.

    A command may end before ``submit`` has returned. Therefore the last event of an ended command is stored until the next command
    is given. Its handle is not stored, because the user may have dropped it.
    """

    def __init__(self, session: AxisSession) -> None:
        self.session = session
        self._lock = threading.RLock()  # re-entrant: logging in here may stop an axis
        self._numbers = itertools.count(1)
        self._given: dict[int, Handle | CommandEvent] = {}
        self._over: deque[int] = deque()
        self._giving = 0  # number of active submissions: above one if a user's log handler submits as well
        session.listen(self._on_event)

    @sheltered
    def submit(self, target: Target, command: AnyCommand, name: str) -> Handle:
        """Submit a command, and return its handle: that of the same command, if one is already queued. Does not block.

        Raises:
            StateError: this is a forked child, in which no core runs.
        """
        return self.give(Handle(name, self.session.waiter), target, command)

    @sheltered
    def give(self, handle: Handle, target: Target, command: AnyCommand) -> Handle:
        """As ``submit``, with the caller's handle object."""
        with self._lock:
            if not self._giving:
                self._forget_ended()
            self._giving += 1
            try:
                return self._submit(handle, target, command)
            finally:
                self._giving -= 1

    def disown(self) -> None:
        """Make this object usable in a forked child, where the thread that held the lock does not run."""
        self._lock = threading.RLock()

    def _submit(self, handle: Handle, target: Target, command: AnyCommand) -> Handle:
        number = next(self._numbers)
        self._given[number] = handle
        used = 0
        try:
            used = self.session.submit(number, target, command, handle.name)
        finally:
            if used != number:
                del self._given[number]
        before = self._given[used]
        if isinstance(before, Handle):
            return before
        handle._on_event(before)
        return handle

    def _forget_ended(self) -> None:
        while self._over:
            del self._given[self._over.popleft()]

    def _on_event(self, event: CommandEvent) -> None:
        handle = self._given.get(event.number)
        if not isinstance(handle, Handle):
            return
        if event.status in ENDED:
            self._given[event.number] = event
            self._over.append(event.number)
        handle._on_event(event)
