"""Ctrl-C, SIGTERM and SIGHUP under MIT control: the module is stopped at once, and the program leaves its block."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

_SIGNALS = {"SIGINT": "Ctrl-C", "SIGTERM": "SIGTERM", "SIGHUP": "SIGHUP"}  # not all are on every system


class MitSignalHandlers:
    """Holds the previous handlers. Only in the main thread, where Python runs signal handlers."""

    def __init__(self, hear: Callable[[str], bool]) -> None:
        """``hear`` gets the signal's name, and returns whether to raise it: as KeyboardInterrupt, or SystemExit."""
        self._hear = hear
        self._before: dict[int, Any] = {}

    def begin(self) -> None:
        """Install the handlers."""
        if threading.current_thread() is threading.main_thread():
            for name in _SIGNALS:
                number = getattr(signal, name, None)
                if number is not None and signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
                    self._before[number] = signal.signal(number, self._take)

    def end(self) -> None:
        """Restore the previous handlers."""
        for number, handler in self._before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)
        self._before.clear()

    def _take(self, number: int, _: FrameType | None) -> None:
        if not self._hear(_SIGNALS[signal.Signals(number).name]):
            return
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        raise SystemExit(128 + number)
