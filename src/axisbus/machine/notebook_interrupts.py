"""Interrupts in a program that runs in cells, as in a notebook: Ctrl-C ends the running cell, not the program.

Theory of operation
-------------------
IPython's kernel installs its own SIGINT handler before it runs code for the user, and ignores the signal in between, even if axes
move. Therefore the handler of axisbus is installed before each of these. It is installed again when code begins to run, and it
replaces the handler that the kernel has saved to restore afterwards. The handler of axisbus requests the halt. It then calls the
handler that it has replaced, which raises ``KeyboardInterrupt``, cancels the cell that awaits, or, between two cells, does nothing.

This module does not import IPython: if IPython is not already running, there are no cells.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from types import FrameType
from typing import Any

from axisbus.interrupt_guard import postpone

InterruptHandler = Callable[[FrameType | None], bool]
_BEFORE = "pre_execute"  # IPython's event before a cell, or before a callback of a button in its output
_STORED_HANDLER = "saved_sigint_handler"  # attribute of a kernel: the handler that it restores afterwards


def shell() -> Any | None:
    """Return the IPython shell that runs this program, None if there is none."""
    get = getattr(sys.modules.get("IPython"), "get_ipython", None)
    return None if get is None else get()


def interactive() -> bool:
    """Whether the program is typed interactively."""
    return hasattr(sys, "ps1") or bool(sys.flags.interactive) or shell() is not None


class Interrupt:
    """A handler of SIGINT; holds the handler that it has replaced."""

    def __init__(self, on_interrupt: InterruptHandler, before: Any) -> None:
        """``on_interrupt`` does the work of axisbus, and returns whether the replaced handler must not be called."""
        self._on_interrupt = on_interrupt
        self.before = before

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Handle the signal, then call the replaced handler: at once, or after the section that must not be interrupted."""
        if not self._on_interrupt(frame) and not postpone(frame, lambda: self._pass_on(number, None)):
            self._pass_on(number, frame)

    def _pass_on(self, number: int, frame: FrameType | None) -> None:
        if callable(self.before):
            self.before(number, frame)
        elif self.before is not signal.SIG_IGN:
            raise KeyboardInterrupt


class Cells:
    """The cells of this program while a machine is open; holds the IPython shell that runs them."""

    def __init__(self, on_interrupt: InterruptHandler, begins: Callable[[], None]) -> None:
        """``on_interrupt``: as in ``Interrupt``; ``begins`` is called before each cell, in the thread that runs it."""
        self._on_interrupt = on_interrupt
        self._begins = begins
        self._shell: Any | None = None

    @property
    def is_running(self) -> bool:
        """Whether this program runs in cells."""
        return self._shell is not None

    def begin(self) -> None:
        """Register for cells, because a machine is open; harmless when repeated. Any thread."""
        if self._shell is None:
            self._shell = shell()
            if self._shell is not None:
                self._shell.events.register(_BEFORE, self._begins)

    def end(self) -> None:
        """Restore the signal handlers, because no machine is open any more; main thread only."""
        if self._shell is None:
            return
        with suppress(ValueError):  # other code has removed all of them
            self._shell.events.unregister(_BEFORE, self._begins)
        kernel = self._kernel
        stored = getattr(kernel, _STORED_HANDLER, None)
        if isinstance(stored, Interrupt):
            setattr(kernel, _STORED_HANDLER, stored.before)
        now = signal.getsignal(signal.SIGINT)
        if isinstance(now, Interrupt):
            signal.signal(signal.SIGINT, now.before if now.before is not None else signal.SIG_DFL)
        self._shell = None

    def take_over(self) -> None:
        """Install the handler of axisbus, within and between the cells; main thread only."""
        now = signal.getsignal(signal.SIGINT)
        if not isinstance(now, Interrupt):
            signal.signal(signal.SIGINT, Interrupt(self._on_interrupt, now))
        kernel = self._kernel
        if hasattr(kernel, _STORED_HANDLER) and not isinstance(getattr(kernel, _STORED_HANDLER), Interrupt):
            setattr(kernel, _STORED_HANDLER, Interrupt(self._on_interrupt, getattr(kernel, _STORED_HANDLER)))

    @property
    def _kernel(self) -> Any | None:
        return getattr(self._shell, "kernel", None)


def is_ours(handler: object) -> bool:
    """Whether a signal handler is an ``Interrupt``."""
    return isinstance(handler, Interrupt)
