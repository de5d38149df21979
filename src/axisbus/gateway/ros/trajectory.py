"""Validate a JointTrajectory: convert it to the axes' units, find the axes to halt, or reject it. No clock, no network."""

from __future__ import annotations

import math
import struct
from collections.abc import Mapping
from typing import NamedTuple

from axisbus.errors import ArgumentError, StateError
from axisbus.gateway.ros.messages import JointTrajectory, Waypoint
from axisbus.gateway.ros.units import JointUnit
from axisbus.motion.point_stream.timed import MAX_POINTS, TrajectoryPoint
from axisbus.wording import counted

MAX_STAMP_DIFFERENCE = 500_000_000  # ns, the largest difference of the stamp from the present time
LONGEST = 3600.0  # seconds, the longest trajectory


class RosTrajectory(NamedTuple):
    """A trajectory to follow: the axes in this order, and their points."""

    axes: tuple[str, ...]
    points: tuple[TrajectoryPoint, ...]


def to_halt(named: tuple[str, ...], axes: Mapping[str, object]) -> tuple[str, ...]:
    """Return the axes that a trajectory without points halts: the named ones, or all if it names no known axis."""
    return tuple(dict.fromkeys(name for name in named if name in axes)) or tuple(axes)


def judged(message: JointTrajectory, joints: Mapping[str, JointUnit], now: int) -> RosTrajectory:
    """Return the trajectory to follow; ``now`` in ns since 1970.

    Raises:
        ArgumentError: the trajectory is invalid.
        StateError: its stamp says that it does not begin now.
    """
    if not message.points:
        raise ArgumentError("the trajectory has no points")  # a halt was recognised before
    _require_joints(message, joints)
    _require_now(message, now)
    factors = [joints[name].factor for name in message.joints]
    points = [_point(count, point, factors) for count, point in enumerate(message.points, 1)]
    if len(points) > MAX_POINTS or points[-1].time > LONGEST:
        raise ArgumentError(
            "the trajectory is too long",
            observed=f"it has {counted(len(points), 'point')}, and lasts {points[-1].time:g} s",
            remedy=f"send at most {MAX_POINTS} points, and {LONGEST:g} s",
        )
    return RosTrajectory(message.joints, tuple(points))


def _require_joints(message: JointTrajectory, joints: Mapping[str, JointUnit]) -> None:
    names = message.joints
    unknown = [name for name in names if name not in joints]
    twice = [name for number, name in enumerate(names) if name in names[:number]]
    if not names or unknown or twice:
        why = (
            f"{(unknown or twice)[0][:64]!r} is " + ("none of them" if unknown else "named twice")
            if names
            else "none is named"
        )
        raise ArgumentError(
            "the joints of the trajectory do not match this machine",
            observed=f"{why}; there are {', '.join(joints) or 'none'}",
            remedy="name axes of the cell, each once, with a unit of angle or length",
        )


def _require_now(message: JointTrajectory, now: int) -> None:
    delay = now - message.stamp
    if message.stamp and abs(delay) > MAX_STAMP_DIFFERENCE:
        when = f"{delay / 1e9:.3f} s ago" if delay > 0 else f"in {-delay / 1e9:.3f} s"
        raise StateError(
            "the trajectory does not begin now",
            observed=f"by its header.stamp it begins {when}; half a second of difference is allowed",
            remedy="send it at the time at which it must begin, with a stamp of 0; or synchronise both clocks",
        )


def _point(count: int, point: Waypoint, factors: list[float]) -> TrajectoryPoint:
    if any(point.effort):
        raise ArgumentError(
            f"point {count} of the trajectory contains an effort",
            remedy="send positions; efforts are not supported",
        )
    kinds = {
        "positions": point.positions,
        "velocities": point.velocities,
        "accelerations": point.accelerations,
    }
    for kind, values in kinds.items():
        if len(values) != len(factors) and (values or kind == "positions"):
            raise ArgumentError(
                f"point {count} of the trajectory has {counted(len(values), 'number')} as {kind}",
                observed=f"the trajectory names {counted(len(factors), 'joint')}",
                remedy="give a position for each joint, velocities for all joints or none, and accelerations only with velocities",
            )
        if not all(map(math.isfinite, values)):
            raise ArgumentError(f"point {count} of the trajectory has {kind} that are not finite numbers")
    turned = [
        tuple(value / factor for value, factor in zip(each, factors, strict=False)) for each in kinds.values()
    ]
    return TrajectoryPoint(point.time, turned[0], turned[1] or None, turned[2] or None)


# -- Detect a JointTrajectory without points quickly, so that a halt does not wait for the decoding of long messages ----


_HEADER = 4  # octets before the message itself; its alignment counts from there
_STAMP = 8
_MAX_JOINTS = 256  # the most joints that are read


def names_to_halt(data: bytes) -> tuple[str, ...] | None:
    """Return the joints of a JointTrajectory without points; None if it has points or is invalid."""
    if len(data) < _HEADER or data[0] != 0 or data[1] > 1:
        return None
    reader = _Reader(data, "<" if data[1] else ">")
    try:
        reader.text()  # the frame
        names = [reader.text().decode() for _ in range(min(reader.count(), _MAX_JOINTS + 1))]
        return None if len(names) > _MAX_JOINTS or reader.count() else tuple(names)
    except (struct.error, UnicodeDecodeError):
        return None


class _Reader:
    """Read a message in sequence."""

    def __init__(self, data: bytes, order: str) -> None:
        self._data = data
        self._count = struct.Struct(f"{order}I")
        self._at = _HEADER + _STAMP

    def count(self) -> int:
        """Return the next number."""
        self._at += -self._at % 4
        (found,) = self._count.unpack_from(self._data, self._at)
        self._at += 4
        return int(found)

    def text(self) -> bytes:
        """Return the next text, without its terminating octet."""
        length = self.count()
        found = self._data[self._at : self._at + length]
        self._at += length
        return found[:-1]
