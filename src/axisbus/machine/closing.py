"""The end of a machine, which happens once. Other threads that close it meanwhile wait, and get the same result.

Theory of operation
-------------------
Closing blocks until every axis is at standstill. It cannot run in a thread of axisbus, such as the scan's thread, because that
thread stops the axes and also runs the callbacks of handles. In such a thread, only the stop is requested, and a thread of its own
closes the machine. In virtual time there are no threads, so the machine is closed after the cycle (``finish``).

Every caller that waited gets the failures of closing. If no caller waited, the first later caller gets them.
"""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from axisbus.errors import AxisbusError, ScanError, one_line
from axisbus.interrupt_guard import in_thread_of_ours

log = logging.getLogger("axisbus")

_THREAD = "closing an axisbus machine"
_SLICE = 0.1  # seconds; waiting in slices lets signal handlers run on every platform


class Closing:
    """Holds whether a machine is being closed, the threads that close it, and the result."""

    def __init__(
        self,
        work: Callable[[str], list[AxisbusError]],
        request_stop: Callable[[str], None],
        in_cycle: Callable[[], bool] | None,
    ) -> None:
        """``work`` closes, blocks, and returns the failures; ``request_stop`` requests the stop and returns at once.

        ``in_cycle`` returns, in virtual time, whether the caller is within a cycle.
        """
        self._work = work
        self._request_stop = request_stop
        self._in_cycle = in_cycle
        self._claim = threading.Lock()
        self._within: set[int] = set()
        self._done = threading.Event()
        self._failures: list[AxisbusError] = []
        self._stop_requested = False
        self._deferred: str | None = None

    @property
    def begun(self) -> bool:
        """Whether a thread closes the machine, or has closed it."""
        return self._claim.locked()

    @property
    def over(self) -> bool:
        """Whether closing is complete."""
        return self._done.is_set()

    def run(self, reason: str) -> list[AxisbusError]:
        """Close, or wait for the thread that closes, and return the failures. In a thread of axisbus, only begin closing."""
        # called by a callback or a user's handler during closing
        if self._stop_requested or threading.get_ident() in self._within:
            return []
        if self._may_not_wait():
            self._begin(reason)
            return []
        if not self._close(reason):
            self._wait()
        self._stop_requested = True
        return self._failures

    def finish(self) -> None:
        """In virtual time, between two cycles, complete the closing that a callback has begun."""
        if self._deferred is not None and not self._may_not_wait():
            self._close_alone()

    def _wait(self) -> None:
        with self._being_within():
            while not self._done.wait(_SLICE):
                pass

    def _close(self, reason: str) -> bool:
        """Close; return False if another thread closes the machine, or has closed it."""
        if not self._claim.acquire(blocking=False):
            return False
        with self._being_within():
            try:
                self._failures = self._work(reason)
            except BaseException as error:
                self._failures = [_broken_off(error)]
                raise
            finally:
                self._done.set()
        return True

    @contextmanager
    def _being_within(self) -> Iterator[None]:
        """Mark this thread as closing or waiting: if it is called back meanwhile, it must not wait for itself."""
        ident = threading.get_ident()
        self._within.add(ident)
        try:
            yield
        finally:
            self._within.discard(ident)

    def _may_not_wait(self) -> bool:
        if self._in_cycle is not None:
            return self._in_cycle()
        return in_thread_of_ours()

    def _begin(self, reason: str) -> None:
        """Request the stop, and leave the rest to a thread of its own, or to the next caller that closes."""
        self._request_stop(reason)
        if self._deferred is not None or self.begun:
            return
        self._deferred = reason
        if self._in_cycle is None:
            try:
                threading.Thread(target=self._close_alone, name=_THREAD, daemon=True).start()
            except RuntimeError:  # the interpreter is ending and starts no more threads: atexit closes
                return

    def _close_alone(self) -> None:
        """Close without a waiting caller: log the failures. A later call that closes gets them too."""
        if self._close(self._deferred or ""):
            for failure in self._failures:
                log.error("while the machine was closed at the request of a callback: %s", failure)


def _broken_off(error: BaseException) -> ScanError:
    return ScanError(
        "closing the machine was aborted",
        observed=one_line(error),
        remedy="make sure that every axis is at standstill, then end the program",
    )
