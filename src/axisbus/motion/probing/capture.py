"""What a touch probe has latched, as a frozen value in increments."""

from __future__ import annotations

from typing import NamedTuple

from axisbus.cia402.touch_probe import Edge


class ProbeCapture(NamedTuple):
    """One edge: ``position`` (unwrapped increments) where the drive was at it, and ``origin`` of the axis when that was seen.

    ``stamp``: seconds (monotonic) of the cycle in which it was seen. ``missed``: how many edges of this kind the drive has counted
    since the one before that nobody has seen; None where it does not count.
    """

    edge: Edge
    position: int
    origin: int
    stamp: float
    missed: int | None = None
