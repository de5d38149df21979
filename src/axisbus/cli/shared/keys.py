"""Read single keys from a terminal, without echo and without waiting for a line."""

from __future__ import annotations

import os
import select
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from enum import Enum

from axisbus.errors import StateError


class TerminalKey(Enum):
    """A key with a function."""

    FORWARD = "forward"
    BACK = "back"
    HALT = "halt"
    QUIT = "quit"


_KEYS = {
    b"\x1b[C": TerminalKey.FORWARD,
    b"\x1bOC": TerminalKey.FORWARD,
    b"\x1b[A": TerminalKey.FORWARD,
    b"\x1bOA": TerminalKey.FORWARD,
    b"\x1b[D": TerminalKey.BACK,
    b"\x1bOD": TerminalKey.BACK,
    b"\x1b[B": TerminalKey.BACK,
    b"\x1bOB": TerminalKey.BACK,
    b" ": TerminalKey.HALT,
    b"q": TerminalKey.QUIT,
    b"\x04": TerminalKey.QUIT,  # Ctrl-D
}
_LEADS = (b"\x1b", b"\x1b[", b"\x1bO")  # the beginning of a key whose rest has not arrived yet


class TerminalKeyReader:
    """Decode keys from a terminal's bytes; holds the received part of an incomplete key."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> TerminalKey | None:
        """Return the last key in the bytes, except that *halt* has priority, and *quit* before *halt*.

        A delayed terminal delivers many repetitions at once: they are old, and count as one.
        """
        data, self._rest = self._rest + data, b""
        found: list[TerminalKey] = []
        while data:
            known = next((keys for keys in _KEYS if data.startswith(keys)), None)
            if known is None and data in _LEADS:
                self._rest = data
                break
            if known is not None:
                found.append(_KEYS[known])
            data = data[len(known or b"?") :]
        urgent = [key for key in (TerminalKey.QUIT, TerminalKey.HALT) if key in found]
        return (urgent or found[-1:] or [None])[0]


class Keyboard:
    """The terminal of this command, read key by key."""

    def __init__(self, terminal: int) -> None:
        self._terminal = terminal
        self._keys = TerminalKeyReader()

    def read(self, patience: float) -> TerminalKey | None:
        """Return the key pressed within ``patience`` s, None if there was none; *quit* if the terminal is gone."""
        if not select.select([self._terminal], [], [], patience)[0]:
            return None
        try:
            data = os.read(self._terminal, 4096)
        except OSError:
            return TerminalKey.QUIT
        return self._keys.feed(data) if data else TerminalKey.QUIT


@contextmanager
def keyboard() -> Iterator[Keyboard]:
    """Read the terminal key by key until the end of the block.

    Raises:
        StateError: standard input is not a terminal, or cannot be read key by key.
    """
    try:
        import termios
        import tty

        terminal = sys.stdin.fileno()
        before = termios.tcgetattr(terminal)
    except (ImportError, OSError, ValueError, termios.error) as error:
        raise StateError(
            "keys are needed, and standard input is not a terminal",
            observed=str(error),
            remedy="run it in a terminal (on Linux or macOS; ssh needs -t)",
        ) from error
    try:
        tty.setcbreak(terminal)
        yield Keyboard(terminal)
    finally:
        termios.tcsetattr(terminal, termios.TCSADRAIN, before)
