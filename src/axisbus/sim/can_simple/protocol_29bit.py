"""The 29-bit protocol of firmware 0.6.8 as far as a listener sees it: a beat, by which it is recognised. It hears nothing.

Known of its identifier is that of node 1, 0x19200404: 0x48 in bits 25 to 18, the node in bits 17 to 10 (node 0 is off). What its
bytes mean is not public, so that they are a counter and zeros.
"""

from __future__ import annotations

_BEAT = 0x1920_0004
_NODE_SHIFT = 10
_PERIOD = 0.1  # s


class Beacon:
    """Holds the beats to be sent, and when the next is due."""

    def __init__(self) -> None:
        self.frames: list[tuple[int, bytes]] = []
        self._due: float | None = None
        self._life = 0

    def restart(self) -> None:
        """Power-up."""
        self.frames.clear()
        self._due, self._life = None, 0

    def step(self, now: float, node_id: int) -> None:
        """Beat when that is due."""
        if node_id == 0 or (self._due is not None and now < self._due - 1e-9):
            return
        self._due = max(now, (now if self._due is None else self._due) + _PERIOD)
        self.frames.append((_BEAT | node_id << _NODE_SHIFT, bytes([self._life, *bytes(7)])))
        self._life = self._life + 1 & 0xFF
