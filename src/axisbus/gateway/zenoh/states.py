"""The state of an axis as a message: in its units, with its age, and without values that are too old."""

from __future__ import annotations

from axisbus.cia402.modes import ModeOfOperation, short
from axisbus.errors import AxisbusError, with_alarm
from axisbus.fleet.messages import AxisInfo, AxisStateMessage
from axisbus.gateway import values
from axisbus.machine.axis import Axis
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.snapshot import Snapshot

UNKNOWN = "unknown"
OLD = 1.0  # seconds; the states of an older process image are not valid


def state_of(
    snapshot: Snapshot,
    parameters: AxisParameters,
    now: float,
    clock: float,
    n: int,
    bridge: str,
    silent: bool,
) -> AxisStateMessage:
    """Return the state of an axis from its process image; ``now`` (s, monotonic) of this computer, ``clock`` for people.

    ``silent``: the process image is out of date, so that only its age is reported.
    """
    age = max(0.0, now - snapshot.now)
    unit, error = parameters.units.position.unit, snapshot.error
    if silent or age > OLD:
        return AxisStateMessage(n, bridge, clock, unit, UNKNOWN, age, error=_told(error))
    units = parameters.units
    return AxisStateMessage(
        n,
        bridge,
        clock,
        unit,
        snapshot.state.value,
        age,
        snapshot.power_state.value,
        None if snapshot.mode is None else short(ModeOfOperation(snapshot.mode)),
        values.position(snapshot, units),
        values.velocity(snapshot, units),
        values.torque(snapshot, units),
        values.following_error(snapshot, units),
        snapshot.homed,
        _told(error),
        None if snapshot.position is None else max(0.0, now - snapshot.position_stamp),
    )


def info_of(axis: Axis, node: int | None) -> AxisInfo:
    """Return the description of an axis."""
    limits = axis.limits
    found = {
        "min_position": None if limits.position is None else limits.position[0],
        "max_position": None if limits.position is None else limits.position[1],
        "max_velocity": limits.velocity,
        "max_acceleration": limits.acceleration,
        "max_torque": limits.torque,
    }
    known = {name: float(value) for name, value in found.items() if value is not None}
    return AxisInfo(axis.name, axis.unit, node, known)


def _told(error: AxisbusError | None) -> str | None:
    return None if error is None else with_alarm(error.message, error)
