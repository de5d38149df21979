"""The simulated bus of scenarios that need one: drives in real time on a virtual channel, and the same check of motors.

Deadlines are generous, because the computer may be busy; the assertions are about the plant, and about the order of events.
"""

from __future__ import annotations

import itertools
import os
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

from axisbus import eds
from axisbus.eds.builtin import resolve
from axisbus.errors import AxisbusError
from axisbus.machine.axis import Axis
from axisbus.machine.machine import Machine
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from axisbus.sim.drive import Drive
from axisbus.sim.node.network import SimulatedNetwork
from kit.cell import SCALE, cell_text
from kit.plant_probe import PlantProbe, RealTime
from kit.scenarios.safety_nets import patience

_CHANNELS = itertools.count(1)
# Slow enough that a busy computer's own delays are not taken for a silence of the drives.
SLOW = {"period": "20ms", "heartbeat": "200ms"}
STOP = 6.0  # seconds that a stop may take on a busy computer; the stops themselves take tenths


class Line(RealTime, PlantProbe):
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
        self.channel = f"axisbus-scenarios-{os.getpid()}-{next(_CHANNELS)}"
        text = cell_text(names, interface="virtual", channel=self.channel, **{**SLOW, **changes})
        self.file = folder / "cell.toml"
        self.file.write_text(text, encoding="utf-8")
        self.devices = {
            name: _device(folder, node, changes.get("eds"))
            for node, name in enumerate(names, start=1)
            if name in (names if present is None else present)
        }
        self.simulated_nodes = SimulatedNetwork(self.channel, list(self.devices.values()))

    def __enter__(self) -> Line:
        self.simulated_nodes.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.simulated_nodes._shut()

    def open(self) -> Machine:
        """Open the machine on this channel."""
        return Machine.open(self.file)

    # -- the plant -------------------------------------------------------------------------------------------------------

    def drive(self, name: str = "x") -> Drive:
        """The drive behind an axis."""
        return self.devices[name].drive

    def device_write(self, name: str, index: int, value: int) -> None:
        """Set an object of the node behind an axis, as its commissioning tool would."""
        with self.simulated_nodes.lock:
            self.devices[name].write(index, 0, value)

    def scale_of(self, name: str) -> float:
        """Increments per unit of an axis."""
        return SCALE

    @property
    def lock(self) -> AbstractContextManager[object]:
        """The lock that stops the plants meanwhile."""
        return self.simulated_nodes.lock

    def must_be_still(
        self,
        name: str = "x",
        *,
        stages: int | tuple[int, ...],
        within: float = STOP,
        for_good: float = 0.4,
        wander: float = 0.05,
    ) -> float:
        """As every probe's, with a computer's patience."""
        return super().must_be_still(
            name, within=patience(within), stages=stages, for_good=for_good, wander=wander
        )


def turning(machine: Machine, line: Line, velocity: float = 90.0) -> None:
    """Enable all axes and let them turn."""
    for axis in machine:
        enable(axis)
    for handle in [axis.move_velocity(velocity) for axis in machine]:
        handle.wait(10)
    for axis in machine:
        line.must_move(axis.name)


def enable(axis: Axis) -> None:
    """Enable, no scenario yet; a computer that was too busy for a heartbeat after the boot is given another moment."""
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
