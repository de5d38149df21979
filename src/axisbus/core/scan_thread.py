"""The thread that runs a machine's scan in real time, with its supervisor."""

from __future__ import annotations

import threading
import time

from axisbus.core.hang_diagnosis import BlockedLocation, HangDiagnosis, whereabouts
from axisbus.core.realtime_setup import TUNING, lead, wake_in_time
from axisbus.core.scan import Scan
from axisbus.core.waiting import ThreadWaiter
from axisbus.cpu_starvation import REMEDY
from axisbus.errors import ScanError

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


# -- Monitoring of the scan's thread: if it ends or hangs, the drives are stopped without it ---------------------------


_ROUND = 0.02
_ON_TIME = 0.04  # seconds; a longer round shows that this program did not run
_STARVED = 10  # multiple of the patience after which a scan without processor time counts as hung
_BUSY = "check which other programs keep this computer busy"
_CALLBACK = (
    "a callback or an observer should only store its data (a queue, an event); do the work in another thread of the "
    "program; then open the machine again"
)
_REMEDY = "check the adapter and its driver (a send that blocks), then open the machine again"


class Supervisor:
    """A daemon thread that checks whether the scan advances.

    The scan's own ``finally`` handles an exception. The supervisor is for a thread that is stuck (a send that blocks) or was
    killed.
    """

    def __init__(self, scan: Scan, thread: threading.Thread, patience: float) -> None:
        """``patience``: seconds without a new cycle after which the scan counts as hung."""
        self._scan = scan
        self._watched = thread
        self._patience = patience
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._run, name="axisbus supervisor", daemon=True)

    def start(self) -> None:
        """Begin monitoring."""
        self._thread.start()

    def stop(self) -> None:
        """End monitoring; blocks for at most one round."""
        self._done.set()
        if self._thread.is_alive() and self._thread is not threading.current_thread():
            self._thread.join(1.0)

    def _run(self) -> None:
        cycles, last = self._scan.lateness.cycles, time.monotonic()
        ran = 0.0  # seconds since the last cycle in which this thread itself ran; otherwise the scan could not run either
        before = last
        while not self._done.wait(_ROUND):
            now = time.monotonic()
            ran += now - before if now - before < _ON_TIME else _ROUND
            before = now
            if self._scan.lateness.cycles != cycles:
                cycles, last, ran = self._scan.lateness.cycles, now, 0.0
            if self._scan.ended:
                return
            silent = now - last
            if not self._watched.is_alive() or ran > self._patience or silent > _STARVED * self._patience:
                self._take_over(silent, silent - ran)
                return

    def _take_over(self, silent: float, missing: float) -> None:
        place = whereabouts(self._watched.ident) if self._watched.is_alive() else None
        self._scan.fail(_failure(place, silent, missing))


def _failure(place: HangDiagnosis | None, silent: float, missing: float) -> ScanError:
    """Return the error of a scan without a cycle for ``silent`` seconds, in ``missing`` of which the program did not run at all."""
    seen = f"no cycle for {silent:.2f} s"
    if place is None:
        return ScanError("the scan's thread ended", observed=seen, remedy=_REMEDY)
    if missing > silent / 2:
        message = f"this program did not run for {missing:.2f} s, and the scan of the bus ran no cycle"
        return ScanError(message, observed=seen, remedy=f"{REMEDY}; then open the machine again")
    if place.place is BlockedLocation.DRIVER:
        return ScanError("the scan of the bus hangs", observed=seen, remedy=_REMEDY)
    seen += f"; its thread is in {place.text}, not in the adapter's driver"
    if place.place is BlockedLocation.PROGRAM:
        message = "the scan of the bus is blocked by code of the program that it has called"
        return ScanError(message, observed=seen, remedy=_CALLBACK)
    return ScanError(
        "the scan of the bus did not run",
        observed=seen,
        remedy=f"{_BUSY}; {REMEDY}; then open the machine again",
    )
