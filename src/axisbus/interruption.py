"""Whose an exception or a thread is: of a program's own code, or Ctrl-C and SIGTERM; the program's, or axisbus's."""

from __future__ import annotations

import signal
import threading
import traceback

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
    codes = {getattr(handler, "__code__", None) for handler in handlers}
    return not any(frame.f_code in codes for frame, _ in traceback.walk_tb(error.__traceback__))
