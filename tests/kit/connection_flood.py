"""A thousand hostile connections to one of our servers, which connect again whenever they are closed."""

from __future__ import annotations

import select
import socket
import threading
import time
from contextlib import suppress
from typing import Self

import pytest

resource = pytest.importorskip("resource", reason="a crowd needs many descriptors")

SIZE = 1000
_DESCRIPTORS = 4 * SIZE  # that this process needs for both ends
_AT_ONCE = 20  # connections that are begun before the others are looked at
_PAUSE = 0.002  # seconds: the crowd shares the processor with the server that it attacks


class Crowd:
    """``address`` is a pair of TCP, or the name of a Unix socket.

    ``said`` is sent once by each connection: nothing, or a part of a message; ``flood``: it is sent repeatedly.
    """

    def __init__(
        self, address: tuple[str, int] | str | bytes, said: bytes = b"", *, flood: bool = False
    ) -> None:
        self._address, self._said, self._flood = address, said, flood
        self._lines: dict[int, socket.socket] = {}
        self._poll = select.poll()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="crowd", daemon=True)
        self.begun = 0  # connections in all

    def __enter__(self) -> Self:
        self._limits = resource.getrlimit(resource.RLIMIT_NOFILE)
        if 0 <= self._limits[1] < _DESCRIPTORS:
            pytest.skip("this user may not have so many descriptors")
        resource.setrlimit(resource.RLIMIT_NOFILE, (max(self._limits[0], _DESCRIPTORS), self._limits[1]))
        self._thread.start()
        until = time.monotonic() + 10.0
        while self.begun < SIZE:
            assert time.monotonic() < until, f"only {self.begun} connections were taken"
            time.sleep(0.01)
        return self

    def __exit__(self, *_: object) -> None:
        self._over.set()
        self._thread.join(10.0)
        for line in self._lines.values():
            line.close()
        resource.setrlimit(resource.RLIMIT_NOFILE, self._limits)

    def _run(self) -> None:
        while not self._over.is_set():
            for _ in range(min(_AT_ONCE, SIZE - len(self._lines))):
                if not self._begin():
                    break
            for number, event in self._poll.poll(0):
                self._go_on(number, event)
            time.sleep(_PAUSE)

    def _begin(self) -> bool:
        """Connect once more; return whether that was taken."""
        line = socket.socket(socket.AF_INET if isinstance(self._address, tuple) else socket.AF_UNIX)
        line.setblocking(False)
        try:
            line.connect(self._address)
        except BlockingIOError:
            if line.family == socket.AF_UNIX:  # its queue is full
                line.close()
                return False
        except OSError:
            line.close()
            return False
        self._lines[line.fileno()] = line
        self._poll.register(line, select.POLLIN | (select.POLLOUT if self._said else 0))
        self.begun += 1
        return True

    def _go_on(self, number: int, event: int) -> None:
        line = self._lines[number]
        try:
            if event & (select.POLLIN | select.POLLHUP | select.POLLERR) and not line.recv(65536):
                raise ConnectionResetError
            if event & select.POLLOUT:
                line.send(self._said)
                if not self._flood:
                    self._poll.modify(line, select.POLLIN)
        except BlockingIOError:
            pass
        except OSError:
            self._poll.unregister(line)
            del self._lines[number]
            with suppress(OSError):
                line.close()
