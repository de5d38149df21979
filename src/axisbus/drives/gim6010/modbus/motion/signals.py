"""Ctrl-C, SIGTERM and the like while an axis is open: between our calls they end what runs, within them they wait."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

# Ctrl-C, a termination, a terminal that is closed, Ctrl-Z (a program that is suspended commands nothing); some systems lack some.
_NAMES = ("SIGINT", "SIGTERM", "SIGHUP", "SIGTSTP")
_NUMBERS = tuple(getattr(signal, name) for name in _NAMES if hasattr(signal, name))
_KEYS = ("SIGINT", "SIGTSTP")
_ENDED = 128  # and the signal: the exit code of a program that one has ended


class ModbusSignalHandlers:
    """Holds what came; installed in the main thread alone, elsewhere nothing comes."""

    def __init__(self) -> None:
        self.count = 0
        self._came: int | None = None
        self._sheltered = 0
        self._before: dict[int, Any] = {}

    def install(self) -> None:
        """Take the signals over."""
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._hear) for number in _NUMBERS}

    def restore(self) -> None:
        """Give them back to whoever had them; harmless when repeated."""
        for number, handler in self._before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        self._before = {}

    @contextmanager
    def sheltered(self) -> Iterator[None]:
        """Let the block ask with ``check`` when it is safe to be ended."""
        self._sheltered += 1
        try:
            yield
        finally:
            self._sheltered -= 1

    def check(self) -> None:
        """End what runs, where a signal came.

        Raises:
            KeyboardInterrupt: Ctrl-C or Ctrl-Z. SystemExit: SIGTERM or SIGHUP, with 143 or 129.
        """
        if self._came is not None:
            number, self._came = self._came, None
            if signal.Signals(number).name in _KEYS:
                raise KeyboardInterrupt
            raise SystemExit(_ENDED + number)

    def _hear(self, number: int, _: FrameType | None) -> None:
        self.count += 1
        self._came = number
        if not self._sheltered:
            self.check()
