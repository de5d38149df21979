"""Encode JointState and decode JointTrajectory (CDR), with the type definitions of the package rosbags."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from rosbags.typesys import Stores, get_typestore
from rosbags.typesys.store import Typestore

from axisbus.errors import ArgumentError
from axisbus.gateway.ros.names import Topic, qualified
from axisbus.wording import counted

JOINT_STATE = "sensor_msgs/msg/JointState"
JOINT_TRAJECTORY = "trajectory_msgs/msg/JointTrajectory"
LARGEST = 1 << 20  # octets, the largest message that is decoded
_SECOND = 1_000_000_000  # ns


class JointState(NamedTuple):
    """A joint: rad or m, per s, and N·m or N; NaN if unknown."""

    name: str
    position: float
    velocity: float
    effort: float


@dataclass(frozen=True, slots=True)
class Waypoint:
    """A point of a trajectory; ``time`` in s from its beginning, the other values for each joint or empty."""

    time: float
    positions: tuple[float, ...]
    velocities: tuple[float, ...] = ()
    accelerations: tuple[float, ...] = ()
    effort: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class JointTrajectory:
    """A trajectory as received; ``stamp`` in ns since 1970, 0: it begins at once."""

    stamp: int
    joints: tuple[str, ...]
    points: tuple[Waypoint, ...]


@cache
def _store() -> Typestore:
    return get_typestore(Stores.ROS2_IRON)  # the first release with hashes; both types have not changed since


def topic_of(namespace: str, name: str, type_name: str) -> Topic:
    """Return a topic of a type, with its hash."""
    return Topic(qualified(namespace, name), type_name, _store().hash_rihs01(type_name))


def state_message(stamp: int, joints: Sequence[JointState]) -> bytes:
    """Return a JointState; ``stamp`` in ns since 1970."""
    types: Any = _store().types
    columns = [np.array(column, dtype=np.float64) for column in list(zip(*joints, strict=True))[1:]] or [
        np.zeros(0)
    ] * 3
    time = types["builtin_interfaces/msg/Time"](sec=stamp // _SECOND, nanosec=stamp % _SECOND)
    header = types["std_msgs/msg/Header"](stamp=time, frame_id="")
    message = types[JOINT_STATE](header, [joint.name for joint in joints], *columns)
    return bytes(_store().serialize_cdr(message, JOINT_STATE, little_endian=True))


def too_large(size: int) -> ArgumentError | None:
    """Return why a message is too large to decode; None if it is not."""
    if size <= LARGEST:
        return None
    return ArgumentError("a message is not a JointTrajectory", observed=f"it has {counted(size, 'octet')}")


def trajectory_of(data: bytes) -> JointTrajectory:
    """Return the trajectory in a message.

    Raises:
        ArgumentError: the message is not a JointTrajectory.
    """
    refused = too_large(len(data))
    if refused is not None:
        raise refused
    try:
        found: Any = _store().deserialize_cdr(data, JOINT_TRAJECTORY)
    except Exception as error:  # the package raises various errors for an invalid message
        raise ArgumentError("a message is not a JointTrajectory", observed=str(error)) from error
    stamp = found.header.stamp
    return JointTrajectory(
        stamp.sec * _SECOND + stamp.nanosec,
        tuple(found.joint_names),
        tuple(_waypoint(point) for point in found.points),
    )


def _waypoint(point: Any) -> Waypoint:
    time = point.time_from_start
    lists = (point.positions, point.velocities, point.accelerations, point.effort)
    return Waypoint(time.sec + time.nanosec / _SECOND, *(tuple(each.tolist()) for each in lists))


# ----------------------------------------------------------------------------------------------------------------------
# The attachment of each message of rmw_zenoh: number, time of sending, and publisher (rmw_zenoh's design, "Publishers").


_FORM = struct.Struct("<qqB16s")
_GID = 16  # octets


class Attachment(NamedTuple):
    """``sent`` in ns since 1970 by the sender's clock; ``gid`` names the publisher."""

    number: int
    sent: int
    gid: bytes

    def packed(self) -> bytes:
        """Return the encoded attachment."""
        return _FORM.pack(self.number, self.sent, _GID, self.gid)


def attachment_of(data: bytes | None) -> Attachment:
    """Return the attachment of a message.

    Raises:
        ArgumentError: it is missing or invalid.
    """
    if data is None or len(data) != _FORM.size:
        seen = "there is none" if data is None else f"it has {counted(len(data), 'octet')}, not {_FORM.size}"
        raise ArgumentError("a message has no attachment of rmw_zenoh", observed=seen)
    number, sent, length, gid = _FORM.unpack(data)
    if length != _GID:
        raise ArgumentError(
            "a message has no attachment of rmw_zenoh", observed=f"its GID has {length} octets"
        )
    return Attachment(number, sent, gid)
