"""How a program waits for the core: with a condition in real time, by advancing the time in virtual time."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from axisbus.errors import AxisbusError, StateError
from axisbus.interrupt_guard import sheltered

if TYPE_CHECKING:
    from axisbus.core.scan import Scan


class ThreadWaiter:
    """Waiting in real time: with a condition that the scan signals after each cycle in which a command ended.

    It sleeps in slices, so that a signal handler runs in time on every platform.
    """

    realtime = True

    def __init__(self) -> None:
        self._condition = threading.Condition()
        self.scan_thread: int | None = None
        self._inherited = False

    def disown(self) -> None:
        """Make this object unusable: this is a forked child, in which no scan runs."""
        self._condition = threading.Condition()
        self._inherited = True

    def wait(self, done: Callable[[], bool], timeout: float | None) -> bool:
        """Block until ``done()``; see ``Waiter``.

        Raises:
            StateError: called in the scan's own thread, which would wait for itself, or in a forked child.
        """
        if self._inherited:
            raise inherited("waiting")
        if threading.get_ident() == self.scan_thread:
            raise StateError("the scan's own thread cannot wait for a command")
        deadline = None if timeout is None else time.monotonic() + timeout
        while self._sleep(done, deadline):
            pass
        return done()

    @sheltered  # the scan uses the condition too
    def _sleep(self, done: Callable[[], bool], deadline: float | None) -> bool:
        """Wait for a slice, and return whether to continue waiting."""
        with self._condition:
            left = 0.1 if deadline is None else min(0.1, deadline - time.monotonic())
            if done() or left <= 0:
                return False
            self._condition.wait(left)
        return True

    @sheltered
    def notify(self) -> None:
        """Wake all waiting threads."""
        with self._condition:
            self._condition.notify_all()


class PumpWaiter:
    """Waiting in virtual time: the waiting thread executes the scan's cycles."""

    realtime = False

    def __init__(self, scan: Scan, then: Callable[[float], None] | None = None) -> None:
        """``then`` is called with the virtual time after each cycle; it may wait itself."""
        self._scan = scan
        self._then = then
        self._pumping: int | None = None

    def is_pumping(self) -> bool:
        """Whether the caller runs within a cycle, as a handle's callback does."""
        return self._pumping == threading.get_ident()

    def wait(self, done: Callable[[], bool], timeout: float | None) -> bool:
        """Execute cycles until ``done()`` or until ``timeout`` seconds of virtual time have passed; see ``Waiter``."""
        until = None if timeout is None else self._scan.cycle.now() + timeout
        while not done() and not self._scan.ended:
            if until is not None and self._scan.cycle.now() >= until:
                break
            self.pump()
        return done()

    @sheltered  # an interrupt within a cycle would end the scan
    def pump(self) -> None:
        """Execute one cycle; a failing scan ends every handle. An error other than an AxisbusError is also raised here."""
        scan = self._scan
        if scan.ended:
            return
        outer, self._pumping = self._pumping, threading.get_ident()
        try:
            scan.once()
        except BaseException as error:
            scan.fail(error)
            if not isinstance(error, AxisbusError):
                raise
            return
        finally:
            self._pumping = outer
        if self._then is not None:
            self._then(scan.cycle.now())


# -- The error of a forked child that uses its parent's machine --------------------------------------------------------


def inherited(what: str) -> StateError:
    """Return the error: a forked child has a copy of the machine without a scan."""
    return StateError(
        f"{what}: the machine belongs to the process that opened it",
        observed="this process was forked from that one: it has no scan, and its copy of the adapter is not used",
        remedy="command the machine in the process that opened it, and exchange data by a queue or a pipe; start worker "
        "processes before it is opened, or with multiprocessing's start method 'spawn'",
    )
