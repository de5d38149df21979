"""Ctrl-C and SIGTERM, for all machines of the process: every scan is asked for a stop, then an exception ends the program.

Theory of operation
-------------------
There is one owner of the signals (``EXIT``), however many machines are open and in whatever order they are closed. The handlers are
installed with the first machine, and restored when the last is closed (only the main thread can do either). A signal stops every
machine.

The scans do the stopping in their own threads, whatever the main thread does meanwhile. A listening thread (``signal_thread``)
requests the stop as soon as the signal arrives. Python runs the handler only in the main thread. If the handler runs before the
listening thread, the handler requests the stop. In both cases the handler raises ``KeyboardInterrupt`` (``SystemExit`` 143 for
SIGTERM) in the main thread, so that ``time.sleep``, ``handle.wait`` or an event loop ends and the ``with`` block is left. While the
main thread is closing a machine, the exception is held back until all axes are at standstill. A second signal makes the stop a
quick stop.

Closing begins with the *call* of the closing function. If two signals come together, the second may be handled on the first
instruction of ``__exit__``, before any of its lines could set a flag, or on the first instruction of the first signal's handler,
which must not be interrupted. Therefore the handler examines the interrupted frames.

If the program runs in cells, as in a notebook, Ctrl-C does not close the machines: it ends a cell, and the program continues.
Ctrl-C is then a halt, and the machines stay open (``notebook_interrupts``). A second Ctrl-C while an axis still moves is a quick
stop. If Ctrl-C comes while a machine is being closed, it has the same effect as in any other program.

SIGHUP (the terminal is closed), SIGQUIT, and Ctrl-Break on Windows would end the program at once. If the core has a process of its
own, the core detects this and stops the axes. Otherwise these signals are handled here as well, unless the program handles or
ignores them (``nohup``).

A program may ignore one of these signals, or handle it itself: then the signal belongs to the program. The system discards an
ignored signal, so it cannot be noticed; the listening thread logs this once.

A forked child has its parent's handlers and, from the operating system's point of view, its ends of the sockets. The child gives up
all of them, and a signal that arrives before that is blocked until then.
"""

from __future__ import annotations

import atexit
import logging
import math
import os
import selectors
import signal
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Container
from contextlib import suppress
from dataclasses import dataclass
from types import CodeType, FrameType
from typing import Any

from axisbus.bus.link.fork_guard import disown_in_children
from axisbus.core.process.signal_forwarding import INTERRUPTED, STOPPING
from axisbus.ipc.own_socket import OwnSocket, own_pair, send_by_number
from axisbus.machine.notebook_interrupts import Cells, is_ours, shell
from axisbus.session import AxisSession
from axisbus.system.signals import present

log = logging.getLogger("axisbus")
# Signals that end a program without a handler; handled here if nothing else would stop the axes.
_ENDING = present("SIGHUP", "SIGQUIT", "SIGBREAK")
_NAMES = {**STOPPING, **_ENDING}
_MOMENT = 2.0  # seconds in which a halted axis may still move


# -- Listening for signals in a thread: Python runs handlers only in the main thread, which may be in a long call ------
#
# Theory of operation
# Python writes the number of each signal to a file descriptor as soon as it arrives (``signal.set_wakeup_fd``), whichever thread
# the operating system has chosen for it. A thread reads the number and calls ``heard`` at once. If the handler has not run a
# moment later, the main thread may be asleep while the signal went to another thread. In that case this thread sends the signal
# again, to the main thread. That second signal is an echo and is not counted again.


_HANDLER_TIME = 0.2  # seconds that the handler may take before the main thread is woken
_CHECK_INTERVAL = 0.5  # seconds
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
        periodic_check: Callable[[], None] = lambda: None,
    ) -> None:
        """``handled`` returns whether the handler has run for all signals so far; both functions are called in the thread.

        ``ends``: the sockets for reading and for writing, owned by the caller. ``periodic_check`` is called periodically.
        """
        self._periodic_check = periodic_check
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
            while not selector.select(_CHECK_INTERVAL):
                self._periodic_check()
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
        timer = threading.Timer(_HANDLER_TIME, self._wake, (number,))
        timer.daemon = True
        timer.start()

    def _pass_on(self, number: int) -> None:
        if self._before != _NOBODY:
            with suppress(OSError):
                send_by_number(self._before, bytes((number,)))

    def _wake(self, number: int) -> None:
        if self._handled() or not hasattr(signal, "pthread_kill"):
            return
        main = threading.main_thread().ident
        if main is not None and self._thread.is_alive():
            self._echoes[number] += 1
            signal.pthread_kill(main, number)


# -- signal shutdown ---------------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class ShutdownRequest:
    """The machine is being closed: every axis is stopped because of ``reason``; ``stamp`` in seconds of the monotonic clock."""

    stamp: float
    reason: str

    def __str__(self) -> str:
        return f"every axis is being stopped, and further commands are rejected: {self.reason}"


class ExitSignals:
    """Holds the sessions to be stopped, the numbers of signals, and the handlers that were installed before.

    ``pending`` is the exception to be raised when all axes are at standstill, for a signal that came while a machine was being
    closed.
    """

    def __init__(self) -> None:
        self._closing_code: frozenset[CodeType] = frozenset({ExitSignals._handle.__code__})
        self._lock = threading.Lock()  # never acquired by a handler
        self._sessions: dict[AxisSession, int] = {}  # with the number of signals that came before the session
        self._halted: dict[
            AxisSession, tuple[int, float]
        ] = {}  # the last signal that was a halt: its number and time
        self._before: dict[signal.Signals, Any] = {}
        self._cells = Cells(self._interrupted, self._cell_begins)
        self._wakeup: Wakeup | None = None
        self._listens = False  # whether the listening thread is needed
        self._alone = False  # whether a core of this program ends with this process
        self._ignored: set[int] = set()  # ignored signals that were already logged
        self._ends: tuple[OwnSocket, OwnSocket] | None = None
        self._heard = 0
        self._handled = 0
        self.pending: BaseException | None = None

    def defer_within(self, *leaving: Callable[..., object]) -> None:
        """Raise nothing while one of these functions runs in the main thread: they close a machine."""
        self._closing_code |= {function.__code__ for function in leaving}

    def join(self, session: AxisSession, *, listen: bool, alone: bool = False) -> None:
        """Let signals stop ``session``. In the main thread, also install the handlers.

        ``listen``: listen in a thread too; in virtual time nothing would continue meanwhile. ``alone``: its core ends with this
        process.
        """
        with self._lock:
            self._sessions = {**self._sessions, session: self._signal_count}
        self._cells.begin()
        self._listens = self._listens or listen
        self._alone = self._alone or alone
        if threading.current_thread() is not threading.main_thread():
            return
        self._take_over()
        self._listen()

    def part(self, session: AxisSession) -> None:
        """Let signals no longer stop ``session``; harmless when repeated. After the last session, restore the handlers."""
        with self._lock:
            self._sessions = {other: came for other, came in self._sessions.items() if other is not session}
            self._halted.pop(session, None)
        self._settle()

    def take(self) -> BaseException | None:
        """Return the exception that a signal has left to be raised, once."""
        pending, self.pending = self.pending, None
        return pending

    def disown(self) -> None:
        """Give up all signals, in a forked child."""
        self._lock = threading.Lock()
        self._sessions = {}
        self._cells.end()
        self.pending = None
        if self._wakeup is not None:
            self._wakeup.drop()
            self._wakeup = None
        self._listens = self._alone = False
        self.close_ends()
        self._give_back()

    @property
    def ends(self) -> tuple[OwnSocket, OwnSocket]:
        """The sockets from which signals are read and to which they are written; unchanged while this process has both."""
        if self._ends is None or any(end.lost for end in self._ends):
            self._ends = own_pair()
        return self._ends

    def close_ends(self) -> None:
        """Close the sockets: the process ends, or is a forked child."""
        for end in self._ends or ():
            end.close()
        self._ends = None

    @property
    def in_cells(self) -> bool:
        """Whether this program runs in cells, so that Ctrl-C ends a cell and not the program."""
        return self._cells.is_running or shell() is not None

    @property
    def listens(self) -> bool:
        """Whether a thread listens for signals."""
        return self._wakeup is not None

    @property
    def _signal_count(self) -> int:
        return max(self._heard, self._handled)

    def _take_over(self) -> None:
        for number in map(signal.Signals, STOPPING):
            if number == signal.SIGINT and self._cells.is_running:
                self._cells.take_over()
                continue
            now = signal.getsignal(number)
            if now != self._handle:
                self._before[number] = now
                signal.signal(number, self._handle)
        for number in map(signal.Signals, _ENDING if self._alone else ()):
            if signal.getsignal(number) is signal.SIG_DFL:
                self._before[number] = signal.SIG_DFL
                signal.signal(number, self._handle)

    def _periodic_check(self) -> None:
        """Log once that a signal is ignored, because a user may want to stop the axes with it; in the listening thread."""
        for number, name in STOPPING.items():
            ignored = self._sessions and signal.getsignal(number) is signal.SIG_IGN
            if ignored and number not in self._ignored:
                self._ignored.add(number)
                log.warning(
                    "this program now ignores %s: it no longer stops the axes; %s and axisbus stop do",
                    name,
                    "SIGTERM" if number == signal.SIGINT else "Ctrl-C",
                )

    def _listen(self) -> None:
        """Start or renew the listening thread; main thread only."""
        if self._wakeup is not None:
            self._wakeup.renew()
        elif self._listens:
            self._handled = self._heard = self._signal_count
            self._wakeup = Wakeup(
                _NAMES, self._hear, lambda: self._handled >= self._heard, self.ends, self._periodic_check
            )
            self._wakeup.start()

    def _settle(self) -> None:
        """Restore the handlers if no session is left; only the main thread does it."""
        if self._sessions or threading.current_thread() is not threading.main_thread():
            return
        if self._wakeup is not None:
            self._wakeup.stop()
            self._wakeup = None
        self._listens = self._alone = False
        self._give_back()

    def _cell_begins(self) -> None:
        """Install the handlers for this cell: the program that runs the cells disables them in between."""
        if threading.current_thread() is not threading.main_thread():
            return
        if self._sessions:
            self._take_over()
            self._listen()
        else:  # the last machine was closed in another thread
            self._settle()

    def _give_back(self) -> None:
        self._cells.end()
        for number, handler in self._before.items():
            if signal.getsignal(number) == self._handle:  # otherwise a newer handler stays
                signal.signal(number, handler if handler is not None else signal.SIG_DFL)

    def _handle(self, number: int, frame: FrameType | None) -> None:
        if not self._sessions:  # the last machine was closed in another thread
            self._pass_on(number, frame)
            return
        self._handled += 1
        if self._handled > self._heard:  # the listening thread is absent, or later than this handler
            self._request_stop(number, self._handled)
        error: BaseException = KeyboardInterrupt() if number == signal.SIGINT else SystemExit(128 + number)
        if self._interrupts_us(frame):
            self.pending = error
        else:
            raise error

    def _interrupted(self, frame: FrameType | None) -> bool:
        """Handle an interrupt of a cell, in the main thread; return whether it is only stored until a machine is closed.

        The halt is requested again even if the listening thread has requested it: a command may have come in between.
        """
        if not self._sessions:
            return False
        self._handled = max(self._handled + 1, self._heard)
        self._request_stop(signal.SIGINT, self._handled)
        leaving = self._interrupts_us(frame)
        if leaving:
            self.pending = KeyboardInterrupt()
        return leaving

    def _pass_on(self, number: int, frame: FrameType | None) -> None:
        """Call the previous handler of the signal: no machine is open."""
        self._settle()
        before = self._before.get(signal.Signals(number))
        if callable(before):
            before(number, frame)
        elif before is not signal.SIG_IGN:
            signal.signal(number, signal.SIG_DFL)
            signal.raise_signal(number)

    def _interrupts_us(self, frame: FrameType | None) -> bool:
        """Whether the signal came while a machine was being closed, or within the handler of another signal."""
        while frame is not None:
            if frame.f_code in self._closing_code:
                return True
            frame = frame.f_back
        return False

    def _hear(self, number: int) -> None:
        """Request the stop (called by the listening thread); a second request for the same signal is harmless."""
        handler = signal.getsignal(number)
        ours = handler == self._handle or is_ours(handler)
        if not self._sessions or not (ours or self._is_halt(number)):
            return  # no session is left, or the program handles the signal itself
        self._heard += 1
        if not ours:  # the other handler's owner need not be woken
            self._handled = self._heard
        self._request_stop(number, self._heard)

    def _is_halt(self, number: int) -> bool:
        return number == signal.SIGINT and self._cells.is_running

    def _request_stop(self, number: int, count: int) -> None:
        for session, before in self._sessions.items():
            if self._is_halt(number) and session.leaving_because is None:
                self._halted[session] = count, time.monotonic()
                session.request_halt(INTERRUPTED, count)
            else:
                since = max(before, self._counted_from(session))
                session.request_stop(_NAMES[number], quick=count - since > 1)

    def _counted_from(self, session: AxisSession) -> int:
        """Return the number of the last signal that does not count for the shutdown: a halt, unless it was a moment ago."""
        number, stamp = self._halted.get(session, (0, -math.inf))
        return number if time.monotonic() - stamp > _MOMENT else number - 1


EXIT = ExitSignals()


atexit.register(EXIT.close_ends)  # registered before any machine, so that it is called after they are closed


disown_in_children(EXIT)


if sys.platform != "win32":

    class _BlockedSignals(threading.local):
        """The signal mask of a thread that forks."""

        mask: set[int] | None = None

    _blocked = _BlockedSignals()

    def _before_fork() -> None:
        """Block the signals: the child would otherwise handle a signal as its parent before it has given up the handlers."""
        if EXIT.listens:
            _blocked.mask = signal.pthread_sigmask(signal.SIG_BLOCK, _NAMES)

    def _after_fork() -> None:
        mask, _blocked.mask = _blocked.mask, None
        if mask is not None:
            signal.pthread_sigmask(signal.SIG_SETMASK, mask)

    os.register_at_fork(before=_before_fork, after_in_parent=_after_fork, after_in_child=_after_fork)
