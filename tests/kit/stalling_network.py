"""A network between a browser and a server that delays, stalls, and cuts, as a test wants it."""

from __future__ import annotations

import queue
import socket
import threading
import time
from contextlib import suppress

_AT_A_TIME = 65_536  # bytes


class Stalling:
    """Relays connections at ``port`` to another; ``delay``: seconds in each direction, ``stalled``: nothing passes."""

    def __init__(self, to: int) -> None:
        """Listen; ``to`` is the port of the server."""
        self.delay = 0.0
        self.stalled = False
        self._to = to
        self._ends: list[socket.socket] = []
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listening.getsockname()[1])
        threading.Thread(target=self._run, daemon=True).start()

    def close(self) -> None:
        """Cut all that there is, and take no more."""
        for end in (self._listening, *self._ends):
            with suppress(OSError):
                end.shutdown(socket.SHUT_RDWR)
            end.close()

    def _run(self) -> None:
        while True:
            try:
                here = self._listening.accept()[0]
                there = socket.create_connection(("127.0.0.1", self._to))
            except OSError:
                with suppress(UnboundLocalError):
                    here.close()
                continue
            self._ends += [here, there]
            for a, b in ((here, there), (there, here)):
                waiting: queue.Queue[tuple[float, bytes]] = queue.Queue()
                for target, end in ((self._take, a), (self._give, b)):
                    threading.Thread(target=target, args=(end, waiting), daemon=True).start()

    def _take(self, end: socket.socket, waiting: queue.Queue[tuple[float, bytes]]) -> None:
        data = b"-"
        while data:
            try:
                data = end.recv(_AT_A_TIME)
            except OSError:
                data = b""
            waiting.put((time.monotonic(), data))

    def _give(self, end: socket.socket, waiting: queue.Queue[tuple[float, bytes]]) -> None:
        data = b"-"
        while data:
            came, data = waiting.get()
            while self.stalled or time.monotonic() < came + self.delay:
                time.sleep(0.005)
            with suppress(OSError):
                end.sendall(data) if data else end.shutdown(socket.SHUT_WR)
