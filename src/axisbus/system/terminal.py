"""The keys of a terminal: termios on Linux and macOS; not available on Windows."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from axisbus.errors import PlatformError, StateError

if sys.platform != "win32":
    import termios
    import tty


@contextmanager
def key_by_key() -> Iterator[int]:
    """Return the descriptor of the terminal, which passes each key on at once until the end of the block.

    Raises:
        StateError: standard input is not a terminal. PlatformError: on Windows.
    """
    if sys.platform != "win32":
        try:
            terminal = sys.stdin.fileno()
            before = termios.tcgetattr(terminal)
        except (OSError, ValueError, termios.error) as error:
            raise StateError(
                "keys are needed, and standard input is not a terminal",
                observed=str(error),
                remedy="run it in a terminal (ssh needs -t)",
            ) from error
        try:
            tty.setcbreak(terminal)
            yield terminal
        finally:
            termios.tcsetattr(terminal, termios.TCSADRAIN, before)
    else:
        raise PlatformError(
            "a Windows terminal cannot be read key by key",
            observed="axisbus cannot wait for its keys with a timeout",
            remedy="move the axis for a given time (axisbus velocity CELL AXIS=... --for 1s), or use Linux or macOS",
        )


def enter_was_pressed() -> bool:
    """Return whether Enter was pressed since the last call; not on Windows, and not if this program runs in the background."""
    if sys.platform != "win32" and sys.stdin and sys.stdin.isatty():
        terminal = sys.stdin.fileno()
        if os.tcgetpgrp(terminal) == os.getpgrp() and select.select([terminal], [], [], 0)[0]:
            return bool(os.read(terminal, 1024))
    return False
