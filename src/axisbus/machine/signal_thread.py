"""Listening for signals in a thread: Python runs handlers only in the main thread, which may be in a long call.

Theory of operation
-------------------
Python writes the number of each signal to a file descriptor as soon as it arrives (``signal.set_wakeup_fd``), whichever thread the
operating system has chosen for it. A thread reads the number and calls ``heard`` at once. If the handler has not run a moment
later, the main thread may be asleep while the signal went to another thread. In that case this thread sends the signal again, to
the main thread. That second signal is an echo and is not counted again.
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
    """A thread that calls ``heard(number)`` for each signal of ``numbers``; holds the previous wakeup descriptor."""

    def __init__(
        self,
        numbers: Container[int],
        heard: Callable[[int], None],
        handled: Callable[[], bool],
        ends: tuple[OwnSocket, OwnSocket],
        look: Callable[[], None] = lambda: None,
    ) -> None:
        """``handled`` returns whether the handler has run for all signals so far; both functions are called in the thread.

        ``ends``: the sockets for reading and for writing, owned by the caller. ``look`` is called periodically.
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
        """Install the descriptor again if other code has replaced or removed it; main thread only."""
        before = signal.set_wakeup_fd(self._outside.fileno(), warn_on_full_buffer=False)
        if before != self._outside.fileno():
            self._before = before

    def stop(self) -> None:
        """Restore the previous descriptor and end the thread; main thread only."""
        ours = signal.set_wakeup_fd(self._before, warn_on_full_buffer=False)
        if ours not in (self._outside.fileno(), _NOBODY):
            # other code, such as an event loop, has replaced it
            signal.set_wakeup_fd(ours, warn_on_full_buffer=False)
        with suppress(OSError):
            self._outside.send(_END)
        self._thread.join(1.0)

    def drop(self) -> None:
        """Remove the inherited descriptor in a forked child, which would otherwise listen and act for its parent."""
        signal.set_wakeup_fd(_NOBODY)

    def _run(self) -> None:
        while (number := self._next()) not in (_END, b""):
            self._hear(number[0])

    def _next(self) -> bytes:
        """Wait for a signal, and read it only when this thread runs; until then others can see that it is unread.

        If the program has closed a descriptor of axisbus, nothing arrives any more; only the handler remains.
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
