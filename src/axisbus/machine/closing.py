"""The end of a machine, done once: whoever closes it meanwhile waits for that, and is told the same.

Theory of operation
-------------------
Closing blocks until every axis stands. It cannot be done in a thread of axisbus's own, such as the scan's, which runs the callbacks
of handles and which is what stops the axes: there only the stop is asked for, and a thread of its own closes the machine. In
virtual time, where there are no threads, that is done after the cycle (``finish``).

What closing came to is told to everybody who waited for it, else to the first who asks.
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
_SLICE = 0.1  # seconds; a wait in slices lets signal handlers run on every platform


class Closing:
    """Holds whether a machine is being closed, the threads that are at it, and what came of it."""

    def __init__(
        self,
        work: Callable[[str], list[AxisbusError]],
        ask: Callable[[str], None],
        in_cycle: Callable[[], bool] | None,
    ) -> None:
        """``work`` closes, blocks, and returns what went wrong; ``ask`` asks for the stop and returns at once.

        ``in_cycle`` tells, in virtual time, whether the caller is within a cycle.
        """
        self._work = work
        self._ask = ask
        self._in_cycle = in_cycle
        self._claim = threading.Lock()
        self._within: set[int] = set()
        self._done = threading.Event()
        self._failures: list[AxisbusError] = []
        self._told = False
        self._deferred: str | None = None

    @property
    def begun(self) -> bool:
        """Whether somebody closes, or has closed."""
        return self._claim.locked()

    @property
    def over(self) -> bool:
        """Whether it has been done."""
        return self._done.is_set()

    def run(self, reason: str) -> list[AxisbusError]:
        """Close, or wait until whoever closes has done it, and return what went wrong; in a thread of ours: begin, and return."""
        if (
            self._told or threading.get_ident() in self._within
        ):  # by a callback, or a handler of the user's, in the midst of it
            return []
        if self._may_not_wait():
            self._begin(reason)
            return []
        if not self._close(reason):
            self._wait()
        self._told = True
        return self._failures

    def finish(self) -> None:
        """Do what a callback has begun, in virtual time between two cycles."""
        if self._deferred is not None and not self._may_not_wait():
            self._close_alone()

    def _wait(self) -> None:
        with self._being_within():
            while not self._done.wait(_SLICE):
                pass

    def _close(self, reason: str) -> bool:
        """Close; return False where somebody else does, or has done it."""
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
        """A thread that closes, or waits for that, and is called back meanwhile, must not wait for itself."""
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
        """Ask for the stop, and leave the rest to a thread of its own, or to whoever closes next."""
        self._ask(reason)
        if self._deferred is not None or self.begun:
            return
        self._deferred = reason
        if self._in_cycle is None:
            try:
                threading.Thread(target=self._close_alone, name=_THREAD, daemon=True).start()
            except RuntimeError:  # the interpreter is ending and makes no more threads: atexit closes
                return

    def _close_alone(self) -> None:
        """Close where nobody waits who could be told: what went wrong is logged, and raised to whoever closes later."""
        if self._close(self._deferred or ""):
            for failure in self._failures:
                log.error("while the machine was closed, as a callback had asked: %s", failure)


def _broken_off(error: BaseException) -> ScanError:
    return ScanError(
        "closing the machine was broken off",
        observed=one_line(error),
        remedy="make sure that every axis stands, then end the program",
    )
