"""Client of one module that uses CAN Simple: it follows the heartbeats and sends one request at a time."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from typing import Self

from axisbus.bus.link.channel import Channel, Receiver, require_other_thread
from axisbus.drives.gim6010.bus.run import send, subscribed
from axisbus.drives.gim6010.can_simple.codec import Outgoing, encode
from axisbus.drives.gim6010.can_simple.heartbeat import COMMAND, HeartbeatMonitor
from axisbus.drives.gim6010.can_simple.identifier import can_id
from axisbus.drives.gim6010.can_simple.messages import named
from axisbus.drives.gim6010.make import RESTART_BEGINS
from axisbus.errors import NodeError

LISTEN = 1.1  # s before the first request: heartbeats of 100 ms, and those of a second module of this ID
PACE = 0.002  # s between two requests to a module that answers
_LOOK = 0.05
_SAVE = named("Save_Configuration")


class SimpleLine:
    """Follows the heartbeats of one node ID and sends requests; holds state: the heartbeats in ``pulse``. Used by one thread."""

    def __init__(self, channel: Channel, node: int) -> None:
        """``node`` is 0 to 63. Raises ArgumentError: it is not."""
        self.channel = channel
        self.clock = channel.clock
        self.node = node
        self.pulse = HeartbeatMonitor(node)
        self._came = channel.clock.condition()
        self._ears: list[tuple[int, Receiver]] = [(can_id(node, COMMAND), self._beat)]
        self._listening = ExitStack()

    def __enter__(self) -> Self:
        self._listening.enter_context(subscribed(self.channel, self._ears))
        return self

    def __exit__(self, *_: object) -> None:
        self._listening.close()

    def hear(self, command: int, receiver: Receiver) -> None:
        """Call ``receiver(data, stamp)`` for each frame of ``command`` while this is open; call before opening."""
        self._ears.append((can_id(self.node, command), receiver))

    def listen(self, seconds: float = LISTEN) -> None:
        """Listen for heartbeats; blocks.

        Raises:
            NodeError: several modules have this node ID.
            AdapterError: the channel failed. StateError: called in the receive thread.
        """
        require_other_thread(self.channel, "listening to a module")
        self.clock.sleep(seconds)
        self.channel.check()
        if not self.pulse.alone:
            raise several(self.node)
        self.pulse.settle()

    @property
    def state(self) -> int | None:
        """Axis state in the last heartbeat; None if no heartbeat came recently."""
        return None if self.pulse.last is None or self._late() else self.pulse.last.state

    def require_there(self) -> None:
        """Check that the module neither restarted nor left since ``listen``; no check is possible if it sends no heartbeats.

        Raises:
            NodeError: it restarted or left.
        """
        if self.pulse.restarted:
            raise NodeError(
                f"module {self.node} restarted meanwhile",
                node=self.node,
                observed="its heartbeat counter restarted",
                remedy="the values written into its RAM are lost: check its supply, then begin again",
            )
        if self.pulse.stamps and self._late():
            raise NodeError(
                f"module {self.node} no longer sends heartbeats",
                node=self.node,
                observed=f"the last one came {self.clock.now() - self.pulse.at:.1f} s ago",
                remedy="check its supply and cable; axisbus gim6010 find searches for it",
            )

    def save(self, remedy: str, is_silent: Callable[[], bool]) -> float:
        """Send Save_Configuration and wait until the module begins to restart; return when it was sent (s of the clock). Blocks.

        ``is_silent`` returns whether the module is no longer heard.

        Raises:
            NodeError: it does not restart; ``remedy`` says what to do then.
        """
        began, restarts = self.clock.now(), self.pulse.beats.restarts
        self.send(encode(self.node, _SAVE))
        while self.clock.now() < began + RESTART_BEGINS:
            if self.pulse.beats.restarts > restarts or is_silent():
                return began
            self.clock.sleep(_LOOK)
        raise NodeError(
            f"module {self.node} got the command to save, and does not restart",
            node=self.node,
            observed=f"it has continued as before for {RESTART_BEGINS:g} s",
            remedy=remedy,
        )

    def send(self, frame: Outgoing) -> None:
        """Send a frame to the module; raises as ``Channel.send``."""
        send(self.channel, frame)

    def wait(self, there: Callable[[], bool], seconds: float) -> bool:
        """Wait up to ``seconds`` until ``there()`` is true, checked after each received frame; return whether it is."""
        require_other_thread(self.channel, "waiting for a module")
        with self._came:
            return self._came.wait_for(there, seconds)

    def notify(self) -> None:
        """Wake the waiting thread; receivers call it after they have stored a frame."""
        with self._came:
            self._came.notify_all()

    def _late(self) -> bool:
        return self.pulse.is_silent(self.clock.now(), 2 * LISTEN)

    def _beat(self, data: bytes, stamp: float) -> None:
        if self.pulse.hear(bytes(data), stamp):
            self.notify()


def several(node: int) -> NodeError:
    return NodeError(
        f"several modules have the node ID {node}, or another program also sends requests to it",
        node=node,
        observed="two heartbeats or two answers came instead of one",
        remedy="close the other program; or connect one of the modules alone and give it another node ID",
    )
