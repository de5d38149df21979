"""Two CANopen axes and a module that speaks CAN Simple on one virtual bus, in real time: one scan, one group, one stop."""

from __future__ import annotations

import itertools
import os
import time
from dataclasses import replace
from types import SimpleNamespace

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.cell import reader
from axisbus.core.canlink import CanLink
from axisbus.core.files import load_dictionaries
from axisbus.core.inprocess import InProcess
from axisbus.core.runtime import Runtime
from axisbus.core.scan import Scan
from axisbus.core.scan_thread import ScanThread
from axisbus.core.simulated_nodes import devices as devices_of
from axisbus.core.waiting import ThreadWaiter
from axisbus.drives.gim6010.bus.stop_modules import stop_modules
from axisbus.drives.gim6010.core.part import ModuleSender
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import AxisbusError
from axisbus.machine.axis import Axis
from axisbus.machine.command_dispatch import CommandDispatcher
from axisbus.machine.groups import Group
from axisbus.motion.axis.core import AxisCore
from axisbus.sim.node.network import SimulatedNetwork
from kit.can_simple.mixed_cell import AXES, MODULE
from kit.can_simple.rig import OWN, SETTINGS, parameters

PERIOD = 0.01
_NUMBERS = itertools.count(1)

CELL = (
    """
[bus]
interface = "virtual"
channel = "{channel}"
process = "thread"
beside = true
scan_period = "10ms"
heartbeat = "100ms"
[nodes.40]
eds = "builtin:gim6010-8"
[nodes.41]
eds = "builtin:gim6010-8"
"""
    + AXES
)


class Bus:
    """A cell of two CANopen axes ``x`` and ``y``, and a module as ``m``; holds all that runs on it."""

    def __init__(self, folder) -> None:
        channel = f"can-simple-{os.getpid()}-{next(_NUMBERS)}"
        (folder / "cell.toml").write_text(CELL.format(channel=channel), "utf-8")
        cell = reader.load(folder / "cell.toml")
        dictionaries = load_dictionaries(cell)
        self.settings = replace(SETTINGS, node=MODULE, period=PERIOD)
        self.module = Module(MODULE, **OWN)
        self.devices = devices_of(cell, dictionaries)
        self.simulated_nodes = SimulatedNetwork(
            channel, list(self.devices.values()), foreign_nodes=[self.module]
        )
        self.simulated_nodes.start()
        self.channel = Channel.open("virtual", channel)
        self.runtime = Runtime(CanLink(cell, dictionaries, channel=self.channel), dictionaries, {})
        self._scan()

    def _scan(self) -> None:
        self.sender = ModuleSender(self.channel, self.settings)
        link = self.runtime.link
        link.cycle.add([self.sender], SimpleNamespace(node_id=MODULE), SimpleNamespace(look=lambda _: None))
        own = parameters("m", self.sender.port, node=MODULE, scan_period=PERIOD)
        known = {**self.runtime.parameters, "m": own}
        ports = {**self.runtime.ports, "m": self.sender}
        cores = {name: AxisCore(each, ports[name].capabilities) for name, each in known.items()}
        self.scan = Scan(link.cycle, ports, cores, PERIOD, {"all": list(known)})
        waiter = ThreadWaiter()
        self.thread = ScanThread(self.scan, waiter, None)
        commanding = CommandDispatcher(InProcess(self.scan, waiter, SimpleNamespace(nodes={}, link=None)))
        self.axes = {name: Axis(each, commanding) for name, each in known.items()}
        self.group = Group("all", self.axes, commanding)
        self.thread.start()
        time.sleep(0.5)

    @property
    def speeds(self) -> list[float]:
        """True speeds in turns/s of the rotor: of the module, and of the other axes."""
        with self.simulated_nodes.lock:
            others = [device.drive.axis.motor.velocity / 16384 for device in self.devices.values()]
            return [self.module.shaft.speed, *others]

    def homed(self) -> Bus:
        for handle in [axis.enable() for axis in self.axes.values()]:
            handle.wait(10)
        for axis in self.axes.values():
            axis.home().wait(5)
        return self

    def moves(self) -> None:
        """Wait until all of them move."""
        deadline = time.monotonic() + 5
        while min(map(abs, self.speeds)) < 0.15:
            assert time.monotonic() < deadline
            time.sleep(0.01)

    def rest(self, seconds: float) -> bool:
        """Whether all reach standstill within this time."""
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline:
            if max(map(abs, self.speeds)) < 0.02:
                return True
            time.sleep(0.02)
        return False

    def close(self) -> None:
        self.scan.quit()
        self.thread.stop()
        self.sender.close()
        self.runtime.leave()
        self.simulated_nodes.close()


@pytest.fixture
def bus(tmp_path):
    made = Bus(tmp_path)
    yield made
    made.close()


def test_canopen_and_can_simple_axes_move_together_on_a_line_and_direct(bus):
    bus.homed()
    bus.group.move_linear((40.0, -20.0, 60.0), velocity=60.0).wait(10)
    assert bus.module.position * 45.0 == pytest.approx(60.0, abs=0.1)
    assert bus.axes["x"].position == pytest.approx(40.0, abs=0.1)
    bus.group.move_direct((0.0, 0.0, 0.0)).wait(10)
    assert bus.module.position * 45.0 == pytest.approx(0.0, abs=0.1)


def test_a_fault_of_one_stops_all(bus):
    bus.homed()
    handle = bus.group.move_linear((400.0, 200.0, 300.0), velocity=60.0)
    bus.moves()
    with bus.simulated_nodes.lock:
        bus.module.dials.motor_error = 0x10000
    with pytest.raises(AxisbusError):
        handle.wait(5)
    assert bus.rest(3.0)


def test_a_scan_that_dies_stops_all_axes(bus):
    bus.homed()
    bus.group.move_linear((400.0, 200.0, 300.0), velocity=60.0)
    bus.moves()
    bus.sender.port.read = None  # whatever a bug may be: the next cycle raises
    assert bus.rest(3.0)
    assert bus.scan.ended
    assert isinstance(bus.scan.failure, Exception)


def test_a_rescue_after_the_scan_ended_brakes_the_module_and_switches_its_power_off(bus):
    bus.homed()
    bus.axes["m"].move_velocity(90.0).wait(5)
    bus.scan.quit()
    bus.thread.stop()  # a scan that only ends: nothing is sent any more
    time.sleep(0.2)
    assert bus.module.shaft.speed > 1.5
    (stopped,) = stop_modules(bus.channel, {"m": bus.settings})
    assert stopped.ok, stopped.text
    assert stopped.text == "stands, without power"
    assert not bus.module.energised
    assert bus.rest(1.0)


def test_a_lost_module_is_reported_as_not_confirmed(bus):
    with bus.simulated_nodes.lock:
        bus.module.dials.dead = True
    (stopped,) = stop_modules(bus.channel, {"m": bus.settings})
    assert not stopped.ok
    assert "NOT CONFIRMED" in stopped.text
