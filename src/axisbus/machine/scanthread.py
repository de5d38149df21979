"""The thread that runs a machine's scan in real time, with its supervisor, and what of Python is set for it meanwhile."""

from __future__ import annotations

import gc
import sys
import threading

from axisbus.machine.supervisor import Supervisor
from axisbus.motion.handle import ThreadWaiter
from axisbus.motion.scan import Scan

_SWITCH_INTERVAL = (
    0.0005  # seconds; Python's own 5 ms would let another thread delay the scan by a whole period
)
_HUNG = 0.4  # seconds without a cycle, at least, after which the scan counts as hung
_JOIN = 2.0


class ScanThread:
    """Holds the thread, the supervisor that watches it, and Python's own switch interval until ``stop``."""

    def __init__(self, scan: Scan, waiter: ThreadWaiter, sync_timeout: float | None) -> None:
        """``sync_timeout``: seconds that the scan may wait for another device's SYNC."""
        self._scan = scan
        self._waiter = waiter
        self._thread = threading.Thread(target=scan.run, name="axisbus scan", daemon=True)
        patience = max(_HUNG, 20 * scan.period, _HUNG + (sync_timeout or 0.0))
        self._supervisor = Supervisor(scan, self._thread, patience)
        self._switch_interval = sys.getswitchinterval()

    def start(self) -> None:
        """Let the scan run."""
        sys.setswitchinterval(_SWITCH_INTERVAL)
        gc.freeze()  # a full collection over the dictionaries takes several periods
        self._scan.waiter = self._waiter
        self._thread.start()
        self._waiter.scan_thread = self._thread.ident
        self._supervisor.start()

    def is_alive(self) -> bool:
        """Whether the scan's thread runs."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """Wait until the scan, which has been told to quit, has ended; blocks at most 2 s."""
        self._supervisor.stop()
        if self._thread.is_alive():
            self._thread.join(_JOIN)
        sys.setswitchinterval(self._switch_interval)
        gc.unfreeze()
