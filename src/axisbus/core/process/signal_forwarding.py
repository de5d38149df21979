"""Signals that a program cannot take: it is in a call that keeps Python's interpreter, and no thread of its own runs.

Theory of operation
-------------------
Python writes the number of each signal into a socket the moment that it comes (``signal.set_wakeup_fd``); a thread of the program
takes it out and asks for the stop. The core holds the same end and only looks: what has lain there for ``_PATIENCE`` is taken by
nobody now, so the core stops the axes. When the call is over, the program takes the signal as ever.
"""

from __future__ import annotations

import signal
import socket
from contextlib import suppress

STOPPING: dict[int, str] = {
    signal.SIGINT: "Ctrl-C",
    signal.SIGTERM: "SIGTERM",
}  # what ends a program, and stops its axes
INTERRUPTED = "its program was interrupted (Ctrl-C, or the stop button of a notebook)"
_PATIENCE = 0.1  # seconds
_MOST = 64


class SignalForwarder:
    """Looks at the signals of a program; holds since when one has been waiting, and how many have been told."""

    def __init__(self, end: socket.socket, names: dict[int, str]) -> None:
        """``end``: out of which the program takes its signals; ``names``: of those that stop the axes, by number."""
        self._end = end
        self._names = names
        self._since: float | None = None
        self._told = 0

    def look(self, now: float) -> tuple[str, int] | None:
        """Return the last signal that waits in vain, and how many do; None where that is no news. ``now``: in s, monotonic."""
        waiting = self._waiting()
        if not waiting:
            self._since, self._told = None, 0
            return None
        if self._since is None:
            self._since = now
        if now - self._since < _PATIENCE or len(waiting) <= self._told:
            return None
        self._told = len(waiting)
        return waiting[-1], len(waiting)

    def _waiting(self) -> list[str]:
        with suppress(OSError):  # nothing
            numbers = self._end.recv(_MOST, socket.MSG_PEEK | socket.MSG_DONTWAIT)
            return [self._names[number] for number in numbers if number in self._names]
        return []
