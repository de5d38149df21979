"""Where a program is given in cells, as in a notebook: an interrupt ends the cell that runs, and not the program.

Theory of operation
-------------------
IPython's kernel takes the signal for itself before whatever it does for its user, and ignores it in between, when axes may turn
all the same. So a handler of ours comes before each: it is put in force again when code begins to run, and where the kernel keeps
the handler that it gives back afterwards. Ours asks for the halt; then it lets the handler that it has replaced do its work: to
raise ``KeyboardInterrupt``, to cancel the cell that awaits something, or, between two cells, nothing.

Nothing here imports IPython: where it does not run already, there are no cells.
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable
from contextlib import suppress
from types import FrameType
from typing import Any

from axisbus.interrupt_guard import postpone

Heard = Callable[[FrameType | None], bool]
_BEFORE = "pre_execute"  # whatever is run for the user: a cell, or what a button of its output calls
_KEPT = "saved_sigint_handler"  # of a kernel: what it puts in force when that is over


def shell() -> Any | None:
    """Return the IPython that runs this program, None where none does."""
    get = getattr(sys.modules.get("IPython"), "get_ipython", None)
    return None if get is None else get()


def interactive() -> bool:
    """Whether somebody types this program as it runs."""
    return hasattr(sys, "ps1") or bool(sys.flags.interactive) or shell() is not None


class Interrupt:
    """A handler of SIGINT; holds the one that it has replaced."""

    def __init__(self, heard: Heard, before: Any) -> None:
        """``heard`` does what is ours, and returns whether that is all that is to be done."""
        self._heard = heard
        self.before = before

    def __call__(self, number: int, frame: FrameType | None) -> None:
        """Hear it, then let the handler before us have it: at once, or when what must not be torn apart is done."""
        if not self._heard(frame) and not postpone(frame, lambda: self._pass_on(number, None)):
            self._pass_on(number, frame)

    def _pass_on(self, number: int, frame: FrameType | None) -> None:
        if callable(self.before):
            self.before(number, frame)
        elif self.before is not signal.SIG_IGN:
            raise KeyboardInterrupt


class Cells:
    """The cells of this program, while a machine is open; holds the IPython that runs them."""

    def __init__(self, heard: Heard, begins: Callable[[], None]) -> None:
        """``heard``: of ``Interrupt``; ``begins`` is called before each cell, in the thread that runs it."""
        self._heard = heard
        self._begins = begins
        self._shell: Any | None = None

    @property
    def there(self) -> bool:
        """Whether there are any."""
        return self._shell is not None

    def begin(self) -> None:
        """A machine is there; harmless when repeated. Any thread."""
        if self._shell is None:
            self._shell = shell()
            if self._shell is not None:
                self._shell.events.register(_BEFORE, self._begins)

    def end(self) -> None:
        """No machine is there any more, and the signals are to be given back; main thread only."""
        if self._shell is None:
            return
        with suppress(ValueError):  # somebody has taken all of them out
            self._shell.events.unregister(_BEFORE, self._begins)
        kernel = self._kernel
        kept = getattr(kernel, _KEPT, None)
        if isinstance(kept, Interrupt):
            setattr(kernel, _KEPT, kept.before)
        now = signal.getsignal(signal.SIGINT)
        if isinstance(now, Interrupt):
            signal.signal(signal.SIGINT, now.before if now.before is not None else signal.SIG_DFL)
        self._shell = None

    def take_over(self) -> None:
        """Put ours in force, now and between the cells; main thread only."""
        now = signal.getsignal(signal.SIGINT)
        if not isinstance(now, Interrupt):
            signal.signal(signal.SIGINT, Interrupt(self._heard, now))
        kernel = self._kernel
        if hasattr(kernel, _KEPT) and not isinstance(getattr(kernel, _KEPT), Interrupt):
            setattr(kernel, _KEPT, Interrupt(self._heard, getattr(kernel, _KEPT)))

    @property
    def _kernel(self) -> Any | None:
        return getattr(self._shell, "kernel", None)


def is_ours(handler: object) -> bool:
    """Whether a handler of signals is one of these."""
    return isinstance(handler, Interrupt)
