"""The thread that runs a machine's scan in real time, with its supervisor."""

from __future__ import annotations

import threading

from axisbus.core.realtime_setup import TUNING, lead, wake_in_time
from axisbus.core.scan import Scan
from axisbus.core.supervisor import Supervisor
from axisbus.core.waiting import ThreadWaiter

_HUNG = 0.4  # seconds without a cycle, at least, after which the scan counts as hung
_JOIN = 2.0


class ScanThread:
    """Holds the thread and its supervisor, until ``stop``."""

    def __init__(self, scan: Scan, waiter: ThreadWaiter, sync_timeout: float | None) -> None:
        """``sync_timeout``: seconds that the scan may wait for another device's SYNC."""
        self._scan = scan
        self._waiter = waiter
        self._thread = threading.Thread(target=self._run, name="axisbus scan", daemon=True)
        patience = max(_HUNG, 20 * scan.period, _HUNG + (sync_timeout or 0.0))
        self._supervisor = Supervisor(scan, self._thread, patience)

    def start(self) -> None:
        """Start the scan."""
        TUNING.take()
        self._scan.waiter = self._waiter
        self._thread.start()
        self._waiter.scan_thread = self._thread.ident
        self._supervisor.start()

    def _run(self) -> None:
        wake_in_time()
        lead()
        self._scan.run()

    def is_alive(self) -> bool:
        """Whether the scan's thread runs."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """Wait until the scan has ended, after ``Scan.quit``; blocks at most 2 s."""
        self._supervisor.stop()
        if self._thread.is_alive():
            self._thread.join(_JOIN)
        TUNING.give_back()
