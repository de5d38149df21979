"""The joints of a machine by the process image of its last cycle; values that are not fresh are NaN."""

from __future__ import annotations

import math
from collections.abc import Mapping

from axisbus.gateway.ros.messages import JointState
from axisbus.gateway.ros.units import JointUnit
from axisbus.motion.parameters import Units
from axisbus.motion.snapshot import Snapshot


def states_of(
    snapshots: Mapping[str, Snapshot], units: Mapping[str, Units], joints: Mapping[str, JointUnit]
) -> list[JointState]:
    """Return the present joints; the position of a continuous joint continues beyond one turn."""
    return [_state(name, snapshots[name], units[name], joint) for name, joint in joints.items()]


def _state(name: str, seen: Snapshot, units: Units, joint: JointUnit) -> JointState:
    position = velocity = effort = math.nan
    if seen.position is not None:
        position = units.position.to_units(seen.position - seen.origin) * joint.factor
    if seen.velocity is not None and units.ratio_known:
        velocity = units.velocity.to_units(seen.velocity) * joint.factor
    if seen.torque is not None and units.rated_torque is not None and joint.turns:
        effort = units.torque(seen.torque)
    return JointState(name, position, velocity, effort)
