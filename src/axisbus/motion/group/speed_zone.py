"""A part of a way with one highest speed and one acceleration."""

from __future__ import annotations

from typing import NamedTuple


class SpeedZone(NamedTuple):
    """A part of a piece, by its number, with its length, its highest speed and its acceleration."""

    piece: int
    length: float
    top: float
    ramp: float
