"""The commands of a point stream, as frozen values."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum


class OnUnderrun(Enum):
    """The reaction if the axes of a stream had to brake because the next point did not come in time."""

    HOLD = "hold"  # continue when more points come
    ERROR = "error"  # end the stream with an error


@dataclass(frozen=True, slots=True)
class StreamSegment:
    """Part of a stream between two points, ``seconds`` apart, with the polynomial coefficients of each axis (``quintic``).

    ``ramp`` (per s): permitted change of the pace within the axes' accelerations; a pace of 1 is that of the points.
    """

    seconds: float
    ramp: float
    curves: tuple[tuple[float, ...], ...]


@dataclass(frozen=True, slots=True)
class FollowPoints:
    """Let these axes follow the points of a stream, which come by ``AddPoints``; ``stream`` is its number."""

    axes: tuple[str, ...]
    stream: int
    on_underrun: OnUnderrun = OnUnderrun.HOLD


@dataclass(frozen=True, slots=True)
class AddPoints:
    """Append ``segments`` to a stream; the first one has the segment number ``first`` (counted from 0).

    Done when the axes have reached the end of these segments. ``begins``: enough points are known to begin; ``ends``: these are the
    last.
    """

    axes: tuple[str, ...]
    stream: int
    first: int
    segments: tuple[StreamSegment, ...]
    begins: bool = False
    ends: bool = False
