"""A watch over the scan's thread: if it ends or hangs, the drives are stopped without it."""

from __future__ import annotations

import threading
import time

from axisbus.errors import ScanError
from axisbus.motion.scan import Scan

_ROUND = 0.02


class Supervisor:
    """A daemon thread that looks whether the scan advances; holds what it saw last.

    The scan's own ``finally`` handles an exception. This is for a thread that is stuck (a send that blocks) or was killed.
    """

    def __init__(self, scan: Scan, thread: threading.Thread, patience: float) -> None:
        """``patience``: seconds without a new cycle after which the scan counts as hung."""
        self._scan = scan
        self._watched = thread
        self._patience = patience
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._run, name="axisbus supervisor", daemon=True)

    def start(self) -> None:
        """Begin to watch."""
        self._thread.start()

    def stop(self) -> None:
        """End the watch; blocks for at most one round."""
        self._done.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(1.0)

    def _run(self) -> None:
        seen, since = self._scan.lateness.cycles, time.monotonic()
        before = since
        while not self._done.wait(_ROUND):
            now = time.monotonic()
            if now - before > 10 * _ROUND or self._scan.lateness.cycles != seen:
                since = now  # it advances, or we were all suspended together
                seen = self._scan.lateness.cycles
            before = now
            if self._scan.ended:
                return
            if not self._watched.is_alive() or now - since > self._patience:
                self._take_over(now - since)
                return

    def _take_over(self, silent: float) -> None:
        alive = self._watched.is_alive()
        self._scan.failure = ScanError(
            "the scan of the bus hangs" if alive else "the scan's thread ended",
            observed=f"no cycle for {silent:.2f} s",
            remedy="look at the adapter and its driver (a send that blocks), then open the machine again",
        )
        self._scan.end()
