"""The touch probe function (60B8h) of an axis, which its two inputs share."""

from __future__ import annotations

from axisbus.cia402.touch_probe import with_byte


class ProbeFunction:
    """Holds what 60B8h was set to last, or was read as; None: it is to be read first."""

    __slots__ = ("word",)

    def __init__(self) -> None:
        self.word: int | None = None

    def set(self, number: int, bits: int) -> int:
        """Return the word in which input ``number`` has ``bits`` and all else is as it was, and keep it."""
        self.word = with_byte(self.word or 0, number, bits)
        return self.word
