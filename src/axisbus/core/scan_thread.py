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
from axisbus.core.realtime_setup import REALTIME_SETUP, raise_scan_priority, wake_in_time
from axisbus.core.scan import Scan
from axisbus.core.waiting import ThreadWaiter
from axisbus.cpu_starvation import REMEDY
from axisbus.errors import ScanError

_HUNG_TIME = 0.4  # seconds without a cycle, at least, after which the scan counts as hung
_JOIN_TIME = 2.0


class ScanThread:
    """Holds the thread and its supervisor, until ``stop``."""

    def __init__(self, scan: Scan, waiter: ThreadWaiter, sync_timeout: float | None) -> None:
        """``sync_timeout``: seconds that the scan may wait for another device's SYNC."""
        self._scan = scan
        self._waiter = waiter
        self._stopped = False
        self._thread = threading.Thread(target=self._run, name="axisbus scan", daemon=True)
        patience = max(_HUNG_TIME, 20 * scan.period, _HUNG_TIME + (sync_timeout or 0.0))
        self._supervisor = Supervisor(scan, self._thread, patience)

    def start(self) -> None:
        """Start the scan."""
        REALTIME_SETUP.take()
        self._scan.waiter = self._waiter
        self._thread.start()
        self._waiter.callback_thread = self._thread
        self._supervisor.start()

    def _run(self) -> None:
        wake_in_time()
        raise_scan_priority()
        self._scan.run()

    def is_alive(self) -> bool:
        """Whether the scan's thread runs."""
        return self._thread.is_alive()

    def stop(self) -> None:
        """Wait until the scan has ended, after ``Scan.quit``; harmless when repeated; blocks at most 2 s."""
        self._supervisor.stop()
        if self._thread.is_alive():
            self._thread.join(_JOIN_TIME)
        if not self._stopped:
            self._stopped = True
            REALTIME_SETUP.release()


# -- Monitoring of the scan's thread: if it ends or hangs, the drives are stopped without it ---------------------------


_ROUND = 0.02
_ON_TIME = 0.04  # seconds; a longer round shows that this program did not run
_STARVATION_RATIO = 10  # multiple of the patience after which a scan without processor time counts as hung
_CHECK_LOAD = "check which other programs keep this computer busy"
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
        self._scan_thread = thread
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
        run_time = 0.0  # seconds since the last cycle in which this thread itself ran; otherwise the scan could not run either
        before = last
        while not self._done.wait(_ROUND):
            now = time.monotonic()
            run_time += now - before if now - before < _ON_TIME else _ROUND
            before = now
            if self._scan.lateness.cycles != cycles:
                cycles, last, run_time = self._scan.lateness.cycles, now, 0.0
            if self._scan.ended:
                return
            silent = now - last
            if (
                not self._scan_thread.is_alive()
                or run_time > self._patience
                or silent > _STARVATION_RATIO * self._patience
            ):
                self._take_over(silent, silent - run_time)
                return

    def _take_over(self, silent: float, missing: float) -> None:
        location = locate_thread(self._scan_thread.ident) if self._scan_thread.is_alive() else None
        self._scan.fail(_failure(location, silent, missing))


def _failure(location: HangLocation | None, silent: float, missing: float) -> ScanError:
    """Return the error of a scan without a cycle for ``silent`` seconds, in ``missing`` of which the program did not run at all."""
    seen = f"no cycle for {silent:.2f} s"
    if location is None:
        return ScanError("the scan's thread ended", observed=seen, remedy=_REMEDY)
    if missing > silent / 2:
        message = f"this program did not run for {missing:.2f} s, and the scan of the bus ran no cycle"
        return ScanError(message, observed=seen, remedy=f"{REMEDY}; then open the machine again")
    if location.location is BlockedLocation.DRIVER:
        return ScanError("the scan of the bus hangs", observed=seen, remedy=_REMEDY)
    seen += f"; its thread is in {location.text}, not in the adapter's driver"
    if location.location is BlockedLocation.PROGRAM:
        message = "the scan of the bus is blocked by code of the program that it has called"
        return ScanError(message, observed=seen, remedy=_CALLBACK)
    return ScanError(
        "the scan of the bus did not run",
        observed=seen,
        remedy=f"{_CHECK_LOAD}; {REMEDY}; then open the machine again",
    )


# -- The location at which a thread hangs: in the adapter's driver, in user code that it has called, or in axisbus --------------

_SEND_CODE = Channel._attempt.__code__
_AXISBUS_FOLDER = str(Path(__file__).parents[1])
_LIBRARY_FOLDER = str(Path(threading.__file__).parent)


class BlockedLocation(Enum):
    """The location of a thread."""

    DRIVER = "in the adapter's driver"
    PROGRAM = "in the program's own code"
    AXISBUS = "in axisbus"


class HangLocation(NamedTuple):
    """The location of a thread; ``text`` contains function, file and line."""

    location: BlockedLocation
    text: str


def locate_thread(ident: int | None) -> HangLocation | None:
    """Return the present location of the thread ``ident``; None if the thread has ended."""
    top = sys._current_frames().get(ident or 0)
    if top is None:
        return None
    frames = list(_outer_frames(top))
    if any(frame.f_code is _SEND_CODE for frame in frames):
        return HangLocation(BlockedLocation.DRIVER, _text(top))
    called = [frame for frame in frames if not _is_axisbus(frame) and not _is_library(frame)]
    return (
        HangLocation(BlockedLocation.PROGRAM, _text(called[0]))
        if called
        else HangLocation(BlockedLocation.AXISBUS, _text(top))
    )


def _outer_frames(frame: FrameType | None) -> Iterator[FrameType]:
    while frame is not None:
        yield frame
        frame = frame.f_back


def _is_axisbus(frame: FrameType) -> bool:
    return frame.f_code.co_filename.startswith(_AXISBUS_FOLDER)


def _is_library(frame: FrameType) -> bool:
    """Whether the frame is in Python's standard library: the thread's start, a lock, a sleep."""
    name = frame.f_code.co_filename
    return name.startswith(_LIBRARY_FOLDER) and "site-packages" not in name


def _text(frame: FrameType) -> str:
    return f"{frame.f_code.co_name} ({Path(frame.f_code.co_filename).name}:{frame.f_lineno})"
