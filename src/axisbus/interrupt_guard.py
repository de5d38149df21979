"""Whose an exception or a thread is, and what an interrupt must not tear apart where the program goes on after it.

Theory of operation
-------------------
In a notebook an interrupt ends a cell, and the machine goes on (``machine.notebook_interrupts``). So it must not be raised where a
lock is held that a thread of axisbus takes as well, or in the midst of a cycle in virtual time. Such functions are ``sheltered``:
what comes within one is postponed until it has returned. They are short, or wait in slices. One that does not return, because code
of the program's own that it calls does not, is torn apart by the next interrupt nevertheless.
"""

from __future__ import annotations

import math
import signal
import sys
import threading
import time
import traceback
from collections.abc import Callable
from functools import wraps
from types import CodeType, FrameType
from typing import ParamSpec, TypeVar

Given = ParamSpec("Given")
Result = TypeVar("Result")
_LONG = 1.0  # seconds
_OURS = "axisbus "  # how the names of all threads begin that may not wait for a machine, or for a disk


def in_thread_of_ours() -> bool:
    """Whether the caller runs in a thread that drives a bus, such as the scan's."""
    return threading.current_thread().name.startswith(_OURS)


def is_own(error: BaseException) -> bool:
    """Whether a program's own code has raised it, and not Ctrl-C or SIGTERM.

    Their handlers run in the main thread alone, so in any other it is the program's own. In the main thread, where a scan in
    virtual time runs, the handler's frame tells. Python's own handler leaves none: what may be Ctrl-C then counts as that.
    """
    if isinstance(error, Exception) or threading.current_thread() is not threading.main_thread():
        return True
    handlers = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    if isinstance(error, KeyboardInterrupt) and handlers[0] is signal.default_int_handler:
        return False
    codes = {_code_of(handler) for handler in handlers}
    return not any(frame.f_code in codes for frame, _ in traceback.walk_tb(error.__traceback__))


def _code_of(handler: object) -> object:
    """Return what runs where a handler of signals is called."""
    return getattr(handler, "__code__", None) or getattr(type(handler).__call__, "__code__", None)


class _Shelters:
    """Holds the functions that are not to be interrupted, and what is to be done when the present one has returned."""

    def __init__(self) -> None:
        self.codes: set[CodeType] = set()
        self.postponed: Callable[[], object] | None = None
        self.since = math.inf  # seconds, monotonic


_shelters = _Shelters()


def sheltered(function: Callable[Given, Result]) -> Callable[Given, Result]:
    """Let a function be interrupted only after it has returned."""

    @wraps(function)
    def guarded(*args: Given.args, **kwargs: Given.kwargs) -> Result:
        try:
            return function(*args, **kwargs)
        finally:
            if _shelters.postponed is not None:
                _deliver()

    _shelters.codes.add(function.__code__)
    return guarded


def postpone(frame: FrameType | None, do: Callable[[], object]) -> bool:
    """Let ``do``, which may raise, follow the sheltered function in which ``frame`` is.

    Return False where it is in none, or in one that has not returned for long.
    """
    waits = _shelters.postponed is not None
    if not _is_sheltered(frame) or (waits and time.monotonic() - _shelters.since > _LONG):
        _shelters.postponed = None
        return False
    _shelters.since = _shelters.since if waits else time.monotonic()
    _shelters.postponed = do
    return True


def _is_sheltered(frame: FrameType | None) -> bool:
    while frame is not None:
        if frame.f_code in _shelters.codes:
            return True
        frame = frame.f_back
    return False


def _deliver() -> None:
    """Do what was postponed, unless this is another thread, or one sheltered function was called by another."""
    if threading.current_thread() is threading.main_thread() and not _is_sheltered(sys._getframe()):
        do, _shelters.postponed = _shelters.postponed, None
        if do is not None:
            do()
