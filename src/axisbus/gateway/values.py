"""What an axis' image says, in the axis' units; None where a value is not known."""

from __future__ import annotations

from axisbus.motion.parameters import Units
from axisbus.motion.snapshot import Snapshot


def position(snapshot: Snapshot, units: Units) -> float | None:
    """Return the actual position; of an axis that turns on, within a turn."""
    if snapshot.position is None:
        return None
    return units.turned(units.position.to_units(snapshot.position - snapshot.origin))


def velocity(snapshot: Snapshot, units: Units) -> float | None:
    """Return the actual velocity."""
    return None if snapshot.velocity is None else units.velocity.to_units(snapshot.velocity)


def torque(snapshot: Snapshot, units: Units) -> float | None:
    """Return the actual torque in N·m, or as a part of the rated one where that is not known."""
    return None if snapshot.torque is None else units.torque(snapshot.torque)


def following_error(snapshot: Snapshot, units: Units) -> float | None:
    """Return how far the axis is behind its demand."""
    if snapshot.demand is None or snapshot.position is None:
        return None
    return units.position.to_units(snapshot.demand - snapshot.position)
