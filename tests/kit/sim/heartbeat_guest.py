"""A simulated node of another protocol: it sends its own heartbeat, and echoes the data of a request."""

from __future__ import annotations

PERIOD = 0.1  # s between two heartbeats
HEARTBEAT, REQUEST = 1, 0x17  # the lower five bits of an identifier; the node ID is above them


class HeartbeatGuest:
    """Holds its node ID, the time of its next heartbeat, and the frames to be sent."""

    def __init__(self, node_id: int) -> None:
        self.node_id = node_id
        self.next_answer: float | None = None
        self._frames: list[tuple[int, bytes]] = []
        self._next = PERIOD

    def on_frame(self, can_id: int, data: bytes, now: float, *, remote: bool = False) -> None:
        if can_id == self.node_id << 5 | REQUEST and not remote:
            self._frames.append((can_id, data[::-1]))

    def step(self, now: float) -> None:
        if now >= self._next:
            self._next = now + PERIOD
            self._frames.append((self.node_id << 5 | HEARTBEAT, b"\1"))

    def serve(self, now: float) -> None:
        """Do nothing: each answer is sent at once."""

    def take_frames(self) -> list[tuple[int, bytes]]:
        frames, self._frames = self._frames, []
        return frames
