"""The touch probe function (60B8h) of an axis, which its two inputs share."""

from __future__ import annotations

from axisbus.cia402.touch_probe import with_byte


class ProbeFunction:
    """Holds the value of 60B8h that was written or read last; None: it must be read first."""

    __slots__ = ("word",)

    def __init__(self) -> None:
        self.word: int | None = None

    def set(self, number: int, bits: int) -> int:
        """Return the word with ``bits`` for input ``number`` and all other bits unchanged, and store it."""
        self.word = with_byte(self.word or 0, number, bits)
        return self.word
