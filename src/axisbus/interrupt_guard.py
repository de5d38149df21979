"""Decide whether an exception or a thread belongs to axisbus, and protect functions from interrupts if the program continues.

Theory of operation
-------------------
In a notebook an interrupt ends a cell, and the machine keeps running (``machine.notebook_interrupts``). Therefore the interrupt
must not be raised while a lock is held that a thread of axisbus also takes, or during a cycle in virtual time. Such functions are
``sheltered``: an interrupt within one is postponed until the function has returned. These functions are short, or wait in slices.
If one does not return, because user code that it calls does not return, the next interrupt is raised within it nevertheless.
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
_OURS = "axisbus "  # start of the names of all threads that must not wait for a machine or a disk


def in_thread_of_ours() -> bool:
    """Whether the caller runs in a thread that drives a bus, such as the scan's."""
    return threading.current_thread().name.startswith(_OURS)


def is_own(error: BaseException) -> bool:
    """Whether the program's own code has raised the exception, and not Ctrl-C or SIGTERM.

    The handlers of these run only in the main thread, so in any other thread it is the program's own. In the main thread, in which
    a scan in virtual time runs, the handler's frame in the traceback decides. Python's own handler leaves no frame: an exception
    that may be Ctrl-C then counts as Ctrl-C.
    """
    if isinstance(error, Exception) or threading.current_thread() is not threading.main_thread():
        return True
    handlers = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    if isinstance(error, KeyboardInterrupt) and handlers[0] is signal.default_int_handler:
        return False
    codes = {_code_of(handler) for handler in handlers}
    return not any(frame.f_code in codes for frame, _ in traceback.walk_tb(error.__traceback__))


def _code_of(handler: object) -> object:
    """Return the code that runs when a signal handler is called."""
    return getattr(handler, "__code__", None) or getattr(type(handler).__call__, "__code__", None)


class _Shelters:
    """Holds the functions that must not be interrupted, and the action to do when the present one has returned."""

    def __init__(self) -> None:
        self.codes: set[CodeType] = set()
        self.postponed: Callable[[], object] | None = None
        self.since = math.inf  # seconds, monotonic


_shelters = _Shelters()


def sheltered(function: Callable[Given, Result]) -> Callable[Given, Result]:
    """Postpone interrupts of a function until it has returned."""

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
    """Do ``do``, which may raise, after the sheltered function that contains ``frame``.

    Return False if no sheltered function contains it, or if that function has not returned for long.
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
    """Do the postponed action, unless this is another thread, or one sheltered function was called by another."""
    if threading.current_thread() is threading.main_thread() and not _is_sheltered(sys._getframe()):
        do, _shelters.postponed = _shelters.postponed, None
        if do is not None:
            do()
