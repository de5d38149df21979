"""A router and a session of Zenoh that play ROS 2: joint states are received, and joint trajectories sent, as rmw_zenoh does it."""

from __future__ import annotations

import itertools
import json
import struct
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import zenoh

from axisbus.fleet.network import connected
from kit.cdr import Read, joint_state, joint_trajectory
from kit.zenoh_cell import free_port

STATES = (
    "joint_states/sensor_msgs::msg::dds_::JointState_/"
    "RIHS01_a13ee3a330e346c9d87b5aa18d24e11690752bd33a0350f11c5882bc9179260e"
)
TRAJECTORIES = (
    "joint_trajectory_controller/joint_trajectory/trajectory_msgs::msg::dds_::JointTrajectory_/"
    "RIHS01_179b33eba59d676f6d967ac71fe35e7ca2f64b2f3928f4a018cec115e213796e"
)


def _opened(mode: str, *, gossip: bool, **endpoints: Sequence[str]) -> zenoh.Session:
    config = zenoh.Config()
    config.insert_json5("mode", f'"{mode}"')
    for kind, given in endpoints.items():
        config.insert_json5(f"{kind}/endpoints", json.dumps(given))
    config.insert_json5("scouting/multicast/enabled", "false")
    config.insert_json5("scouting/gossip/enabled", json.dumps(gossip))
    config.insert_json5("routing/router/peers_failover_brokering", "false")
    return zenoh.open(config)


@contextmanager
def router() -> Iterator[str]:
    """A router configured like rmw_zenohd, which passes nothing on between peers; its address."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    session = _opened("router", gossip=True, listen=[endpoint])
    try:
        yield endpoint
    finally:
        session.close()


class Ros:
    """A node in the graph of ROS 2; ``heard``: joint states with their attachments, and their times of receipt."""

    def __init__(self, endpoint: str, prefix: str = "0") -> None:
        self.session = _opened("peer", connect=[endpoint], listen=["tcp/127.0.0.1:0"], gossip=True)
        connected(self.session, 5.0)
        self.heard: list[tuple[Read, tuple, float]] = []
        self._key = f"{prefix}/{TRAJECTORIES}"
        self._numbers = itertools.count(1)
        self._hearing = self.session.declare_subscriber(f"{prefix}/{STATES}", self._hear)

    def __enter__(self) -> Ros:
        return self

    def __exit__(self, *_: object) -> None:
        self.session.close()

    @property
    def newest(self) -> Read:
        """The newest joint state."""
        return self.heard[-1][0]

    def tokens(self) -> list[str]:
        """The present nodes."""
        found = self.session.liveliness().get("@ros2_lv/**", timeout=1.0)
        return sorted(str(reply.ok.key_expr) for reply in found if reply.ok is not None)

    def attachment(self, number: int | None = None, sent: int | None = None, gid: bytes = b"R" * 16) -> bytes:
        """The attachment of the next message, or of one with another number."""
        number = next(self._numbers) if number is None else number
        return struct.pack("<qqB16s", number, time.time_ns() if sent is None else sent, 16, gid)

    def send(self, joints: Sequence[str], *rows: tuple, stamp: int = 0) -> None:
        """Send a trajectory: rows of time, positions, and further values."""
        full = [(*row, *([()] * (5 - len(row)))) for row in rows]
        self.put(joint_trajectory(joints, full, stamp), self.attachment())

    def put(self, data: bytes, attachment: bytes | None) -> None:
        """Send octets."""
        self.session.put(self._key, data, attachment=attachment)

    def _hear(self, sample: object) -> None:
        told = sample.attachment.to_bytes()
        self.heard.append(
            (joint_state(sample.payload.to_bytes()), struct.unpack("<qqB16s", told), time.monotonic())
        )
