"""Signals that a program cannot handle, because it is in a call that holds Python's interpreter, so that none of its threads runs.

Theory of operation
-------------------
Python writes the number of each signal into a socket as soon as it arrives (``signal.set_wakeup_fd``); a thread of the program
reads it and requests the stop. The core holds the same end and only peeks. If a number stays there for ``_PATIENCE``, no thread
reads it at present, so the core stops the axes. When the call is over, the program handles the signal as usual.
"""

from __future__ import annotations

import signal
import socket
from contextlib import suppress

STOPPING: dict[int, str] = {
    signal.SIGINT: "Ctrl-C",
    signal.SIGTERM: "SIGTERM",
}  # signals that end a program, and stop its axes
INTERRUPTED = "its program was interrupted (Ctrl-C, or the stop button of a notebook)"
_PATIENCE = 0.1  # seconds
_MOST = 64


class SignalForwarder:
    """Checks the signals of a program; holds the time since when one is unread, and the number of reported ones."""

    def __init__(self, end: socket.socket, names: dict[int, str]) -> None:
        """``end``: the socket from which the program reads its signals; ``names``: of those that stop the axes, by number."""
        self._end = end
        self._names = names
        self._since: float | None = None
        self._reported = 0

    def poll(self, now: float) -> tuple[str, int] | None:
        """Return the last unread signal, and the number of unread ones; None if nothing is new. ``now``: in s, monotonic."""
        waiting = self._waiting()
        if not waiting:
            self._since, self._reported = None, 0
            return None
        if self._since is None:
            self._since = now
        if now - self._since < _PATIENCE or len(waiting) <= self._reported:
            return None
        self._reported = len(waiting)
        return waiting[-1], len(waiting)

    def _waiting(self) -> list[str]:
        with suppress(OSError):  # nothing to read
            numbers = self._end.recv(_MOST, socket.MSG_PEEK | socket.MSG_DONTWAIT)
            return [self._names[number] for number in numbers if number in self._names]
        return []
