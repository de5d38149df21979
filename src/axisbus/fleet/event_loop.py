"""The event loop of a fleet: one thread that runs all its calls, those due now and those due later."""

from __future__ import annotations

import heapq
import itertools
import logging
import threading
import time
from collections.abc import Callable

log = logging.getLogger("axisbus")


class EventLoopThread:
    """Run calls one after the other in a thread; any thread may add calls."""

    def __init__(self, name: str) -> None:
        self._due: list[tuple[float, int, Callable[[], None]]] = []
        self._numbers = itertools.count()
        self._condition = threading.Condition()
        self._ended = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def thread(self) -> threading.Thread:
        """Its thread."""
        return self._thread

    def call_soon(self, callback: Callable[[], None]) -> None:
        """Call ``callback`` after the calls that are already due; after the end nothing is called any more."""
        self.call_later(0.0, callback)

    def call_later(self, seconds: float, callback: Callable[[], None]) -> None:
        """Call ``callback`` after this number of seconds."""
        with self._condition:
            if not self._ended:
                heapq.heappush(self._due, (time.monotonic() + seconds, next(self._numbers), callback))
                self._condition.notify()

    def end(self) -> None:
        """End the thread after its present call; blocks for at most 1 s. Pending calls are dropped."""
        with self._condition:
            self._ended = True
            self._condition.notify()
        if threading.current_thread() is not self._thread:
            self._thread.join(1.0)

    def _run(self) -> None:
        while (callback := self._next()) is not None:
            try:
                callback()
            except Exception:
                log.exception("an internal step of a fleet failed")

    def _next(self) -> Callable[[], None] | None:
        with self._condition:
            while not self._ended:
                left = self._due[0][0] - time.monotonic() if self._due else None
                if left is not None and left <= 0.0:
                    return heapq.heappop(self._due)[2]
                self._condition.wait(left)
        return None
