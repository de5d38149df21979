"""What a program asks for a stream of points, as frozen values."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class OnUnderrun(Enum):
    """What becomes of a stream whose axes had to brake because no further point was there in time."""

    HOLD = "hold"  # they go on when there are points again
    ERROR = "error"  # it ends


@dataclass(frozen=True, slots=True)
class Span:
    """A stream between two of its points, ``seconds`` apart, with the coefficients of each axis's curve (``quintic``).

    ``ramp`` (per s): by how much the pace, of which 1 is that of the points, may change there within the axes' accelerations.
    """

    seconds: float
    ramp: float
    curves: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class FollowPoints:
    """These axes are to follow the points of a stream, which come by ``AddPoints``; ``stream`` is the number of it."""

    axes: tuple[str, ...]
    stream: int
    on_underrun: OnUnderrun = OnUnderrun.HOLD


@dataclass(frozen=True, slots=True)
class AddPoints:
    """The stream goes on with ``spans``, of which the first is its span number ``first`` (from 0 on).

    Done when the axes have come to the end of these. ``begins``: enough is there for the axes to begin; ``ends``: no more comes.
    """

    axes: tuple[str, ...]
    stream: int
    first: int
    spans: tuple[Span, ...]
    begins: bool = False
    ends: bool = False
