"""Emergency messages of one node: received in any length, stored in a bounded history, grouped, fed to each axis of the node."""

from __future__ import annotations

from collections import deque

from axisbus.bus.link.channel import Channel
from axisbus.cia301 import cob
from axisbus.cia301.dropped_frames import DropReason
from axisbus.cia301.emcy import Emcy, parse
from axisbus.cia301.incident import EmcyLog
from axisbus.cia301.nmt import is_boot_up

FEED = 64
_SHORTEST = 2  # bytes: the error code


class EmcyFeed:
    """Messages that one reader has not read yet; holds state: the newest 64 at most, ``lost`` counts older ones."""

    def __init__(self) -> None:
        self.lost = 0
        self.waiting: deque[Emcy] = deque(maxlen=FEED)

    def put(self, emcy: Emcy) -> None:
        """Add a message; called in the receive thread."""
        self.lost += len(self.waiting) == FEED
        self.waiting.append(emcy)  # removes the oldest message of a full queue

    def take(self) -> tuple[Emcy, ...]:
        """Return and remove all messages; called by the one reader."""
        count = len(self.waiting)
        return tuple(self.waiting.popleft() for _ in range(count))


class EmcyMonitor(EmcyLog):
    """Receives a node's emergency messages; holds state: the log and the feeds.

    Frames shorter than 8 bytes are filled with zeros. Frames without an error code are counted in ``malformed``.
    """

    def __init__(self, channel: Channel, node_id: int, cob_id: int | None = None) -> None:
        """``cob_id`` is that of object 1014h, None for the predefined 80h + node-ID."""
        super().__init__()
        self.malformed = 0
        self._feeds: tuple[EmcyFeed, ...] = ()
        self._channel = channel
        self._cob_id = cob.EMCY + node_id if cob_id is None else cob_id
        self._node_id = node_id
        channel.subscribe(self._cob_id, self._on_frame)
        channel.subscribe(cob.HEARTBEAT + node_id, self._on_heartbeat)

    def feed(self) -> EmcyFeed:
        """Return a new feed, which gets every message from now on."""
        feed = EmcyFeed()
        self._feeds = (*self._feeds, feed)
        return feed

    def listen_to(self, cob_id: int) -> None:
        """Change the COB-ID to that of the node's own 1014h."""
        if cob_id == self._cob_id:
            return
        self._channel.unsubscribe(self._cob_id, self._on_frame)
        self._cob_id = cob_id
        self._channel.subscribe(cob_id, self._on_frame)

    def close(self) -> None:
        """Stop listening."""
        self._channel.unsubscribe(self._cob_id, self._on_frame)
        self._channel.unsubscribe(cob.HEARTBEAT + self._node_id, self._on_heartbeat)

    def _on_heartbeat(self, data: bytes, stamp: float) -> None:
        if is_boot_up(data):
            self.incidents.booted(stamp)

    def _on_frame(self, data: bytes, stamp: float) -> None:
        if len(data) < _SHORTEST:
            self.malformed += 1
            self._channel.drops.note(DropReason.EMCY, self._node_id, stamp, self._cob_id, data)
            return
        emcy = parse(data, stamp)
        self.note(emcy)
        for feed in self._feeds:
            feed.put(emcy)
