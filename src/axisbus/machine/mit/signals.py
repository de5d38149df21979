"""Ctrl-C, SIGTERM and SIGHUP while a module is led: it takes its way out at once, and the program leaves its block."""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

_SIGNALS = {"SIGINT": "Ctrl-C", "SIGTERM": "SIGTERM", "SIGHUP": "SIGHUP"}  # not all are on every system


class MitSignalHandlers:
    """Holds the handlers that were in force before; in the main thread alone, where Python delivers signals."""

    def __init__(self, hear: Callable[[str], bool]) -> None:
        """``hear`` is told which came, and returns whether it is to be raised: as KeyboardInterrupt, or SystemExit."""
        self._hear = hear
        self._before: dict[int, Any] = {}

    def begin(self) -> None:
        """Take them over."""
        if threading.current_thread() is threading.main_thread():
            for name in _SIGNALS:
                number = getattr(signal, name, None)
                if number is not None and signal.getsignal(number) is not signal.SIG_IGN:  # as under nohup
                    self._before[number] = signal.signal(number, self._take)

    def end(self) -> None:
        """Give them back."""
        for number, handler in self._before.items():
            signal.signal(number, handler if handler is not None else signal.SIG_DFL)
        self._before.clear()

    def _take(self, number: int, _: FrameType | None) -> None:
        if not self._hear(_SIGNALS[signal.Signals(number).name]):
            return
        if number == signal.SIGINT:
            raise KeyboardInterrupt
        raise SystemExit(128 + number)
