"""Ctrl-C and SIGTERM while an axis is open: between our calls they end what runs, within them they wait until it is safe."""

from __future__ import annotations

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from types import FrameType
from typing import Any

_NUMBERS = (signal.SIGINT, signal.SIGTERM)
_TERMINATED = 128 + signal.SIGTERM


class Signals:
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
            KeyboardInterrupt: Ctrl-C. SystemExit: SIGTERM, with 143.
        """
        if self._came is not None:
            number, self._came = self._came, None
            if number == signal.SIGTERM:
                raise SystemExit(_TERMINATED)
            raise KeyboardInterrupt

    def _hear(self, number: int, _: FrameType | None) -> None:
        self.count += 1
        self._came = number
        if not self._sheltered:
            self.check()
