"""Read a latched position of one edge of a touch probe until it is known to belong to an edge that was not reported yet."""

from __future__ import annotations

from typing import NamedTuple

_TRIES = 3  # faster edges are counted as missed, and not reported


class Latched(NamedTuple):
    """A position as the drive reports it, and the number of edges missed before it (None: the drive does not count edges)."""

    raw: int
    missed: int | None


class Latch:
    """Holds the values that were read last, and the state of the present reading."""

    __slots__ = ("_before", "_counter", "_last_count", "_last_raw", "_position", "_raw", "_tries", "over")

    def __init__(self, position: int, counter: int | None) -> None:
        """``position`` and ``counter`` are object indices; counter None: a position is new if it differs from the last one."""
        self._position, self._counter = position, counter
        self._last_count: int | None = None
        self._last_raw: int | None = None
        self.begin()

    def begin(self) -> None:
        """Begin a reading, because the edge's bit is set."""
        self._before: int | None = None
        self._raw: int | None = None
        self._tries = 0
        self.over = False

    @property
    def wanted(self) -> int:
        """The index of the object to read next."""
        if self._counter is None or (self._before is not None and self._raw is None):
            return self._position
        return self._counter

    def take(self, value: int) -> Latched | None:
        """Process a value that was read; return a new position. ``over``: nothing more needs to be read."""
        if self._counter is None:
            self.over = True
            new = value != self._last_raw
            self._last_raw = value
            return Latched(value, None) if new else None
        if self._before is None:
            self._before, self.over = value, value == self._last_count
        elif self._raw is None:
            self._raw = value
        elif value == self._before:
            return self._counted(value, self._raw)
        else:  # another edge came in between, so the position cannot be attributed to an edge
            self._before, self._raw = value, None
            self._tries += 1
            self.over = self._tries >= _TRIES
        return None

    def _counted(self, count: int, raw: int) -> Latched:
        missed = 0 if self._last_count is None else (count - self._last_count - 1) & 0xFFFF
        self._last_count, self.over = count, True
        return Latched(raw, missed)
