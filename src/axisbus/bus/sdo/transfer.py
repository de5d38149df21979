"""Run one SDO session on a channel: send and receive frames, measure time, and allow to cancel.

Theory of operation
-------------------
The pure ``SdoSession`` (``axisbus.cia301``) decides on the frames; this module sends and receives them. The segments of a block are
sent in small groups with a pause between. So they do not fill the adapter's queue (ten frames with SocketCAN), and the scan's PDOs
find room. Time counts from the moment at which the last frame was passed to the adapter. A frame in the inbox is handled before the
elapsed time, so that a delayed process takes the answer instead of giving up.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from axisbus.bus.link.channel import Channel
from axisbus.bus.link.frame_queue import UnboundedQueue
from axisbus.cia301 import cob
from axisbus.cia301.dropped_frames import DropReason
from axisbus.cia301.sdo import Frames
from axisbus.cia301.sdo_session import SdoSession

Progress = Callable[[int, int | None], None]


SEND_PATIENCE = 0.05
GROUP = 4  # frames of a burst between two pauses
PAUSE = 0.0005  # seconds; about the duration of four frames at 1 Mbit/s


# Put into the inbox to wake the waiting thread.
WAKE = b""


class Cancelled(Exception):
    """Another thread cancelled the transfer; an abort was sent."""


class SdoConnection:
    """One SDO channel of a node (by default 600h and 580h + node-ID); holds state: its inbox."""

    def __init__(
        self,
        channel: Channel,
        node_id: int,
        request_id: int | None = None,
        answer_id: int | None = None,
    ) -> None:
        self.channel = channel
        self.request_id = cob.SDO_RX + node_id if request_id is None else request_id
        self.answer_id = cob.SDO_TX + node_id if answer_id is None else answer_id
        self.inbox: UnboundedQueue[bytes] = UnboundedQueue(channel.clock)
        self.trips = RoundTrips()
        self.heard = 0.0  # time of the newest answer
        self._node_id = node_id
        self._open_count = 0  # number of sessions that accept answers
        channel.subscribe(self.answer_id, self._on_answer)
        channel.on_failure.append(self._on_failure)

    def send(self, data: bytes) -> None:
        """Send a request frame; blocks up to 50 ms while the adapter's queue is full (raises ``AdapterError`` after that)."""
        self.channel.send(self.request_id, data, SEND_PATIENCE)

    def receive(self, patience: float) -> bytes | None:
        """Return the next frame, ``WAKE``, or None after ``patience`` seconds."""
        return self.inbox.take(self.channel.clock.now() + patience)

    def open(self) -> None:
        """Accept answers from now on; frames left by the transfer before are dropped and counted."""
        self._open_count += 1
        for _ in range(len(self.inbox)):
            if frame := self.receive(0.0):
                self.drop(frame)

    def finish(self) -> None:
        """Accept no more answers."""
        self._open_count -= 1

    def drop(self, data: bytes, count: int = 1) -> None:
        """Count unexpected answers; ``data`` is that of the newest."""
        drops, now = self.channel.drops, self.channel.clock.now()
        drops.note(DropReason.SDO, self._node_id, now, self.answer_id, data, count)

    def wake(self) -> None:
        """Make a waiting transfer check whether it is cancelled."""
        self.inbox.put(WAKE)

    def close(self) -> None:
        """End the subscription."""
        self.channel.unsubscribe(self.answer_id, self._on_answer)
        if self._on_failure in self.channel.on_failure:
            self.channel.on_failure.remove(self._on_failure)

    def _on_answer(self, data: bytes, stamp: float) -> None:
        self.heard = stamp
        if data and self._open_count:
            self.inbox.put(data)
        else:
            self.drop(data)

    def _on_failure(self, _: object) -> None:
        self.wake()


class Call:
    """One caller's request over all its attempts; holds state: whether it was cancelled."""

    __slots__ = ("cancelled", "urgent")

    def __init__(self, urgent: bool = False) -> None:
        self.urgent = urgent
        self.cancelled = False


def carry_out(
    connection: SdoConnection, call: Call, session: SdoSession, progress: Progress | None = None
) -> None:
    """Run a session to its end; blocks. If it is cancelled, the server gets an abort.

    Raises:
        Cancelled, AdapterError.
    """
    connection.open()
    try:
        _converse(connection, call, session, progress)
    except Cancelled:
        for frame in session.give_up():
            connection.send(frame)
        raise
    except BaseException:
        session.give_up()  # so that ``late`` shows what may still be answered; nothing can be sent
        raise
    finally:
        connection.finish()
        if session.astray:
            connection.drop(session.strays[-1], session.astray)


def _converse(connection: SdoConnection, call: Call, session: SdoSession, progress: Progress | None) -> None:
    clock = connection.channel.clock
    _check_wanted(connection, call)
    asked = clock.now()
    _send(connection, call, session.start())
    last, reported = clock.now(), None
    clear = not session.late  # else the next answer may belong to an earlier request
    while not session.done:
        frame = connection.receive(session.remaining)
        now = clock.now()
        unfit = session.unfit
        answer = session.receive(frame, now - last) if frame else session.elapse(now - last)
        if frame and clear and session.unfit == unfit:
            connection.trips.note(asked, connection.heard)
        _check_wanted(connection, call)
        last = now
        if answer:
            asked = last
            _send(connection, call, answer)
            last = clock.now()
            clear = not session.late
        if progress is not None and reported != session.progress:
            reported = session.progress
            progress(*reported)


def _send(connection: SdoConnection, call: Call, frames: Frames) -> None:
    for number, frame in enumerate(frames):
        if number and number % GROUP == 0:
            connection.channel.clock.sleep(PAUSE)
            _check_wanted(connection, call)
        connection.send(frame)


def _check_wanted(connection: SdoConnection, call: Call) -> None:
    connection.channel.check()
    if call.cancelled:
        raise Cancelled


# -- Response times of a node: the only evidence of a link's delay that needs no clock of the node ---------------------


ALLOWED = 0.05  # seconds assumed for the node's own response time if no answer was faster


class RoundTrips:
    """The SDO answers of one node; holds state: the newest one, and the shortest response time.

    An answer received at ``heard`` to a request sent at ``asked`` (seconds) was sent after ``asked``, and so was every later frame.
    ``newest`` is that pair, replaced as a whole. May be read in any thread.
    """

    __slots__ = ("newest", "shortest")

    def __init__(self) -> None:
        self.newest = (-math.inf, -math.inf)
        self.shortest = math.inf

    def note(self, asked: float, heard: float) -> None:
        """Record an answer."""
        taken = max(0.0, heard - asked)
        if taken < self.shortest:
            self.shortest = taken
        self.newest = (asked, heard)

    @property
    def own_time(self) -> float:
        """The seconds that the node itself may need: its shortest response time, at most ``ALLOWED``."""
        return min(self.shortest, ALLOWED)

    @property
    def shortest_delay(self) -> float:
        """The delay of the link (seconds) that is compatible with every answer so far."""
        return self.shortest - self.own_time if self.shortest < math.inf else 0.0

    def delay(self) -> float:
        """Return the longest delay of the link (seconds) that is compatible with the newest answer."""
        asked, heard = self.newest
        return max(0.0, heard - asked - self.own_time) if heard > -math.inf else 0.0
