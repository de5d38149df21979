"""The stage of the SocketCAN tests: links made for a test, and a cell of two simulated drives with a look at their motors."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

from axisbus import eds
from axisbus.eds.builtin import resolve
from axisbus.machine.handle import Handle
from axisbus.machine.machine import Machine
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from axisbus.sim.node.network import SimulatedNetwork

GENERIC = "builtin:generic-cia402"
CELL = """
[bus]
interface = "socketcan"
channel = "{channel}"
scan_period = "100ms"
heartbeat = "500ms"
[nodes.1]
eds = "builtin:generic-cia402"
[nodes.2]
eds = "builtin:generic-cia402"
[axes.x]
node = 1
unit = "increments"
[axes.x.defaults]
velocity = 20000
acceleration = 200000
[axes.x.stop]
quick_stop = "ramp"
halt = "slow-ramp"
disable = "slow-ramp"
fault = "ramp"
deceleration = 400000
[axes.y]
node = 2
unit = "increments"
[axes.y.defaults]
velocity = 20000
acceleration = 200000
[axes.y.stop]
quick_stop = "ramp"
halt = "slow-ramp"
disable = "slow-ramp"
fault = "ramp"
deceleration = 400000
"""


class Ends:
    """A vxcan pair: frames sent at one end arrive at the other, and each end can be taken down alone."""

    ours, theirs = "vxcan0", "vxcan1"

    def __init__(self) -> None:
        ip("link", "add", "dev", self.ours, "type", "vxcan", "peer", "name", self.theirs)
        self.up(self.ours)
        self.up(self.theirs)

    def up(self, name: str) -> None:
        ip("link", "set", name, "up")

    def down(self, name: str) -> None:
        ip("link", "set", name, "down")

    def close(self) -> None:
        ip("link", "del", self.ours)


class Stage:
    """Two simulated drives on ``theirs`` and a cell file for ``ours``."""

    def __init__(self, folder: Path, ours: str, theirs: str) -> None:
        self.file = folder / "cell.toml"
        self.file.write_text(CELL.format(channel=ours), encoding="utf-8")
        drive = eds.load(resolve(GENERIC, folder))
        self.devices: list[Device] = [device_from_eds(drive, node) for node in (1, 2)]
        self.simulated_nodes = SimulatedNetwork(theirs, self.devices, interface="socketcan")
        self.simulated_nodes.start()

    def open(self) -> Machine:
        return Machine.open(self.file)

    def speeds(self) -> list[float]:
        """The motors' speeds in increments/s."""
        with self.simulated_nodes.lock:
            return [abs(device.drives[0].axis.motor.velocity) for device in self.devices]

    def supply(self, *nodes: int, on: bool) -> None:
        """Take the supply of nodes away, or give it back."""
        with self.simulated_nodes.lock:
            for node in nodes:
                self.devices[node - 1].dials.unpowered = not on

    def energised(self) -> list[bool]:
        """Which power stages drive their motors."""
        with self.simulated_nodes.lock:
            return [device.drives[0].power.stage.name == "ENABLED" for device in self.devices]

    def travelling(self, machine: Machine) -> list[Handle]:
        """Enable both axes, send them far, and return their handles as soon as both motors turn."""
        for axis in machine:
            axis.enable().wait(20)
        handles = [axis.move_relative(10_000_000) for axis in machine]
        until(lambda: min(self.speeds()) > 1000 or not all(handle.busy for handle in handles), 10)
        for handle in handles:
            if not handle.busy:
                handle.wait(0)  # raises the error that ended it
        assert all(handle.busy for handle in handles), "a move over 10,000,000 increments ended at once"
        return handles


def schedule(policy: int, priority: int = 0) -> None:
    """Schedule all threads of this process so, if that is permitted."""
    for task in Path("/proc/self/task").iterdir():
        with suppress(OSError):
            os.sched_setscheduler(int(task.name), policy, os.sched_param(priority))


def ip(*arguments: str) -> None:
    """Run ``ip`` as the tests' user, who must be allowed to make links."""
    program = shutil.which("ip") or "/usr/sbin/ip"
    subprocess.run([program, *arguments], check=True, capture_output=True, text=True)


def until(happened: Callable[[], bool], limit: float) -> None:
    """Wait until something has happened, at most ``limit`` seconds."""
    deadline = time.monotonic() + limit
    while not happened():
        assert time.monotonic() < deadline, f"not within {limit:g} s"
        time.sleep(0.005)
