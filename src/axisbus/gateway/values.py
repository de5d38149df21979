"""Values of an axis's process image in the axis's units; None if a value is unknown."""

from __future__ import annotations

from axisbus.motion.parameters import Units
from axisbus.motion.snapshot import Snapshot


def position(snapshot: Snapshot, units: Units) -> float | None:
    """Return the actual position; of a modulo axis, within one turn."""
    if snapshot.position is None:
        return None
    return units.turned(units.position.to_units(snapshot.position - snapshot.origin))


def velocity(snapshot: Snapshot, units: Units) -> float | None:
    """Return the actual velocity."""
    return None if snapshot.velocity is None else units.velocity.to_units(snapshot.velocity)


def torque(snapshot: Snapshot, units: Units) -> float | None:
    """Return the actual torque in N·m, or as a fraction of the rated torque if that is unknown."""
    return None if snapshot.torque is None else units.torque(snapshot.torque)


def following_error(snapshot: Snapshot, units: Units) -> float | None:
    """Return the following error of the axis."""
    if snapshot.demand is None or snapshot.position is None:
        return None
    return units.position.to_units(snapshot.demand - snapshot.position)
