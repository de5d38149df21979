"""Hearing signals in a thread of their own: Python runs handlers in the main thread only, which may be busy in a long call.

Theory of operation
-------------------
Python writes the number of each signal to a file descriptor the moment that it comes (``signal.set_wakeup_fd``), whatever thread
the operating system chose for it. A thread reads it and calls ``heard`` at once. If the handler has not run a moment later, the
main thread may be asleep while the signal went to another thread: it is sent the signal once more, by name. That one is an echo
and not counted again.
"""

from __future__ import annotations

import os
import selectors
import signal
import threading
from collections import Counter
from collections.abc import Callable, Container
from contextlib import suppress

from axisbus.ipc.own_socket import OwnSocket

_PATIENCE = 0.2  # seconds that the handler may take before the main thread is woken
_LOOK = 0.5  # seconds
_NOBODY = -1
_END = b"\0"


class Wakeup:
    """A thread that calls ``heard(number)`` for each signal of ``numbers``; holds the descriptor that was there before."""

    def __init__(
        self,
        numbers: Container[int],
        heard: Callable[[int], None],
        handled: Callable[[], bool],
        ends: tuple[OwnSocket, OwnSocket],
        look: Callable[[], None] = lambda: None,
    ) -> None:
        """``handled`` tells whether the handler has run for all that was heard; both are called in the thread.

        ``ends``: out of which it reads, and into which signals are written; the caller's. ``look`` is called now and then.
        """
        self._look = look
        self._numbers = numbers
        self._heard = heard
        self._handled = handled
        self._echoes: Counter[int] = Counter()
        self._inside, self._outside = ends
        self._before = _NOBODY
        self._thread = threading.Thread(target=self._run, name="axisbus signals", daemon=True)

    def start(self) -> None:
        """Begin to listen; main thread only."""
        self._before = signal.set_wakeup_fd(self._outside.fileno(), warn_on_full_buffer=False)
        self._thread.start()

    def renew(self) -> None:
        """Have the descriptor again where somebody has taken it, or given it back to nobody; main thread only."""
        before = signal.set_wakeup_fd(self._outside.fileno(), warn_on_full_buffer=False)
        if before != self._outside.fileno():
            self._before = before

    def stop(self) -> None:
        """Give the descriptor back and end the thread; main thread only."""
        ours = signal.set_wakeup_fd(self._before, warn_on_full_buffer=False)
        if ours not in (self._outside.fileno(), _NOBODY):
            signal.set_wakeup_fd(
                ours, warn_on_full_buffer=False
            )  # somebody, such as an event loop, has taken it since
        with suppress(OSError):
            self._outside.send(_END)
        self._thread.join(1.0)

    def drop(self) -> None:
        """Let go of what a forked child has inherited: it would hear, and answer for, its parent."""
        signal.set_wakeup_fd(_NOBODY)

    def _run(self) -> None:
        while (number := self._next()) not in (_END, b""):
            self._hear(number[0])

    def _next(self) -> bytes:
        """Wait for a signal, and take it only when this thread runs again: until then it can be seen that nobody has.

        Nothing comes any more where the program has lost a descriptor of ours; the handler is then all that there is.
        """
        with suppress(OSError), selectors.DefaultSelector() as selector:
            selector.register(self._inside, selectors.EVENT_READ)
            while not selector.select(_LOOK):
                self._look()
            return self._inside.recv(1)
        return b""

    def _hear(self, number: int) -> None:
        if self._echoes[number]:
            self._echoes[number] -= 1
            return
        self._pass_on(number)
        if number not in self._numbers:
            return
        self._heard(number)
        timer = threading.Timer(_PATIENCE, self._wake, (number,))
        timer.daemon = True
        timer.start()

    def _pass_on(self, number: int) -> None:
        if self._before != _NOBODY:
            with suppress(OSError):
                os.write(self._before, bytes((number,)))

    def _wake(self, number: int) -> None:
        if self._handled() or not hasattr(signal, "pthread_kill"):
            return
        main = threading.main_thread().ident
        if main is not None and self._thread.is_alive():
            self._echoes[number] += 1
            signal.pthread_kill(main, number)
