"""The output of a core after each cycle: the image for all, command events for each client, and all images for a recording."""

from __future__ import annotations

import mmap
import threading
from collections import deque
from collections.abc import KeysView, Mapping, Sequence
from contextlib import suppress

from axisbus.errors import AxisbusError
from axisbus.ipc.frames import FrameQueue
from axisbus.ipc.image import ImageWriter
from axisbus.ipc.messages import CommandEvents, CycleImages, ErrorMessage, Frames
from axisbus.ipc.stream import MessageStream
from axisbus.motion.snapshot import Snapshot
from axisbus.session import CommandEvent

_IMAGE_PERIOD = 0.1  # seconds between two messages with images: each wakes the recording program
_MAX_WAITING = 2000  # queued messages; above this, images are left out and counted


class ClientOutbox:
    """The publisher's view of a client; holds the events that wait for the image of their cycle, and images for a recording.

    An event from the scan is sent when the image of its cycle can be read: a program that waits for a command's end then sees the
    values of its end.
    """

    def __init__(self, stream: MessageStream) -> None:
        self.observed = False  # whether images of all cycles are wanted
        self.stream = stream
        self.frames = FrameQueue()
        self._events: deque[CommandEvent] = deque()
        self._images: list[tuple[float, bytes]] = []
        self.lost = 0  # wanted images that were left out
        self._reported_lost = 0

    def add(self, event: CommandEvent) -> None:
        """Queue an event for ``flush``."""
        self._events.append(event)

    def flush(self) -> None:
        """Send the queued events."""
        events = []
        with suppress(IndexError):  # no more events; another thread may take them too
            while True:
                events.append(self._events.popleft())
        if events:
            self.stream.send(CommandEvents(tuple(events)))

    def flush_frames(self) -> None:
        """Send the queued frames, if the client reads its messages."""
        if self.stream.waiting <= _MAX_WAITING:
            packed, lost = self.frames.take()
            if packed or lost:
                self.stream.send(Frames(packed, lost))

    def after_cycle(self, now: float, publisher: Publisher) -> None:
        """Send the data that waited for the present image; does not block."""
        if self._events:
            self.flush()
        if self.observed:
            self._queue_image(now, publisher)
        elif self._images:
            self._send_images()

    def _queue_image(self, now: float, publisher: Publisher) -> None:
        if self.stream.waiting > _MAX_WAITING:
            self.lost += 1
            return
        self._images.append((now, publisher.newest))
        if now - self._images[0][0] >= _IMAGE_PERIOD:
            self._send_images()

    def _send_images(self) -> None:
        lost = self.lost
        self.stream.send(CycleImages(tuple(self._images), lost - self._reported_lost))
        self._images, self._reported_lost = [], lost


class Publisher:
    """Writes the images; holds the clients, and the errors they have got. ``after_cycle`` belongs to the scan's thread."""

    def __init__(self, memory: mmap.mmap, names: Sequence[str]) -> None:
        """``names``: all axes of the cell."""
        self._image = ImageWriter(memory, names)
        self._outboxes: tuple[ClientOutbox, ...] = ()
        self._scan: int | None = None
        self._numbers: dict[str, int] = {}
        self._reported: dict[str, tuple[AxisbusError, str]] = {}
        self._last = 0

    @property
    def newest(self) -> bytes:
        """The newest image as bytes."""
        return self._image.newest

    @property
    def faulty(self) -> KeysView[str]:
        """The axes with an error in the last cycle."""
        return self._numbers.keys()

    def admit(self, stream: MessageStream) -> ClientOutbox:
        """Add a client, and send it the errors with a number in the present image."""
        outbox = ClientOutbox(stream)
        self._outboxes = (*self._outboxes, outbox)
        for name, number in list(self._numbers.items()):
            reported = self._reported.get(name)
            if reported is not None:  # the scan continues meanwhile
                stream.send(ErrorMessage(name, number, reported[0]))
        return outbox

    def dismiss(self, outbox: ClientOutbox) -> None:
        """Send nothing more to a client."""
        self._outboxes = tuple(one for one in self._outboxes if one is not outbox)

    def send_event(self, outbox: ClientOutbox, event: CommandEvent) -> None:
        """Send a command event to this client; in the scan's thread it waits for the end of the cycle."""
        outbox.add(event)
        if threading.get_ident() != self._scan:
            outbox.flush()

    def flush(self) -> None:
        """Send all queued events: there will be no further cycle."""
        for outbox in self._outboxes:
            outbox.flush()

    def after_cycle(self, now: float, snapshots: Mapping[str, Snapshot]) -> None:
        """Publish the image of this cycle, and the events that waited for it; does not block."""
        self._scan = threading.get_ident()
        for name, snapshot in snapshots.items():
            if snapshot.error is not None:
                self._send_error(name, snapshot.error)
            elif name in self._numbers:
                del self._reported[name], self._numbers[name]
        self._image.write(now, snapshots, self._numbers)
        for outbox in self._outboxes:
            outbox.after_cycle(now, self)

    def _send_error(self, name: str, error: AxisbusError) -> None:
        """Send an error once, and again if something was added to it."""
        reported, text = self._reported.get(name, (None, ""))
        if reported is error and text == str(error):
            return
        self._last += 1
        self._numbers[name], self._reported[name] = self._last, (error, str(error))
        for outbox in self._outboxes:
            outbox.stream.send(ErrorMessage(name, self._last, error))
