"""A small process that ends a bridge which has a lease and no longer runs: suspended, or hung, it could not end what moves.

Theory of operation
-------------------
The core halts what a program with the command has set going when that program is gone. One that was suspended (SIGSTOP, Ctrl-Z) is
there still, and so is its command. So the bridge starts this process, in a session of its own so that the terminal does not suspend
it as well, and its thread that watches the lease writes a byte again and again while there is one. Where none comes for
``PATIENCE`` seconds, the bridge is killed, and the core does what it does for everybody who is gone.
"""

from __future__ import annotations

import os
import select
import signal
import subprocess
import sys
from contextlib import suppress

HELD, FREE = b"h", b"f"
PATIENCE = 1.5  # seconds


class Watchdog:
    """Holds the process and the line to it; for one thread."""

    def __init__(self) -> None:
        """Start it; returns at once."""
        command = [sys.executable, "-I", __file__, str(os.getpid())]
        self._process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, start_new_session=True
        )
        assert self._process.stdin is not None
        os.set_blocking(self._process.stdin.fileno(), False)
        self._held = False

    def beat(self, held: bool) -> None:
        """Say that the bridge runs, and whether it has a lease; does not block."""
        if (held or self._held) and self._process.stdin is not None:
            with suppress(OSError, ValueError):
                os.write(self._process.stdin.fileno(), HELD if held else FREE)
        self._held = held

    def close(self) -> None:
        """End it; blocks for a moment."""
        if self._process.stdin is not None:
            self._process.stdin.close()
        with suppress(subprocess.TimeoutExpired):
            self._process.wait(2.0)


def watch(line: int, bridge: int) -> None:
    """Watch a bridge until it closes the line, or has to be ended."""
    held = False
    while True:
        ready, _, _ = select.select([line], [], [], PATIENCE if held else None)
        if not ready:
            if os.getppid() == bridge:
                os.kill(bridge, signal.SIGKILL)
            return
        told = os.read(line, 4096)
        if not told:
            return
        held = told.endswith(HELD)


if __name__ == "__main__":
    watch(sys.stdin.fileno(), int(sys.argv[1]))
