"""Frames of a bus on their way to another process: packed as they come, and left out where nobody takes them."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Collection, Iterator

from axisbus.cia301.frame import CanFrame

_FRAME = struct.Struct("<dIBB8s")  # time, identifier, flags, length, data
_EXTENDED, _REMOTE = 1, 2
_MOST = 20_000  # frames that wait: some seconds of a full bus


class FrameQueue:
    """Frames that wait to be sent to one reader; one thread takes them, any may ``hear``."""

    def __init__(self) -> None:
        self._wanted: frozenset[int] = frozenset()
        self._waiting: deque[CanFrame] = deque()
        self.lost = 0  # frames that were left out, of all that were wanted
        self._told_lost = 0

    def want(self, can_ids: Collection[int]) -> None:
        """Take frames with these identifiers only; with any, where there are none."""
        self._wanted = frozenset(can_ids)

    def hear(self, frame: CanFrame) -> None:
        """Let a frame wait; does not block, and drops it where too many do."""
        if self._wanted and frame.can_id not in self._wanted:
            return
        if len(self._waiting) >= _MOST:
            self.lost += 1
            return
        self._waiting.append(frame)

    def take(self) -> tuple[bytes, int]:
        """Return the frames that wait, packed, and how many were dropped."""
        found = [self._waiting.popleft() for _ in range(len(self._waiting))]
        lost = self.lost
        new, self._told_lost = lost - self._told_lost, lost
        return b"".join(map(_packed, found)), new


def _packed(frame: CanFrame) -> bytes:
    flags = (_EXTENDED if frame.extended else 0) | (_REMOTE if frame.remote else 0)
    return _FRAME.pack(frame.time, frame.can_id, flags, len(frame.data), frame.data)


def unpacked(data: bytes) -> Iterator[CanFrame]:
    """Yield the frames that these bytes are."""
    for time, can_id, flags, length, content in _FRAME.iter_unpack(data):
        yield CanFrame(time, can_id, content[:length], bool(flags & _EXTENDED), bool(flags & _REMOTE))
