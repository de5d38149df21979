"""How a program waits for the core: with a condition in real time, by advancing the time in virtual time."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable
from typing import TYPE_CHECKING

from axisbus.clock import VirtualClock
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
        # The thread and not its identifier: a later thread gets the identifier of one that has ended.
        self.callback_thread: threading.Thread | None = None
        self._inherited = False

    def disown(self) -> None:
        """Make this object unusable: this is a forked child, in which no scan runs."""
        self._condition = threading.Condition()
        self._inherited = True

    def wait(self, done: Callable[[], bool], timeout: float | None) -> bool:
        """Block until ``done()``; see ``Waiter``.

        Raises:
            StateError: called in a callback, which would wait for itself, or in a forked child.
        """
        if self._inherited:
            raise inherited("waiting")
        if threading.current_thread() is self.callback_thread and not done():
            raise _in_callback()
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


class VirtualWaiter:
    """Waiting in virtual time: the cycles of the scan are events of the clock, executed by whichever thread of the program waits.

    So the scan continues while the program waits for something else, such as an SDO transfer.
    """

    realtime = False

    def __init__(
        self, scan: Scan, clock: VirtualClock, after_cycle: Callable[[], None] | None = None
    ) -> None:
        """``clock``: of the scan's cycle. ``after_cycle`` is called between those of ``wait`` and ``run_cycle``; it may wait."""
        self._scan = scan
        self._clock = clock
        self._after_cycle = after_cycle
        self._cycle_thread: int | None = None
        self._cycles = 0
        self._error: BaseException | None = None  # of a cycle, not yet raised

    def begin(self) -> None:
        """Execute the first cycle, and further ones whenever the program waits."""
        self._clock.add(self)
        self.run_cycle()

    def is_in_cycle(self) -> bool:
        """Whether the caller runs within a cycle, as a handle's callback does."""
        return self._cycle_thread == threading.get_ident()

    def wait(self, done: Callable[[], bool], timeout: float | None) -> bool:
        """Execute cycles until ``done()`` or until ``timeout`` seconds of virtual time have passed; see ``Waiter``.

        When the scan has failed, time passes all the same: the drives are stopped without the scan.

        Raises:
            StateError: called in a callback, which runs within a cycle.
        """
        clock, scan = self._clock, self._scan
        until = None if timeout is None else clock.now() + timeout
        if self.is_in_cycle() and not done():
            raise _in_callback()
        while not done():
            if until is not None and clock.now() >= until:
                break
            if scan.ended and (until is None or clock.closed):
                break  # nothing can end this wait
            if clock.current is None and not scan.ended:
                self.run_cycle()
            else:  # without a scan, or a thread of the clock, which runs while the program waits
                clock.sleep(scan.period)
        return done()

    @sheltered  # an interrupt within a cycle would end the scan
    def run_cycle(self) -> None:
        """Let time pass until one cycle has been executed; an error of it other than an AxisbusError is raised here.

        Raises:
            StateError: called in a callback, which runs within a cycle.
        """
        if self.is_in_cycle():
            raise _in_callback()
        cycles = self._cycles
        while self._cycles == cycles and not self._scan.ended:
            self._clock.sleep(max(0.0, self._scan.due - self._clock.now()))
        error, self._error = self._error, None
        if error is not None:
            raise error
        if self._after_cycle is not None:
            self._after_cycle()

    # -- an event source of the clock --------------------------------------------------------------------------------

    @property
    def due(self) -> float:
        """Time of the next cycle."""
        return math.inf if self._scan.ended or self._cycle_thread is not None else self._scan.due

    @sheltered
    def run(self, now: float, until: float) -> None:  # noqa: ARG002  # one cycle at a time
        """Execute one cycle; a failing scan ends every handle."""
        self._clock.catch_up()
        self._cycle_thread = threading.get_ident()
        try:
            self._scan.once()
        except BaseException as error:  # noqa: BLE001  # a scan that ends must stop the drives, whatever ended it
            self._scan.fail(error)
            if not isinstance(error, AxisbusError):
                self._error = error
        finally:
            self._cycles += 1
            self._cycle_thread = None

    def catch_up(self, now: float) -> None:
        """As ``EventSource.catch_up``: it has no plant."""


# -- Errors of callbacks that wait, and of a forked child that uses its parent's machine -------------------------------


def _in_callback() -> StateError:
    return StateError(
        "a callback cannot wait for a command",
        observed="it runs in the thread that reports the ends of commands: while it waits, no command can end",
        remedy="let the callback return, and wait in another thread; or give the next command in the callback without "
        "waiting, and add a callback to its handle",
    )


def inherited(what: str) -> StateError:
    """Return the error: a forked child has a copy of the machine without a scan."""
    return StateError(
        f"{what}: the machine belongs to the process that opened it",
        observed="this process was forked from that one: it has no scan, and its copy of the adapter is not used",
        remedy="command the machine in the process that opened it, and exchange data by a queue or a pipe; start worker "
        "processes before it is opened, or with multiprocessing's start method 'spawn'",
    )
