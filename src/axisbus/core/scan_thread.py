"""The thread that runs a machine's scan in real time, with its supervisor."""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from types import FrameType
from typing import NamedTuple

from axisbus.bus.link.channel import Channel
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
        self._stopped = False
        self._thread = threading.Thread(target=self._run, name="axisbus scan", daemon=True)
        patience = max(_HUNG, 20 * scan.period, _HUNG + (sync_timeout or 0.0))
        self._supervisor = Supervisor(scan, self._thread, patience)

    def start(self) -> None:
        """Start the scan."""
        TUNING.take()
        self._scan.waiter = self._waiter
        self._thread.start()
        self._waiter.callback_thread = self._thread
        self._supervisor.start()

    def _run(self) -> None:
        wake_in_time()
        lead()
        self._scan.run()

    def is_alive(self) -> bool:
        """Whether the scan's thread runs."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """Wait until the scan has ended, after ``Scan.quit``; harmless when repeated; blocks at most 2 s."""
        self._supervisor.stop()
        if self._thread.is_alive():
            self._thread.join(_JOIN)
        if not self._stopped:
            self._stopped = True
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


# -- The location at which a thread hangs: in the adapter's driver, in user code that it has called, or in axisbus --------------

_GIVES_TO_DRIVER = Channel._attempt.__code__
_OURS = str(Path(__file__).parents[1])
_LIBRARY = str(Path(threading.__file__).parent)


class BlockedLocation(Enum):
    """The location of a thread."""

    DRIVER = "in the adapter's driver"
    PROGRAM = "in the program's own code"
    OURS = "in axisbus"


class HangDiagnosis(NamedTuple):
    """The location of a thread; ``text`` contains function, file and line."""

    place: BlockedLocation
    text: str


def whereabouts(ident: int | None) -> HangDiagnosis | None:
    """Return the present location of the thread ``ident``; None if the thread has ended."""
    top = sys._current_frames().get(ident or 0)
    if top is None:
        return None
    frames = list(_outwards(top))
    if any(frame.f_code is _GIVES_TO_DRIVER for frame in frames):
        return HangDiagnosis(BlockedLocation.DRIVER, _text(top))
    called = [frame for frame in frames if not _in_ours(frame) and not _in_library(frame)]
    return (
        HangDiagnosis(BlockedLocation.PROGRAM, _text(called[0]))
        if called
        else HangDiagnosis(BlockedLocation.OURS, _text(top))
    )


def _outwards(frame: FrameType | None) -> Iterator[FrameType]:
    while frame is not None:
        yield frame
        frame = frame.f_back


def _in_ours(frame: FrameType) -> bool:
    return frame.f_code.co_filename.startswith(_OURS)


def _in_library(frame: FrameType) -> bool:
    """Whether the frame is in Python's standard library: the thread's start, a lock, a sleep."""
    name = frame.f_code.co_filename
    return name.startswith(_LIBRARY) and "site-packages" not in name


def _text(frame: FrameType) -> str:
    return f"{frame.f_code.co_name} ({Path(frame.f_code.co_filename).name}:{frame.f_lineno})"
