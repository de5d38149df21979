"""What is read of one edge of a touch probe until a latched position is known to be of an edge that was not told yet."""

from __future__ import annotations

from typing import NamedTuple

_TRIES = 3  # edges that come faster than that are counted, and not told


class Latched(NamedTuple):
    """A position as the drive has it, and how many edges were missed before it (None: it does not count them)."""

    raw: int
    missed: int | None


class Latch:
    """Holds what was read last, and how far the present reading is."""

    __slots__ = ("_before", "_counter", "_last_count", "_last_raw", "_position", "_raw", "_tries", "over")

    def __init__(self, position: int, counter: int | None) -> None:
        """``position`` and ``counter`` are indices; a counter of None: what is read counts where it is another than the last."""
        self._position, self._counter = position, counter
        self._last_count: int | None = None
        self._last_raw: int | None = None
        self.begin()

    def begin(self) -> None:
        """Begin a reading: the edge's bit has been seen."""
        self._before: int | None = None
        self._raw: int | None = None
        self._tries = 0
        self.over = False

    @property
    def wanted(self) -> int:
        """The index of what is to be read next."""
        if self._counter is None or (self._before is not None and self._raw is None):
            return self._position
        return self._counter

    def take(self, value: int) -> Latched | None:
        """Take what was read; return a position that is new. ``over``: there is nothing more to be read."""
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
        else:  # another edge came in between: nobody knows whose position that was
            self._before, self._raw = value, None
            self._tries += 1
            self.over = self._tries >= _TRIES
        return None

    def _counted(self, count: int, raw: int) -> Latched:
        missed = 0 if self._last_count is None else (count - self._last_count - 1) & 0xFFFF
        self._last_count, self.over = count, True
        return Latched(raw, missed)
