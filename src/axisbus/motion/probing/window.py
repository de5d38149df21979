"""The position window within which an edge of a touch probe counts."""

from __future__ import annotations

Window = tuple[float, float]


def is_within(position: float, window: Window | None, modulo: float | None) -> bool:
    """Return whether a position is in ``window`` (in the axis's unit); for a modulo axis the window may cross a turn's end."""
    if window is None:
        return True
    low, high = window
    if modulo is None:
        return low <= position <= high
    return (position - low) % modulo <= (high - low) % modulo
