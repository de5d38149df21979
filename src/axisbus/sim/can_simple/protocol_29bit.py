"""The 29-bit protocol of firmware 0.6.8 as seen by a listener: a heartbeat, by which it is recognised. It receives nothing.

Only the identifier of node 1 is known, 0x19200404: 0x48 in bits 25 to 18, the node in bits 17 to 10 (node 0: off). The meaning of
its bytes is not published; here they are a counter and zeros.
"""

from __future__ import annotations

_BEAT = 0x1920_0004
_NODE_SHIFT = 10
_PERIOD = 0.1  # s


class Beacon:
    """The heartbeats to be sent, and the time of the next."""

    def __init__(self) -> None:
        self.frames: list[tuple[int, bytes]] = []
        self._due: float | None = None
        self._life = 0

    def restart(self) -> None:
        """Power up."""
        self.frames.clear()
        self._due, self._life = None, 0

    def step(self, now: float, node_id: int) -> None:
        """Send a heartbeat if it is due."""
        if node_id == 0 or (self._due is not None and now < self._due - 1e-9):
            return
        self._due = max(now, (now if self._due is None else self._due) + _PERIOD)
        self.frames.append((_BEAT | node_id << _NODE_SHIFT, bytes([self._life, *bytes(7)])))
        self._life = self._life + 1 & 0xFF
