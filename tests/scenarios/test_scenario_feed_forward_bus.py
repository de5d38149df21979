"""Feed-forward over a bus in real time: offsets sent with SYNC, and the offsets after the core has ended."""

from __future__ import annotations

import mmap
import struct

import pytest

from axisbus import eds
from axisbus.core import canlink
from axisbus.core.process.rescue import Lifeline
from axisbus.eds.builtin import resolve
from axisbus.errors import ArgumentError, BootError
from axisbus.ipc import rescue_memory
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.sim.build import device_from_eds
from axisbus.sim.device import Device
from kit.cell import GENERIC, Cell, Stage
from kit.plant_probe import ENABLED, OFF
from kit.sim.sync_values import CSP, Witness

TABLE = "[axes.x.feed_forward]\nvelocity = true\ninertia = 0.002\ntorque_offset = 1.0\n"
SPEED = 90.0  # deg/s, 9000 increments/s
RPDO3 = 0x401


def made(scenario: Stage) -> Cell:
    cell = scenario.real("x", axis="rated_torque = 10.0", more=TABLE)
    cell.enabled()
    return cell


def test_the_offsets_travel_with_the_targets(scenario: Stage) -> None:
    cell = made(scenario)
    witness = Witness(cell.drive())
    cell.x.follow(TrapezoidalTrajectory(0.0, 180.0, SPEED, 500.0)).wait(10)
    cell.run(0.1)
    even = [held for held in witness.held if held.mode == CSP and held.velocity_offset == 9000]
    assert len(even) > 100  # of the two seconds at speed
    assert {held.torque_offset for held in even[40:-1]} == {100}
    assert cell.device().read(0x60B1) == 0
    cell.machine.close()
    cell.run(0.2)
    assert cell.stage() in OFF
    assert (cell.device().read(0x60B1), cell.device().read(0x60B2)) == (0, 0)


def test_the_rescue_frames_for_a_dead_core_contain_zero_feed_forward(scenario: Stage) -> None:
    cell = made(scenario)
    core = cell.machine._core
    memory = mmap.mmap(-1, rescue_memory.size_of(1))
    line = Lifeline(memory, 0, core, ["x"])
    core.session.observe(line.after_cycle)
    cell.x.follow(TrapezoidalTrajectory(0.0, 180.0, SPEED, 500.0))
    cell.until(lambda: cell.drive().velocity_offset == 9000)
    found = rescue_memory.found(memory, 0)
    frames = dict(found.frames)
    assert found.axes == (0,)
    assert frames[RPDO3] == bytes(6)
    assert struct.pack("<H", 2) in frames[0x201]
    assert found.frames[0][0] == RPDO3  # before the controlword


def test_a_scan_that_ends_by_an_error_sends_0(scenario: Stage) -> None:
    cell = made(scenario)
    cell.x.follow(TrapezoidalTrajectory(0.0, 180.0, SPEED, 500.0))
    cell.until(lambda: cell.drive().velocity_offset == 9000)
    cell.machine._core.scan.cycle.quick_stop_all()
    cell.run(0.1)
    drive = cell.drive()
    assert (drive.velocity_offset, drive.torque_offset) == (0, 0)
    assert cell.stage() != ENABLED


def opened(scenario: Stage, made: Device) -> Cell:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(canlink, "devices", lambda *_: {1: made})
        return scenario.real("x", axis="rated_torque = 10.0", more=TABLE)


def generic(scenario: Stage) -> Device:
    return device_from_eds(eds.load(resolve(GENERIC, scenario.folder)), 1)


def test_a_drive_that_refuses_every_mapping_is_refused_at_boot(scenario: Stage) -> None:
    made = generic(scenario)
    made.dials.fixed_mapping = 0x0601_0002
    with pytest.raises(BootError, match="its feed-forward cannot be sent by 60B1h") as caught:
        opened(scenario, made)
    assert "too late for the motion" in caught.value.observed


def test_a_drive_found_enabled_is_not_mapped_again_and_does_without(scenario: Stage) -> None:
    made = generic(scenario)
    made.power_on()
    made.drives[0].start_enabled(1)
    cell = opened(scenario, made)
    assert any("no feed-forward is sent" in warning for warning in cell.machine.reports[0].warnings)
    witness = Witness(cell.drive())
    cell.x.enable().wait(5)
    with pytest.raises(ArgumentError):
        cell.x.set_torque_offset(1.0)
    cell.run(0.5)
    assert witness.held
    assert not any(held.velocity_offset or held.torque_offset for held in witness.held)
