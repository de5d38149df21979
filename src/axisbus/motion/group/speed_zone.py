"""A part of a path with one highest speed and one acceleration."""

from __future__ import annotations

from typing import NamedTuple


class SpeedZone(NamedTuple):
    """A part of a segment: the segment's index, and the part's length, highest speed and acceleration."""

    piece: int
    length: float
    top: float
    ramp: float
