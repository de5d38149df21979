"""The window within which an edge of a touch probe counts."""

from __future__ import annotations

Window = tuple[float, float]


def is_within(position: float, window: Window | None, modulo: float | None) -> bool:
    """Whether a position lies within ``window``, all in the axis's unit; of an endless axis it may go over the end of a turn."""
    if window is None:
        return True
    low, high = window
    if modulo is None:
        return low <= position <= high
    return (position - low) % modulo <= (high - low) % modulo
