"""A cell of two CANopen axes ``x`` and ``y`` and a module that speaks CAN Simple as ``m``, and a served bus with its plants."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from axisbus.cell import reader
from axisbus.core.sim_server import ServedDrives
from axisbus.drives.gim6010.sim.module import Module
from axisbus.sim.socketcand_server import Server
from kit.scenarios.program import TESTS

MODULE = 16  # with CANopen nodes from 32 on, by the manual's table (4.1.4)
CUTTING = TESTS / "kit" / "scenarios" / "safety_net_removal"
SPEED = 90.0  # deg/s of the output: two turns/s of the rotor
TURNS = 2.0
RESTS = 0.02  # turns/s

AXES = "".join(
    f"""
[axes.{name}]
node = {node}
unit = "deg"
scale = "131072/360"
max_velocity = 800.0
[axes.{name}.defaults]
velocity = 180.0
acceleration = 720.0
[axes.{name}.homing]
method = 35
[axes.{name}.stop]
quick_stop = "ramp"
halt = "slow-ramp"
deceleration = 1440.0
"""
    for name, node in (("x", 40), ("y", 41))
)  # of the CANopen nodes
CELL = (
    """
[bus]
{bus}
scan_period = "20ms"
heartbeat = "200ms"
[nodes.40]
eds = "builtin:generic-cia402"
[nodes.41]
eds = "builtin:generic-cia402"
[nodes.16]
protocol = "can_simple"
firmware = "0.5.13"
[nodes.16.can_simple]
velocity_limit = 20.0
current_limit = 20.0
velocity_ramp = 40.0
acceleration = 80.0
[axes.m]
node = 16
unit = "deg"
scale = "131072/360"
max_velocity = 800.0
[axes.m.defaults]
velocity = 180.0
acceleration = 720.0
[axes.m.homing]
method = 37
[axes.m.stop]
{stop}
"""
    + AXES
    + """
[groups.all]
axes = ["x", "y", "m"]
"""
)


def write(folder: Path, bus: str, stop: str = 'quick_stop = "ramp"') -> Path:
    """Write the file of the cell; ``bus`` are lines of its table, ``stop`` of that of the module."""
    path = folder / "cell.toml"
    path.write_text(CELL.format(bus=bus, stop=stop), "utf-8")
    return path


class Plants:
    """The motors behind a served bus, whatever becomes of the programs on it; velocities in turns/s of the rotor."""

    def __init__(self, folder: Path, server: Server, served: ServedDrives, process: str, stop: str) -> None:
        self._served = served
        options = f"options = {{ host = '127.0.0.1', port = {server.port} }}"
        bus = f'interface = "socketcand"\nchannel = "{server.channel}"\n{options}\nprocess = "{process}"'
        self.file = write(folder, bus, stop)

    @property
    def module(self) -> Module:
        """The module."""
        found = self._served._cell_foreign_nodes[MODULE].foreign_node
        assert isinstance(found, Module)
        return found

    @property
    def speeds(self) -> list[float]:
        """Of the module, and of the CANopen drives."""
        motors = [device.drive.axis.motor for device in self._served._devices.values()]
        return [self.module.shaft.speed, *(motor.velocity / 16384 for motor in motors)]

    def turn(self) -> bool:
        """Whether all of them do."""
        return min(map(abs, self.speeds)) > 0.15

    def rest(self, seconds: float, speeds: Callable[[], list[float]] | None = None) -> bool:
        """Whether all stop within this time, and stay so for 0.3 s."""
        return stay(lambda: max(map(abs, (speeds or (lambda: self.speeds))())) < RESTS, seconds)


def stay(so: Callable[[], bool], seconds: float, for_good: float = 0.3) -> bool:
    """Whether something becomes so within this time, and stays so."""
    until, since = time.monotonic() + seconds, None
    while time.monotonic() < until + for_good:
        if not so():
            since = None
        elif since is None:
            since = time.monotonic()
        elif time.monotonic() - since >= for_good:
            return True
        time.sleep(0.01)
    return False


@contextmanager
def served(folder: Path, process: str = "own", stop: str = 'quick_stop = "ramp"') -> Iterator[Plants]:
    """Serve the drives of the cell from this process, on any port; the cell's core is to run in a ``process`` of this kind."""
    made = ServedDrives(reader.load(write(folder, 'interface = "sim"', stop)), ())
    with made.serve(0) as server:
        yield Plants(folder, server, made, process, stop)


class Doomed:
    """A program whose axes turn on a served bus, with its core and watchdog process (0: it has none); all are killed at the end."""

    def __init__(self, folder: Path, scene: str, cut: str = "") -> None:
        path = os.pathsep.join([str(CUTTING), str(TESTS), *filter(None, [os.environ.get("PYTHONPATH")])])
        self._errors = folder / "errors.txt"
        with self._errors.open("w") as errors:
            self.process = subprocess.Popen(
                [sys.executable, "-m", "kit.can_simple.moving_program", str(folder), scene],
                stdout=subprocess.PIPE,
                stderr=errors,
                text=True,
                env={
                    **os.environ,
                    "PYTHONPATH": path,
                    "AXISBUS_CUT": cut,
                    "XDG_STATE_HOME": str(folder),
                },
            )
        assert self.process.stdout is not None
        with self.process.stdout as out:
            words = out.readline().split()
        assert words[:1] == ["ready"], self.errors
        self.program, self.watchdog, self.core = map(int, words[1:])

    @property
    def errors(self) -> str:
        """Its error output."""
        return self._errors.read_text()

    def strike(self, who: str, number: int) -> None:
        """Send a signal to one of them."""
        os.kill(getattr(self, who), number)

    def __enter__(self) -> Doomed:
        return self

    def __exit__(self, *_: object) -> None:
        for process in filter(None, (self.program, self.watchdog, self.core)):
            with suppress(OSError):
                os.kill(process, signal.SIGKILL)
        self.process.wait()
