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


# -- Notes on the handle of a command whose transition differs from the requested one ----------------------------------


def began_from_rest(why: str) -> str:
    """Return the note of a command that waits until the previous one is at rest; ``why``: the reason."""
    return f"buffered instead of blended, so the axis stopped before it: {why}"


def needs_longer_mean() -> str:
    """Return why a command is not blended if its limit of jerk needs a longer mean than the active moves have."""
    return "its jerk limit needs a longer averaging time than the previous moves, which the master streams"


def reverses_before() -> str:
    """Return the note of a command that reverses at the end of the previous one."""
    return "the axis stopped before it: the motion reverses there, or the move has no length"


def passed_slower(speed: float, requested: float, unit: str) -> str:
    """Return the note of a command that took over at a lower velocity than its mode requests."""
    return (
        f"it began with {speed:.4g} {unit}/s instead of {requested:.4g}: it came late, or the moves are too short for their "
        "accelerations"
    )


def brakes_harder() -> str:
    """Return the note of a command that brakes with a higher deceleration than requested."""
    return "it brakes with the deceleration of the previous move: with its own, the axis would have moved beyond its end"


def narrower_corner() -> str:
    """Return the note of a group command whose corner is narrower than requested."""
    return "its corner is narrower than blend allows: it came after the corner should have begun"


def stopped_at_transition(why: str) -> str:
    """Return the note of a group command before which the axes stop; ``why``: the reason."""
    return f"the axes stop before it: {why}"
