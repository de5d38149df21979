"""A line of simulated modules on a pseudo-terminal, in real time; a program opens it like a serial port."""

from __future__ import annotations

import os
import select
import threading
import time
from collections.abc import Sequence
from contextlib import closing, suppress

from axisbus.drives.gim6010.sim.modbus.station import Station
from axisbus.errors import PlatformError

try:
    import tty
except ImportError:  # Windows
    tty = None  # type: ignore[assignment]

_STEP = 0.005  # s between two steps, while no data arrive
_PIECE = 4096  # bytes


class Terminal:
    """Serves stations on one line; holds both ends of the pseudo-terminal. ``path`` is the port for the program."""

    def __init__(self, stations: Sequence[Station]) -> None:
        """Start to serve, in a separate thread. Raises PlatformError: this system has no pseudo-terminals."""
        if tty is None:
            raise PlatformError(
                "there are no pseudo-terminals on Windows, so no simulated serial line",
                remedy="serve the simulated module on Linux or macOS",
            )
        self.stations = tuple(stations)
        self.lock = threading.Lock()  # held while a station is advanced
        # server's and program's end; the latter stays open, so that the line survives when programs close it
        self._line, self._program = os.openpty()
        tty.setraw(self._program)
        os.set_blocking(self._line, False)
        self.path = os.ttyname(self._program)
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, name="axisbus serves RS485", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop, and close the terminal. Harmless when repeated."""
        if not self._over.is_set():
            self._over.set()
            self._thread.join()
            os.close(self._line)
            os.close(self._program)

    def _run(self) -> None:
        while not self._over.is_set():
            ready, _, _ = select.select([self._line], [], [], _STEP)
            data = b""
            if ready:
                with suppress(OSError):
                    data = os.read(self._line, _PIECE)
            with self.lock:
                self._serve(data, time.monotonic())

    def _serve(self, data: bytes, now: float) -> None:
        for station in self.stations:
            station.take(data, now)
            answer = station.due(now)
            if answer:
                with suppress(OSError):  # without a reader the data are lost, as on a cable
                    os.write(self._line, answer)


def served(*stations: Station) -> closing[Terminal]:
    return closing(Terminal(stations))
