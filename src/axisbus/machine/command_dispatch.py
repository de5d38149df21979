"""Commands on their way from a user to the core, and what the core tells of them on its way back to their handles."""

from __future__ import annotations

import itertools
import threading
from collections import deque

from axisbus.interrupt_guard import sheltered
from axisbus.machine.handle import Handle
from axisbus.motion.command_status import ENDED
from axisbus.session import AnyCommand, AxisSession, CommandEvent, Target


class CommandDispatcher:
    """Gives commands to a session; holds the handle of each that is under way, by its number.

    A command may end before ``submit`` has returned. So what has ended is kept, as its last event and not as its handle (which its
    user may have dropped), until the next command is given.
    """

    def __init__(self, session: AxisSession) -> None:
        self.session = session
        self._lock = threading.RLock()  # what collects garbage in here may log, and who logs may stop an axis
        self._numbers = itertools.count(1)
        self._given: dict[int, Handle | CommandEvent] = {}
        self._over: deque[int] = deque()
        self._giving = 0  # how many submissions are under way: more than one where a user's log handler gives one as well
        session.listen(self._hear)

    @sheltered
    def submit(self, target: Target, command: AnyCommand, name: str) -> Handle:
        """Give a command, and return its handle: that of the same command where it waits already; does not block.

        Raises:
            StateError: this is a forked child, in which no core runs.
        """
        return self.give(Handle(name, self.session.waiter), target, command)

    @sheltered
    def give(self, handle: Handle, target: Target, command: AnyCommand) -> Handle:
        """As ``submit``, with a handle of its own kind."""
        with self._lock:
            if not self._giving:
                self._forget_ended()
            self._giving += 1
            try:
                return self._submit(handle, target, command)
            finally:
                self._giving -= 1

    def disown(self) -> None:
        """Be usable in a forked child, where whoever had the lock does not run."""
        self._lock = threading.RLock()

    def _submit(self, handle: Handle, target: Target, command: AnyCommand) -> Handle:
        number = next(self._numbers)
        self._given[number] = handle
        kept = 0
        try:
            kept = self.session.submit(number, target, command, handle.name)
        finally:
            if kept != number:
                del self._given[number]
        before = self._given[kept]
        if isinstance(before, Handle):
            return before
        handle._on_event(before)
        return handle

    def _forget_ended(self) -> None:
        while self._over:
            del self._given[self._over.popleft()]

    def _hear(self, event: CommandEvent) -> None:
        handle = self._given.get(event.number)
        if not isinstance(handle, Handle):
            return
        if event.status in ENDED:
            self._given[event.number] = event
            self._over.append(event.number)
        handle._on_event(event)
