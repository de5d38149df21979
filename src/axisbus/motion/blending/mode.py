"""How a motion takes over from the previous motion (PLCopen's BufferMode), and the velocity at the transition."""

from __future__ import annotations

from enum import Enum


class BufferMode(Enum):
    """When a motion begins, and the velocity of the previous one at that time (PLCopen part 1, BufferMode, without *Aborting*)."""

    BUFFERED = "buffered"  # when the previous motion has ended, at rest
    LOW = "blending_low"  # at the lower of both velocities
    PREVIOUS = "blending_previous"
    NEXT = "blending_next"
    HIGH = "blending_high"  # at the higher of both velocities

    @property
    def blends(self) -> bool:
        """Whether there is no stop between the motions."""
        return self is not BufferMode.BUFFERED

    def velocity(self, previous: float, following: float) -> float:
        """Return the velocity at the end of the previous motion; both arguments are magnitudes in one unit."""
        return {
            BufferMode.BUFFERED: 0.0,
            BufferMode.LOW: min(previous, following),
            BufferMode.PREVIOUS: previous,
            BufferMode.NEXT: following,
            BufferMode.HIGH: max(previous, following),
        }[self]
