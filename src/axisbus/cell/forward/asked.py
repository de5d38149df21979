"""From ``[axes.NAME.feed_forward]`` to what motion computes and what the PDOs have to carry."""

from __future__ import annotations

from axisbus.bus.pdo.plan import Wanted
from axisbus.cell.model import AxisConfig
from axisbus.cia402.port import OUTPUT_OBJECTS
from axisbus.motion.forward.given import FeedForward

_POSITION_TURNED, _VELOCITY_TURNED = 0x80, 0x40  # 607Eh (CiA 402-2, polarity)


def feed_forward(axis: AxisConfig, polarity: int | None) -> FeedForward | None:
    """Return what the axis asks for, None where that is nothing; ``polarity``: the drive's 607Eh after boot (None: it has none)."""
    given = axis.feed_forward
    bits = polarity or 0
    turned = bool(bits & _POSITION_TURNED) != bool(bits & _VELOCITY_TURNED)
    asked = FeedForward(given.velocity, given.inertia, given.torque_offset, turned)
    return asked if asked.outputs else None


def wanted_of(axis: AxisConfig) -> Wanted:
    """Return the values that an axis's PDOs are to carry: offsets only where they are asked for, and then with SYNC."""
    asked = feed_forward(axis, None)
    if asked is None:
        return Wanted()
    return Wanted(outputs=(*OUTPUT_OBJECTS, *asked.outputs), synchronous_outputs=frozenset(asked.outputs))
