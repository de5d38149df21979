"""One thread of a fleet in which everything that is under way is decided: what is due now, and what is due later."""

from __future__ import annotations

import heapq
import itertools
import logging
import threading
import time
from collections.abc import Callable

log = logging.getLogger("axisbus")


class EventLoopThread:
    """Calls what it is given, one after the other, in a thread of its own; any thread may give."""

    def __init__(self, name: str) -> None:
        self._due: list[tuple[float, int, Callable[[], None]]] = []
        self._numbers = itertools.count()
        self._condition = threading.Condition()
        self._ended = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)
        self._thread.start()

    @property
    def thread(self) -> int | None:
        """The identifier of its thread."""
        return self._thread.ident

    def soon(self, do: Callable[[], None]) -> None:
        """Call it as soon as what waits already has been done; after the end nothing is called any more."""
        self.later(0.0, do)

    def later(self, seconds: float, do: Callable[[], None]) -> None:
        """Call it after so many seconds."""
        with self._condition:
            if not self._ended:
                heapq.heappush(self._due, (time.monotonic() + seconds, next(self._numbers), do))
                self._condition.notify()

    def end(self) -> None:
        """End the thread after what it does just now; blocks for at most a second. What waits is dropped."""
        with self._condition:
            self._ended = True
            self._condition.notify()
        if threading.current_thread() is not self._thread:
            self._thread.join(1.0)

    def _run(self) -> None:
        while (do := self._next()) is not None:
            try:
                do()
            except Exception:
                log.exception("a step of a fleet failed")

    def _next(self) -> Callable[[], None] | None:
        with self._condition:
            while not self._ended:
                left = self._due[0][0] - time.monotonic() if self._due else None
                if left is not None and left <= 0.0:
                    return heapq.heappop(self._due)[2]
                self._condition.wait(left)
        return None
