"""Close the fleets that a program has not closed, when its main thread ends.

Otherwise Zenoh's threads would keep the interpreter alive, and the fleet's thread would keep renewing its leases: motion that the
program has started would continue although the program seems to be over. Functions registered with ``atexit`` run only after these
threads have ended.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

log = logging.getLogger("axisbus")


class ExitHook:
    """Hold the functions to call once, when the main thread ends."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._calls: dict[int, Callable[[], None]] = {}
        self._thread: threading.Thread | None = None

    def add(self, call: Callable[[], None]) -> Callable[[], None]:
        """Register ``call``, run in its own thread at the end; return a function that unregisters it, harmless when repeated."""
        with self._lock:
            self._calls[id(call)] = call
            if (
                self._thread is None or not self._thread.is_alive()
            ):  # the thread does not exist in a forked child
                # no daemon, so that the interpreter waits for it: closing a session while the interpreter ends aborts the process
                self._thread = threading.Thread(target=self._run, name="axisbus fleet end", daemon=False)
                self._thread.start()
        return lambda: self._forget(id(call))

    def _forget(self, key: int) -> None:
        with self._lock:
            self._calls.pop(key, None)

    def _run(self) -> None:
        threading.main_thread().join()
        for call in list(self._calls.values()):
            try:
                call()
            except Exception:  # the next fleet has to be closed in any case
                log.exception("a fleet could not be closed")


ENDING = ExitHook()
