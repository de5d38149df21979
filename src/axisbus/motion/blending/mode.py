"""How a motion takes over from the one before it (PLCopen's BufferMode), and how fast the joint between them is passed."""

from __future__ import annotations

from enum import Enum


class BufferMode(Enum):
    """When a motion begins, and how fast the one before it then is (PLCopen part 1, BufferMode, without *Aborting*)."""

    BUFFERED = "buffered"  # when that has ended, at rest
    LOW = "blending_low"  # at the lower velocity of both
    PREVIOUS = "blending_previous"
    NEXT = "blending_next"
    HIGH = "blending_high"  # at the higher velocity of both

    @property
    def blends(self) -> bool:
        """Whether nothing stops between both."""
        return self is not BufferMode.BUFFERED

    def velocity(self, previous: float, following: float) -> float:
        """Return with which velocity the end of the one before is passed; those of both are magnitudes in one unit."""
        return {
            BufferMode.BUFFERED: 0.0,
            BufferMode.LOW: min(previous, following),
            BufferMode.PREVIOUS: previous,
            BufferMode.NEXT: following,
            BufferMode.HIGH: max(previous, following),
        }[self]
