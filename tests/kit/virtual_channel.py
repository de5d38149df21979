"""A channel on a simulated wire, in virtual time, whose program may be killed before any frame."""

from __future__ import annotations

from axisbus.bus.link.channel import SEND_PATIENCE, Channel
from axisbus.clock import VirtualClock
from axisbus.sim.node.network import ForeignNode
from axisbus.sim.virtual_can import VirtualWire


class Killed(BaseException):
    """The end of a program without a message."""


class KilledChannel(Channel):
    """Holds its guests (simulated nodes of other protocols) and the frames that were sent.

    ``killed_at``: the frame (counted from 0) before which the program is killed. ``wire`` and its ``clock``: those of the program
    before, if there was one; without them the guests are on a new wire.
    """

    def __init__(
        self,
        *foreign_nodes: ForeignNode,
        killed_at: int | None = None,
        wire: VirtualWire | None = None,
        clock: VirtualClock | None = None,
    ) -> None:
        clock = clock or VirtualClock()
        self.foreign_nodes = foreign_nodes
        self.sent: list[tuple[int, bytes]] = []
        self.killed_at = killed_at
        super().__init__((wire or VirtualWire(clock, (), foreign_nodes)).connect(), "simulated", clock=clock)

    def send(self, can_id: int, data: bytes, patience: float = SEND_PATIENCE) -> None:
        self._count(can_id, data)
        super().send(can_id, data, patience)

    def send_remote(self, can_id: int, length: int = 0) -> None:
        self._count(can_id, b"")
        super().send_remote(can_id, length)

    def _count(self, can_id: int, data: bytes) -> None:
        if len(self.sent) == self.killed_at:
            raise Killed
        self.sent.append((can_id, bytes(data)))
