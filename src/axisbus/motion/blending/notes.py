"""What a handle says of a motion that was to pass into another one, and did so otherwise than it was asked to."""

from __future__ import annotations


def began_from_rest(why: str) -> str:
    """Return the note of a command that waits for the rest of what is before it; ``why`` it does not pass into it."""
    return f"buffered instead of blended, so the axis stopped before it: {why}"


def softer() -> str:
    """Return why a command does not pass into another one whose limit of jerk takes less time."""
    return "its limit of jerk takes longer than that of the moves before it, by which the axis is led"


def turned_back() -> str:
    """Return the note of a command that leads back from the end of the one before it."""
    return "the axis stopped before it: the way leads back there, or the move has no length"


def passed_slower(speed: float, asked: float, unit: str) -> str:
    """Return the note of a command that took over at a lower velocity than its mode asks for."""
    return (
        f"it took over with {speed:.4g} {unit}/s instead of {asked:.4g}: it came late, or the moves are too short for their "
        "accelerations"
    )


def brakes_harder() -> str:
    """Return the note of a command that is braked harder than it asked for."""
    return "it is braked with the deceleration of the one before: with its own the axis would have gone beyond its end"


def narrower_corner() -> str:
    """Return the note of a command of a group whose corner is narrower than it was asked for."""
    return "its corner is narrower than blend allows: it came when that should have begun already"


def stopped_at_joint(why: str) -> str:
    """Return the note of a command of a group before which the axes stop; ``why``."""
    return f"the axes stop before it: {why}"
