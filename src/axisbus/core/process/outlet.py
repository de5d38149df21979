"""What a core tells its program after each cycle: the image, the ends of commands, and all images where they are recorded."""

from __future__ import annotations

import mmap
import threading
from collections import deque
from collections.abc import Mapping, Sequence

from axisbus.errors import AxisbusError
from axisbus.motion.snapshot import Snapshot
from axisbus.session import CommandEvent
from axisbus.wire.image import ImageWriter
from axisbus.wire.messages import Cycles, ErrorTold, Told
from axisbus.wire.stream import Stream

_EVERY = 0.02  # seconds between two messages with images
_MOST = 2000  # messages that wait: then images are left out, and counted


class Outlet:
    """Writes the images; holds which errors have been told, and the events that wait for the image of their cycle.

    An event that the scan tells is sent once the image of its cycle can be read: who waits for a command's end then sees what it
    has come to. ``after_cycle`` belongs to the scan's thread.
    """

    def __init__(self, stream: Stream, memory: mmap.mmap, names: Sequence[str]) -> None:
        """``names``: of all axes of the cell."""
        self.observed = False
        self._stream = stream
        self._image = ImageWriter(memory, names)
        self._events: deque[CommandEvent] = deque()
        self._scan: int | None = None
        self._numbers: dict[str, int] = {}
        self._told: dict[str, tuple[AxisbusError, str]] = {}
        self._last = 0
        self._images: list[tuple[float, bytes]] = []
        self._lost = 0

    def hear(self, event: CommandEvent) -> None:
        """Take how a command goes on; in the scan's thread it waits for the end of the cycle."""
        self._events.append(event)
        if threading.get_ident() != self._scan:
            self.flush()

    def flush(self) -> None:
        """Send the events that wait."""
        events = []
        while self._events:
            events.append(self._events.popleft())
        if events:
            self._stream.send(Told(tuple(events)))

    def after_cycle(self, now: float, snapshots: Mapping[str, Snapshot]) -> None:
        """Publish the image of this cycle, and what waited for it; does not block."""
        self._scan = threading.get_ident()
        for name, snapshot in snapshots.items():
            if snapshot.error is not None:
                self._tell(name, snapshot.error)
            elif name in self._numbers:
                del self._numbers[name], self._told[name]
        self._image.write(now, snapshots, self._numbers)
        if self._events:
            self.flush()
        if self.observed:
            self._keep(now)
        elif self._images:
            self._send_images()

    def _tell(self, name: str, error: AxisbusError) -> None:
        """Tell an error once, and again where something was added to it."""
        told, text = self._told.get(name, (None, ""))
        if told is error and text == error.observed + error.remedy:
            return
        self._last += 1
        self._numbers[name], self._told[name] = self._last, (error, error.observed + error.remedy)
        self._stream.send(ErrorTold(self._last, error))

    def _keep(self, now: float) -> None:
        if self._stream.waiting > _MOST:
            self._lost += 1
            return
        self._images.append((now, self._image.newest))
        if now - self._images[0][0] >= _EVERY:
            self._send_images()

    def _send_images(self) -> None:
        self._stream.send(Cycles(tuple(self._images), self._lost))
        self._images, self._lost = [], 0
