"""Ctrl-C, SIGTERM and similar signals while an axis is open: they end the program between its calls, and wait during a call."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

from axisbus.system.signals import present

# Ctrl-C, a termination, a terminal that is closed, Ctrl-Break, Ctrl-Z (a program that is suspended commands nothing).
_NUMBERS = present("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK", "SIGTSTP")
_KEYS = present("SIGINT", "SIGTSTP")
_ENDED = 128  # plus the number of the signal is the exit code of a program that a signal has ended


class ModbusSignalHandlers:
    """Stores the last signal; handlers can be installed in the main thread only, so other threads get no signal."""

    def __init__(self) -> None:
        self.count = 0
        self._came: int | None = None
        self._sheltered = 0
        self._before: dict[int, Any] = {}

    def install(self) -> None:
        """Install the handlers."""
        if threading.current_thread() is threading.main_thread():
            self._before = {number: signal.signal(number, self._hear) for number in _NUMBERS}

    def restore(self) -> None:
        """Restore the previous handlers; harmless if repeated."""
        for number, handler in self._before.items():
            signal.signal(number, signal.SIG_DFL if handler is None else handler)
        self._before = {}

    @contextmanager
    def sheltered(self) -> Iterator[None]:
        """Delay signals within the block, until it calls ``check`` at a safe moment."""
        self._sheltered += 1
        try:
            yield
        finally:
            self._sheltered -= 1

    def check(self) -> None:
        """Raise the exception of a signal that has arrived.

        Raises:
            KeyboardInterrupt: Ctrl-C or Ctrl-Z. SystemExit: SIGTERM or SIGHUP, with 143 or 129.
        """
        if self._came is not None:
            number, self._came = self._came, None
            if number in _KEYS:
                raise KeyboardInterrupt
            raise SystemExit(_ENDED + number)

    def _hear(self, number: int, _: FrameType | None) -> None:
        self.count += 1
        self._came = number
        if not self._sheltered:
            self.check()
