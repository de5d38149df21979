"""A wire in virtual time with simulated modules on it, a hand-written master's side, and a look at the true plants."""

from __future__ import annotations

import struct
from collections.abc import Sequence
from itertools import pairwise
from typing import NamedTuple

from axisbus.drives.gim6010.sim.module import Module
from axisbus.eds.io.reader import load
from kit.pages import ROOT

STEP = 0.001  # s
# The test's own numbers, typed from the manual 4.1.2.
HEARTBEAT, ESTOP, GET_ERROR, RX_SDO, TX_SDO, SET_ID, SET_STATE, MIT = range(0x01, 0x09)
ESTIMATES, COUNT, SET_MODE, POS, VEL, TORQUE, LIMITS = range(0x09, 0x10)
ANTICOGGING, TRAJ_VEL, TRAJ_ACCEL, TRAJ_INERTIA, IQ = range(0x10, 0x15)
REBOOT, BUS, CLEAR, LINEAR, POS_GAIN, VEL_GAINS, TORQUES, POWERS, DISABLE, SAVE = range(0x16, 0x20)
IDLE, CLOSED_LOOP = 1, 8
FORMS = {
    SET_ID: "I", SET_STATE: "I", SET_MODE: "II", POS: "fhh", VEL: "ff", TORQUE: "f", LIMITS: "ff", TRAJ_VEL: "f",
    TRAJ_ACCEL: "ff", TRAJ_INERTIA: "f", LINEAR: "i", POS_GAIN: "f", VEL_GAINS: "ff",
}  # fmt: skip


def gim_eds():
    """The EDS of the module as a CANopen drive."""
    return load(ROOT / "eds" / "gim6010-8.eds")


class Heard(NamedTuple):
    """A frame of the modules, with its time."""

    time: float
    can_id: int
    data: bytes

    @property
    def command(self) -> int:
        return self.can_id & 0x1F

    @property
    def node(self) -> int:
        return self.can_id >> 5


class Plant(NamedTuple):
    """The true plant of a module: s, rotor turns, turns/s, and whether there is power on the motor."""

    time: float
    position: float
    velocity: float
    energised: bool


class Wire:
    """Modules in virtual time; holds their frames and the motions of their plants."""

    def __init__(self, modules: Sequence[Module]) -> None:
        self.modules = list(modules)
        self.now = 0.0
        self.heard: list[Heard] = []
        self.plants: list[list[Plant]] = [[] for _ in self.modules]

    def run(self, seconds: float, step: float = STEP) -> None:
        """Let time pass."""
        for _ in range(round(seconds / step)):
            self.now += step
            for module, record in zip(self.modules, self.plants, strict=True):
                module.step(self.now)
                record.append(Plant(self.now, module.position, module.shaft.speed, module.energised))
            self._collect()

    def send(self, can_id: int, data: bytes = b"", *, remote: bool = False) -> list[Heard]:
        """Send a frame to all; return their immediate answers."""
        before = len(self.heard)
        for module in self.modules:
            module.on_frame(can_id, data, self.now, remote=remote)
        self._collect()
        return self.heard[before:]

    def command(self, node: int, command: int, *values: float) -> list[Heard]:
        """Send a command with its fields, in 8 bytes."""
        data = struct.pack("<" + FORMS.get(command, ""), *values)
        return self.send(node << 5 | command, data.ljust(8, b"\0"))

    def ask(self, node: int, command: int) -> bytes:
        """Ask by a remote frame; return the one answer."""
        (answer,) = self.send(node << 5 | command, remote=True)
        assert (answer.node, answer.command) == (node, command)
        return answer.data

    def beats(self, node: int, since: float = 0.0) -> list[bytes]:
        """The heartbeats of a node."""
        wanted = node << 5 | HEARTBEAT
        return [frame.data for frame in self.heard if frame.can_id == wanted and frame.time >= since]

    def _collect(self) -> None:
        for module in self.modules:
            self.heard += [Heard(self.now, can_id, bytes(data)) for can_id, data in module.take_frames()]


class Bench(Wire):
    """One module on a wire of its own."""

    def __init__(self, module: Module | None = None, **parameters: float) -> None:
        """``parameters``: by the last part of their names."""
        self.module = module or Module(5, **parameters)
        super().__init__([self.module])

    @property
    def node(self) -> int:
        return self.module.node_id

    @property
    def plant(self) -> list[Plant]:
        return self.plants[0]

    def order(self, command: int, *values: float) -> list[Heard]:
        """Send a command to the module."""
        return self.command(self.node, command, *values)

    def floats(self, command: int) -> tuple[float, float]:
        """Ask for two floats."""
        one, other = struct.unpack("<ff", self.ask(self.node, command))
        return one, other

    @property
    def state(self) -> int:
        """The state in the last heartbeat."""
        self.run(0.1)
        return self.beats(self.node)[-1][4]

    def enable(self, control: int = 3, inputs: int = 1) -> None:
        """Set modes and go to closed loop."""
        self.order(SET_MODE, control, inputs)
        self.order(SET_STATE, CLOSED_LOOP)
        self.run(0.02)
        assert self.module.energised

    def must_be_smooth(self, hardest: float = 700.0) -> None:
        """The plant never jumped: no step went farther than its velocity, and no velocity changed faster than a motor can."""
        for before, after in pairwise(self.plant):
            dt = after.time - before.time
            fastest = max(abs(before.velocity), abs(after.velocity))
            assert abs(after.position - before.position) <= fastest * dt + 0.5 * hardest * dt * dt + 1e-6
            assert abs(after.velocity - before.velocity) <= hardest * dt + 1e-6
