"""Waiting for a scan over drives without frames: the waiting thread executes its cycles."""

from __future__ import annotations

import threading
from collections.abc import Callable

from axisbus.core.scan import Scan
from axisbus.errors import AxisbusError


class PumpWaiter:
    """As ``core.waiting.VirtualWaiter``, for a cycle that has its own time."""

    realtime = False

    def __init__(self, scan: Scan, then: Callable[[float], None] | None = None) -> None:
        """``then`` is called with the virtual time after each cycle; it may wait itself."""
        self._scan = scan
        self._then = then
        self._cycle_thread: int | None = None

    def is_in_cycle(self) -> bool:
        """Whether the caller runs within a cycle, as a handle's callback does."""
        return self._cycle_thread == threading.get_ident()

    def wait(self, done: Callable[[], bool], timeout: float | None) -> bool:
        """Execute cycles until ``done()`` or until ``timeout`` seconds of virtual time have passed; see ``Waiter``."""
        until = None if timeout is None else self._scan.cycle.now() + timeout
        while not done() and not self._scan.ended:
            if until is not None and self._scan.cycle.now() >= until:
                break
            self.run_cycle()
        return done()

    def run_cycle(self) -> None:
        """Execute one cycle; a failing scan ends every handle. An error other than an AxisbusError is also raised here."""
        scan = self._scan
        if scan.ended:
            return
        outer, self._cycle_thread = self._cycle_thread, threading.get_ident()
        try:
            scan.once()
        except BaseException as error:
            scan.fail(error)
            if not isinstance(error, AxisbusError):
                raise
            return
        finally:
            self._cycle_thread = outer
        if self._then is not None:
            self._then(scan.cycle.now())
