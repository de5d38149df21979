"""The end of a program that has not closed its fleets: they are closed as its main thread ends.

Zenoh's threads would keep the interpreter alive otherwise, and this program's thread would renew its leases in it: whatever it had
set going would go on, though the program seems to be over. What is registered with ``atexit`` comes after these threads.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable

log = logging.getLogger("axisbus")


class ExitHook:
    """Holds what is to be called once, as the main thread ends."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._calls: dict[int, Callable[[], None]] = {}
        self._thread: threading.Thread | None = None

    def add(self, call: Callable[[], None]) -> Callable[[], None]:
        """Let ``call`` be called at the end, in a thread of its own; return what forgets it again, harmless when repeated."""
        with self._lock:
            self._calls[id(call)] = call
            if (
                self._thread is None or not self._thread.is_alive()
            ):  # in a forked child it is not there any more
                # no daemon: the interpreter waits for it, for a session that is closed while that ends aborts the process
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
            except Exception:  # the next one is to be closed all the same
                log.exception("a fleet could not be closed")


ENDING = ExitHook()
