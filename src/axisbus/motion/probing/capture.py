"""A position latched by a touch probe, as a frozen value in increments."""

from __future__ import annotations

from typing import NamedTuple

from axisbus.cia402.touch_probe import Edge


class ProbeCapture(NamedTuple):
    """One edge: ``position`` (unwrapped increments) of the axis at the edge, and ``origin`` of the axis when the edge was read.

    ``stamp``: seconds (monotonic) of the cycle in which it was read. ``missed``: number of edges of this kind that the drive has
    counted since the previous one without a report; None if the drive does not count.
    """

    edge: Edge
    position: int
    origin: int
    stamp: float
    missed: int | None = None
