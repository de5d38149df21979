"""CDR by hand (OMG's classic, as ROS 2 sends it): a JointState read, a JointTrajectory written; independent of the product's."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from typing import NamedTuple


class Read(NamedTuple):
    """A JointState as it was read."""

    sec: int
    nanosec: int
    frame: str
    names: list[str]
    position: list[float]
    velocity: list[float]
    effort: list[float]


class _Reader:
    def __init__(self, data: bytes) -> None:
        assert data[:4] == b"\x00\x01\x00\x00", "classic CDR, little endian"
        self.data, self.at = data[4:], 0

    def take(self, form: str) -> tuple:
        size = struct.calcsize(f"<{form[-1]}")
        self.at += -self.at % size
        found = struct.unpack_from(f"<{form}", self.data, self.at)
        self.at += struct.calcsize(f"<{form}")
        return found

    def text(self) -> str:
        (length,) = self.take("I")
        found = self.data[self.at : self.at + length]
        self.at += length
        assert found.endswith(b"\0")
        return found[:-1].decode()

    def doubles(self) -> list[float]:
        (count,) = self.take("I")
        return list(self.take(f"{count}d")) if count else []


def joint_state(data: bytes) -> Read:
    """Read a JointState, with nothing behind it."""
    reader = _Reader(data)
    (sec,), (nanosec,), frame = reader.take("i"), reader.take("I"), reader.text()
    names = [reader.text() for _ in range(reader.take("I")[0])]
    found = Read(sec, nanosec, frame, names, reader.doubles(), reader.doubles(), reader.doubles())
    assert len(reader.data) - reader.at < 4
    return found


class _Writer:
    def __init__(self, order: str) -> None:
        self.order, self.data = order, bytearray()

    def put(self, form: str, *values: object) -> None:
        self.data += bytes(-len(self.data) % struct.calcsize(f"<{form[-1]}"))
        self.data += struct.pack(f"{self.order}{form}", *values)

    def text(self, text: str) -> None:
        coded = text.encode() + b"\0"
        self.put("I", len(coded))
        self.data += coded

    def doubles(self, values: Sequence[float]) -> None:
        self.put("I", len(values))
        if values:
            self.put(f"{len(values)}d", *values)


Row = tuple[float, Sequence[float], Sequence[float], Sequence[float], Sequence[float]]


def joint_trajectory(joints: Sequence[str], rows: Sequence[Row], stamp: int = 0, order: str = "<") -> bytes:
    """Write a JointTrajectory: rows of time, positions, velocities, accelerations, efforts; ``stamp`` in ns."""
    writer = _Writer(order)
    writer.put("i", stamp // 10**9)
    writer.put("I", stamp % 10**9)
    writer.text("")
    writer.put("I", len(joints))
    for joint in joints:
        writer.text(joint)
    writer.put("I", len(rows))
    for time, *columns in rows:
        for column in columns:
            writer.doubles(column)
        writer.put("i", int(time // 1))
        writer.put("I", round(time % 1 * 1e9))
    return bytes([0, order == "<", 0, 0]) + bytes(writer.data)
