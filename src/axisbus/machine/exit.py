"""Ctrl-C and SIGTERM: the scan is asked for a stop at once; the exception that ends the program comes right after.

Theory of operation
-------------------
The scan does the stopping, in its own thread, whatever the main thread does meanwhile. A listening thread (``wakeup``) asks for it
the moment that the signal comes; the handler, which Python runs in the main thread only, asks too where it is first, and raises
``KeyboardInterrupt`` (``SystemExit`` 143 for SIGTERM) in the main thread, so that ``time.sleep``, ``handle.wait`` or an event loop
end and the ``with`` block is left. Inside ``Machine.close`` it is kept until everything stands: leaving is what is being done
already. A second signal makes the stop a quick stop.

Leaving begins with the *call* of what leaves: of two signals that come together the second is handled on the first instruction of
``__exit__``, before any of its lines could say so, or on the first of the first one's own handler, which must not be thrown off its
way by it. The interrupted frames tell it.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import CodeType, FrameType
from typing import Any

from axisbus.machine.wakeup import Wakeup
from axisbus.motion.scan import Scan

_SIGNALS = {signal.SIGINT: "Ctrl-C", signal.SIGTERM: "SIGTERM"}


class ExitSignals:
    """Installed handlers; holds how many signals have come and the handlers that were there before.

    ``closing`` is set by whoever begins to leave; ``pending`` is then the exception to be raised when everything stands.
    """

    def __init__(self, scan: Scan, *leaving: Callable[..., object]) -> None:
        """``leaving``: the functions by which a machine is left."""
        self._scan = scan
        self._keeps: frozenset[CodeType] = frozenset(
            function.__code__ for function in (*leaving, ExitSignals._handle)
        )
        self._before: dict[signal.Signals, Any] = {}
        self._wakeup: Wakeup | None = None
        self._heard = 0
        self._handled = 0
        self.closing = False
        self.pending: BaseException | None = None

    def install(self, listen: bool) -> None:
        """Take the signals over; only possible (and only done) in the main thread.

        ``listen``: hear them in a thread too; in virtual time nothing would go on meanwhile.
        """
        if threading.current_thread() is not threading.main_thread():
            return
        for number in _SIGNALS:
            self._before[number] = signal.signal(number, self._handle)
        if listen:
            self._wakeup = Wakeup(frozenset(_SIGNALS), self._hear, lambda: self._handled >= self._heard)
            self._wakeup.start()

    def restore(self) -> None:
        """Give the signals back to whoever had them."""
        if self._wakeup is not None and threading.current_thread() is threading.main_thread():
            self._wakeup.stop()
            self._wakeup = None
        while self._before:
            number, handler = self._before.popitem()
            if threading.current_thread() is threading.main_thread():
                signal.signal(number, handler if handler is not None else signal.SIG_DFL)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        self._handled += 1
        if self._handled > self._heard:  # the listening thread is not there, or later than we are
            self._scan.request_stop(_SIGNALS[signal.Signals(number)], quick=self._handled > 1)
        error: BaseException = SystemExit(143) if number == signal.SIGTERM else KeyboardInterrupt()
        if self.closing or self._interrupts_us(frame):
            self.pending = error
        else:
            raise error

    def _interrupts_us(self, frame: FrameType | None) -> bool:
        """Whether the signal came while a machine was being left, or within the handler of another signal."""
        while frame is not None:
            if frame.f_code in self._keeps:
                return True
            frame = frame.f_back
        return False

    def _hear(self, number: int) -> None:
        """Ask for the stop (the listening thread calls this); a second request for the same signal does no harm."""
        self._heard += 1
        self._scan.request_stop(_SIGNALS[signal.Signals(number)], quick=self._heard > 1)
