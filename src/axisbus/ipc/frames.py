"""Frames of a bus for another process: packed, and left out if they are not read in time."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Collection, Iterator

from axisbus.cia301.frame import CanFrame

_FRAME = struct.Struct("<dIBB8s")  # time, identifier, flags, length, data
_EXTENDED, _REMOTE = 1, 2
_MOST = 20_000  # queued frames: some seconds of a full bus


class FrameQueue:
    """Frames queued for one reader; one thread takes them, any thread may call ``put``."""

    def __init__(self) -> None:
        self._wanted: frozenset[int] = frozenset()
        self._waiting: deque[CanFrame] = deque()
        self.lost = 0  # wanted frames that were left out
        self._reported_lost = 0

    def select(self, can_ids: Collection[int]) -> None:
        """Accept only frames with these identifiers; if empty, all frames."""
        self._wanted = frozenset(can_ids)

    def put(self, frame: CanFrame) -> None:
        """Queue a frame; does not block, and drops the frame if too many are queued."""
        if self._wanted and frame.can_id not in self._wanted:
            return
        if len(self._waiting) >= _MOST:
            self.lost += 1
            return
        self._waiting.append(frame)

    def take(self) -> tuple[bytes, int]:
        """Return the queued frames, packed, and the number of dropped ones since the last call."""
        found = [self._waiting.popleft() for _ in range(len(self._waiting))]
        lost = self.lost
        new, self._reported_lost = lost - self._reported_lost, lost
        return b"".join(map(_packed, found)), new


def _packed(frame: CanFrame) -> bytes:
    flags = (_EXTENDED if frame.extended else 0) | (_REMOTE if frame.remote else 0)
    return _FRAME.pack(frame.time, frame.can_id, flags, len(frame.data), frame.data)


def unpacked(data: bytes) -> Iterator[CanFrame]:
    """Yield the frames of these bytes."""
    for time, can_id, flags, length, content in _FRAME.iter_unpack(data):
        yield CanFrame(time, can_id, content[:length], bool(flags & _EXTENDED), bool(flags & _REMOTE))
