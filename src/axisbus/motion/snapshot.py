"""The values of an axis that other threads may read: one consistent set per cycle."""

from __future__ import annotations

from typing import NamedTuple

from axisbus.cia402.state import PowerState
from axisbus.errors import AxisbusError
from axisbus.motion.states import AxisState


class Snapshot(NamedTuple):
    """An axis as of the cycle at ``now`` (seconds, monotonic); unknown values are None, positions are unwrapped increments.

    ``override`` is that of the axis itself, ``cell_override`` that of its cell, which multiplies it. ``latched``: number of edges
    that its touch probe has latched, for all requests, since the core began. ``demand`` is 6062h as the drive reports it;
    ``demand_leads``: 6062h is considered to be the value that commands the axis.
    """

    now: float
    state: AxisState
    power_state: PowerState
    statusword: int | None
    mode: int | None
    position: int | None
    position_stamp: float
    demand: int | None
    velocity: int | None
    torque: int | None
    target: int | None
    origin: int
    homed: bool
    operational: bool
    error: AxisbusError | None
    override: float = 1.0
    cell_override: float = 1.0
    latched: int = 0
    demand_leads: bool = False
