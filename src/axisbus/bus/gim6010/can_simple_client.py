"""One module that speaks CAN Simple, on a channel: its heartbeats, and one question at a time with its one answer."""

from __future__ import annotations

import threading
import time
from collections import deque
from collections.abc import Callable
from types import TracebackType
from typing import Self

from axisbus.bus.gim6010.request import send
from axisbus.bus.link.channel import Channel, Receiver, require_other_thread
from axisbus.drives.gim6010.can_simple.codec import Outgoing
from axisbus.drives.gim6010.can_simple.heartbeat import COMMAND, Heartbeats
from axisbus.drives.gim6010.can_simple.identifier import can_id
from axisbus.drives.gim6010.discovery.duplicate_node_ids import count_senders
from axisbus.errors import NodeError

LISTEN = 1.1  # s before the first request: heartbeats of 100 ms, and those of a second module of this ID
_GONE = 0.6  # s without a heartbeat, at the least, after which a module has left
_PERIODS = 5  # of its heartbeat, where that is longer
_KEPT = 32
PACE = 0.002  # s between two requests to a module that answers


class SimpleLine:
    """Follows the heartbeats of one node ID and asks it; holds state: what was heard. Used by one thread."""

    def __init__(self, channel: Channel, node: int) -> None:
        """``node`` 0 to 63.

        Raises:
            ArgumentError: it is none.
        """
        self.channel = channel
        self.node = node
        self.beats = Heartbeats()
        self._stamps: deque[tuple[float, bytes]] = deque(maxlen=_KEPT)
        self._came = threading.Condition()
        self._ears: list[tuple[int, Receiver]] = [(can_id(node, COMMAND), self._beat)]
        self._expected = Heartbeats()  # as it was when somebody looked last

    def __enter__(self) -> Self:
        for identifier, receiver in self._ears:
            self.channel.subscribe(identifier, receiver)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for identifier, receiver in self._ears:
            self.channel.unsubscribe(identifier, receiver)

    def hear(self, command: int, receiver: Receiver) -> None:
        """Have frames of a command told to ``receiver(data, stamp)`` until this is closed; for use before it is opened."""
        self._ears.append((can_id(self.node, command), receiver))

    def listen(self, seconds: float = LISTEN) -> None:
        """Listen for heartbeats; blocks.

        Raises:
            NodeError: several modules have this node ID.
            AdapterError: the channel failed. StateError: called in the receive thread.
        """
        require_other_thread(self.channel, "listening to a module")
        time.sleep(seconds)
        self.channel.check()
        if count_senders(list(self._stamps)) > 1:
            raise several(self.node)
        self._expected = self.beats

    @property
    def state(self) -> int | None:
        """The state of its axis by its last heartbeat; None where none came lately."""
        return None if self.beats.last is None or self._late() else self.beats.last.state

    @property
    def last_beat(self) -> float | None:
        """When its last heartbeat came (s, monotonic)."""
        return self._stamps[-1][0] if self._stamps else None

    def require_there(self) -> None:
        """Check that it neither restarted nor left since it was listened to; nothing can be said of one that sends no heartbeat.

        Raises:
            NodeError: it did.
        """
        if self.beats.restarts > self._expected.restarts:
            raise NodeError(
                f"module {self.node} restarted meanwhile",
                node=self.node,
                observed="its count of heartbeats began anew",
                remedy="what was written into its RAM is lost: look at its supply, then begin again",
            )
        if self._stamps and self._late():
            raise NodeError(
                f"module {self.node} no longer sends heartbeats",
                node=self.node,
                observed=f"the last one came {time.monotonic() - self._stamps[-1][0]:.1f} s ago",
                remedy="look at its supply and cable; axisbus gim6010 find tells where it is",
            )

    def send(self, frame: Outgoing) -> None:
        """Send a frame to it; raises as ``Channel.send``."""
        send(self.channel, frame)

    def wait(self, there: Callable[[], bool], seconds: float) -> bool:
        """Wait until something has come that ``there`` looks for; return whether it has."""
        require_other_thread(self.channel, "waiting for a module")
        with self._came:
            return self._came.wait_for(there, seconds)

    def notify(self) -> None:
        """Wake who waits; for receivers, which have stored what came."""
        with self._came:
            self._came.notify_all()

    def _late(self) -> bool:
        stamps = [stamp for stamp, _ in self._stamps]
        if len(stamps) < 2:
            return not stamps or time.monotonic() - stamps[-1] > 2 * LISTEN
        usual = (stamps[-1] - stamps[0]) / (len(stamps) - 1)
        return time.monotonic() - stamps[-1] > max(_GONE, _PERIODS * usual)

    def _beat(self, data: bytes, stamp: float) -> None:
        seen = self.beats.after(self.node, data)
        if isinstance(seen, Heartbeats):
            self.beats = seen
            self._stamps.append((stamp, data))
            self.notify()


def several(node: int) -> NodeError:
    """Return the error of two modules with one node ID."""
    return NodeError(
        f"several modules have the node ID {node}, or another program asks it too",
        node=node,
        observed="two heartbeats or two answers came where one was due",
        remedy="close the other program; or connect one of the modules alone and give it another node ID",
    )
