"""The stage of the stories that need a bus: stand-ins in real time on a virtual channel, and the same look at their motors.

Deadlines are generous, because the computer may be busy; what is asserted is the plant, and in which order things were.
"""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable
from pathlib import Path

from story_nets import PlantMoves, patience
from story_rig import SCALE, STAGE_NAMES, cell_text

from axisbus import eds
from axisbus.eds.builtin import resolve
from axisbus.errors import AxisbusError
from axisbus.machine.machine import Machine
from axisbus.motion.axis import Axis
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from axisbus.sim.network import StandIns

_CHANNELS = itertools.count(1)
# Slow enough that a busy computer's own delays are not taken for a silence of the drives.
SLOW = {"period": "20ms", "heartbeat": "200ms"}
STOP = 6.0  # seconds that a stop may take on a busy computer; the stops themselves take tenths


class Line:
    """A channel with a drive for each letter of ``names``, and the cell file that fits it."""

    def __init__(
        self,
        folder: Path,
        names: str = "x",
        *,
        present: str | None = None,
        **changes: str,
    ) -> None:
        """``present``: the axes whose nodes are there (default all); ``changes``: see ``cell_text``."""
        self.names = names
        self.channel = f"axisbus-stories-{os.getpid()}-{next(_CHANNELS)}"
        text = cell_text(names, interface="virtual", channel=self.channel, **{**SLOW, **changes})
        self.file = folder / "cell.toml"
        self.file.write_text(text, encoding="utf-8")
        self.devices = {
            name: _device(folder, node, changes.get("eds"))
            for node, name in enumerate(names, start=1)
            if name in (names if present is None else present)
        }
        self.stand_ins = StandIns(self.channel, list(self.devices.values()))

    def __enter__(self) -> Line:
        self.stand_ins.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.stand_ins._shut()

    def open(self) -> Machine:
        """Open the machine on this channel."""
        return Machine.open(self.file)

    # -- the plant -------------------------------------------------------------------------------------------------------

    def speed(self, name: str = "x") -> float:
        """The motor's speed in degrees/s."""
        with self.stand_ins.lock:
            return abs(self.devices[name].drive.axis.motor.velocity) / SCALE

    def where(self, name: str = "x") -> float:
        """The motor's position in degrees."""
        with self.stand_ins.lock:
            return self.devices[name].drive.axis.motor.position / SCALE

    def stage(self, name: str = "x") -> int:
        """The state of the power stage, by the stand-in's number."""
        return int(self.devices[name].drive.power.stage)

    def told(self, name: str = "x") -> str:
        """The plant of an axis in words."""
        return f"{name} turns at {self.speed(name):g} deg/s, {STAGE_NAMES[self.stage(name)]}"

    def must_move(self, name: str = "x") -> None:
        """Make sure that the story begins in motion."""
        assert self.speed(name) > 20.0, self.told(name)

    def must_stand(
        self, name: str = "x", *, stages: int | tuple[int, ...], within: float = STOP, for_good: float = 0.4
    ) -> None:
        """Wait until the motor stands in one of ``stages``, and see that it stays so.

        Raises:
            PlantMoves: it does not.
        """
        wanted = (stages,) if isinstance(stages, int) else stages
        deadline = time.monotonic() + patience(within)
        while self.speed(name) > 0.0 or self.stage(name) not in wanted:
            if time.monotonic() > deadline:
                raise PlantMoves(f"after {within:g} s: {self.told(name)}")
            time.sleep(0.005)
        until = time.monotonic() + for_good
        while time.monotonic() < until:
            if self.speed(name) > 0.0 or self.stage(name) not in wanted:
                raise PlantMoves(f"after it stood: {self.told(name)}")
            time.sleep(0.005)


def turning(machine: Machine, line: Line, velocity: float = 90.0) -> None:
    """Enable all axes and let them turn."""
    for axis in machine:
        enable(axis)
    for handle in [axis.move_velocity(velocity) for axis in machine]:
        handle.wait(10)
    for axis in machine:
        line.must_move(axis.name)


def enable(axis: Axis) -> None:
    """Enable, no story yet; a computer that was too busy for a heartbeat after the boot is given another moment."""
    for _ in range(10):
        try:
            axis.enable().wait(10)
        except AxisbusError:
            time.sleep(0.3)
            if axis.error is not None:
                axis.reset().wait(10)
        else:
            return
    axis.enable().wait(10)


def until(happened: Callable[[], bool], limit: float = STOP) -> None:
    """Wait until something has happened."""
    deadline = time.monotonic() + limit
    while not happened():
        assert time.monotonic() < deadline, f"it has not happened within {limit} s"
        time.sleep(0.005)


def _device(folder: Path, node: int, spec: str | None) -> Device:
    return device_from_eds(eds.load(resolve(spec or "builtin:generic-cia402", folder)), node, seed=node)
