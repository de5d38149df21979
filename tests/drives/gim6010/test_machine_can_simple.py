"""A machine with a module that speaks CAN Simple, in virtual time: it moves with others, is recorded, faults, and is left off."""

from __future__ import annotations

import json
from contextlib import suppress
from pathlib import Path

import pytest

from axisbus import Machine, wait
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.drives.gim6010.core import part
from axisbus.drives.gim6010.sim.module import Module
from axisbus.errors import AxisbusError, DriveError, StateError
from axisbus.motion.states import AxisState
from axisbus.record.load import load
from axisbus.testing import simulate
from kit.can_simple.mixed_cell import MODULE, write

SIM = 'interface = "sim"'


@pytest.fixture
def cell(tmp_path):
    with Machine.simulated(write(tmp_path, SIM)) as machine:
        yield machine


@pytest.fixture
def module(cell):
    return cell.simulated_node(MODULE).module


def up(cell) -> None:
    wait([axis.enable() for axis in cell])
    wait([axis.home() for axis in cell])


def test_opening_a_machine_leaves_the_module_without_power_and_reports_its_firmware(cell, module):
    report = next(report for report in cell.reports if report.node_id == MODULE)
    assert "firmware 0.5.13, by its endpoints" in report.text()
    assert [axis.state for axis in cell] == [AxisState.DISABLED] * 3
    cell.sleep(0.5)
    assert not module.energised
    assert cell.node(MODULE).events == []
    assert cell.node(MODULE).nmt is NmtState.OPERATIONAL


def test_missing_heartbeats_are_events_of_the_node_and_of_a_recording(tmp_path, cell, module):
    pytest.importorskip("mcap.reader")
    assert cell.node(MODULE).pdo_events == ()
    with cell.recording(tmp_path / "run.mcap"):
        module.dials.heartbeat_stops = True
        cell.sleep(0.1)
        module.dials.heartbeat_stops = False
        cell.sleep(0.3)
    (event,) = cell.node(MODULE).pdo_events
    assert "Heartbeat" in str(event)
    assert "comes again after" in str(event)
    assert [one.text for one in load(tmp_path / "run.mcap").events if one.sort == "pdo"] == [str(event)]
    assert cell.node(MODULE).events == []


def test_a_line_of_all_is_recorded_with_its_fault_and_its_reset(tmp_path, cell, module):
    pytest.importorskip("mcap.reader")
    up(cell)
    with cell.recording(tmp_path / "run.mcap"):
        cell.group("all").move_linear((40.0, -20.0, 60.0), velocity=60.0).wait()
        assert module.position * 45.0 == pytest.approx(60.0, abs=0.1)
        handle = cell["m"].move_absolute(500.0)
        cell.sleep(0.5)
        cell.simulated_node(MODULE).fault(0x20000)
        with pytest.raises(DriveError, match="MOTOR_THERMISTOR_OVER_TEMP"):
            handle.wait()
        module.dials.motor_error = 0
        cell["m"].reset().wait()
    run = load(tmp_path / "run.mcap")
    track = run.tracks["m"]
    assert track.units["position"] == "deg"
    assert track.columns["position"][0] == pytest.approx(0.0, abs=0.01)
    assert max(track.columns["position"]) > 61.0
    assert "ErrorStop" in track.columns["state"]
    emcys = [one for one in run.events if one.sort == "emcy"]
    assert {one.where for one in emcys} == {f"node {MODULE}"}
    assert (
        "0x7122" in emcys[0].text
    )  # MOTOR_FAILED, which the heartbeat's word has; its bits were asked for then
    assert "is over" in emcys[-1].text


def test_an_object_of_it_cannot_be_recorded(tmp_path, cell):
    with pytest.raises(StateError, match="uses CAN Simple"):
        cell.recording(tmp_path / "run.mcap", objects=["m:6081"])


def test_a_can_simple_module_accepts_no_nmt_command_and_has_no_objects(cell):
    node = cell.node(MODULE)
    with pytest.raises(StateError, match="does not accept stop"):
        node.command(NmtCommand.STOP)
    for look in (lambda: node.sdo[0x6041], lambda: node.measure("voltage"), lambda: node.canopen):
        with pytest.raises(StateError, match=r"no object dictionary|not a node of CANopen"):
            look()
    assert node.error_history() is None


@pytest.mark.parametrize("axis", ["x", "m"])
def test_the_fault_of_one_stops_the_others_by_the_policy_of_their_group(cell, module, axis):
    up(cell)
    handle = cell.group("all").move_linear((400.0, -200.0, 300.0), velocity=60.0)
    cell.sleep(1.0)
    assert abs(module.shaft.speed) > 0.2
    if axis == "m":
        cell.simulated_node(MODULE).fault(0x20000)
    else:
        cell.simulated_node(40).fault(0x4310)
    cell.sleep(1.0)
    with pytest.raises((AxisbusError, ExceptionGroup)):
        handle.wait()
    for node in (40, 41):
        assert cell.simulated_node(node).drive().axis.motor.velocity == pytest.approx(0.0, abs=50.0)
    assert module.shaft.speed == pytest.approx(0.0, abs=0.02)
    assert module.energised is (axis == "x")  # a module in fault has switched its power off


def test_a_module_that_restarts_has_to_be_opened_again(cell, module):
    up(cell)
    cell["m"].move_velocity(90.0).wait()
    module.restart()
    cell.sleep(3.0)
    assert cell["m"].state is AxisState.ERRORSTOP
    assert any("has restarted" in str(event) for event in cell.node(MODULE).events)
    with pytest.raises(AxisbusError):
        cell["m"].enable().wait()
    assert not module.energised


@pytest.mark.parametrize("stop", ['quick_stop = "ramp"', 'quick_stop = "ramp-hold"'])
def test_closing_in_motion_leaves_it_at_standstill_and_off(tmp_path, stop):
    with Machine.simulated(write(tmp_path, SIM, stop)) as cell:
        module = cell.simulated_node(MODULE).module
        up(cell)
        cell["m"].move_velocity(90.0).wait()
        assert module.shaft.speed == pytest.approx(2.0, rel=0.05)
    assert abs(module.shaft.speed) < 0.02
    assert not module.energised


def _begins(monkeypatch, begin) -> None:
    """Let the simulated module of the next cell begin otherwise."""
    made = part._module

    def changed(cell, node_id):
        module = made(cell, node_id)
        begin(module)
        return module

    monkeypatch.setattr(part, "_module", changed)


def test_a_module_found_enabled_stays_enabled_until_the_axis_is_enabled(tmp_path, monkeypatch):
    _begins(monkeypatch, lambda module: module.axis.request(8))
    path = write(tmp_path, SIM)
    with Machine.simulated(path) as cell:
        module = cell.simulated_node(MODULE).module
        cell.sleep(1.0)
        assert module.energised
    assert module.energised  # it was not commanded
    with Machine.simulated(path) as cell:
        module = cell.simulated_node(MODULE).module
        here = module.position
        cell["m"].enable().wait()
        cell.sleep(0.5)
        assert module.position == pytest.approx(here, abs=1e-3)
        cell["m"].move_relative(45.0).wait()
        assert module.position == pytest.approx(here + 1.0, abs=0.01)
    assert not module.energised


def test_a_missing_module_is_reported_and_nothing_is_opened(tmp_path, monkeypatch):
    _begins(monkeypatch, lambda module: setattr(module.dials, "dead", True))
    with pytest.raises(AxisbusError, match="module 16 does not answer"):
        Machine.simulated(write(tmp_path, SIM))


# -- an armed break_timeout


def _listed(folder: Path, **own) -> Path:
    """Write the cell with the list of endpoints of its module's firmware."""
    (folder / "endpoints_0.5.13.json").write_text(json.dumps(Module(MODULE, **own).json()))
    path = write(folder, SIM)
    path.write_text(path.read_text().replace("[axes.m]", 'endpoints = "endpoints_0.5.13.json"\n[axes.m]', 1))
    return path


def _armed(module: Module) -> None:
    module.parameters["can.config.break_timeout"] = 300


def test_an_axis_that_holds_its_position_does_not_trip_an_armed_break_timeout(tmp_path, monkeypatch):
    _begins(monkeypatch, _armed)
    with Machine.simulated(_listed(tmp_path)) as cell:
        module, m = cell.simulated_node(MODULE).module, cell["m"]
        cell.sleep(1.0)  # before the first command nothing is sent: it has tripped
        m.reset().wait()
        cell.sleep(2.0)
        m.enable().wait()
        cell.sleep(20.0)
        assert module.energised
        m.move_relative(45.0).wait()
        cell.sleep(20.0)
        assert module.energised
        assert m.error is None
        m.disable().wait()
        cell.sleep(5.0)
        m.enable().wait()
        assert module.energised


@pytest.mark.parametrize("turns", [False, True])
def test_when_the_core_sends_nothing_any_more_the_break_timeout_takes_the_power_away(
    tmp_path, monkeypatch, turns
):
    _begins(monkeypatch, _armed)
    cell = Machine.simulated(_listed(tmp_path))
    try:
        module, m = cell.simulated_node(MODULE).module, cell["m"]
        cell.sleep(1.0)
        m.reset().wait()
        m.enable().wait()
        if turns:
            m.move_velocity(90.0).wait()
        cell.sleep(2.0)
        assert module.energised
        dead = module._now
        module.step(dead + 0.2)
        assert module.energised
        module.step(dead + 0.31)
        assert not module.energised
        assert module.axis.error == 0x00100000  # CAN_BUS_FAILED
    finally:
        with suppress(AxisbusError):  # its axis is in fault
            cell.close()


def test_a_break_timeout_that_was_not_read_is_not_fed_and_reported(tmp_path, monkeypatch):
    def silent(module):
        _armed(module)
        module.dials.endpoints = False

    _begins(monkeypatch, silent)
    with Machine.simulated(_listed(tmp_path)) as cell:
        report = next(report for report in cell.reports if report.node_id == MODULE)
        assert "does not feed a time-out that it has not read" in report.text()
        cell.sleep(1.0)
        with suppress(AxisbusError):
            cell["m"].reset().wait()
        cell.sleep(1.0)
        with pytest.raises(AxisbusError):
            cell["m"].enable().wait()
        assert not cell.simulated_node(MODULE).module.energised


def test_a_module_with_can_simple_has_no_drive_of_cia_402(tmp_path: Path) -> None:
    with simulate(write(tmp_path, 'interface = "sim"')) as simulation:
        module = next(name for name, axis in simulation.machine.cell.axes.items() if axis.node == MODULE)
        for refused in (simulation.drive, simulation.device, simulation.position):
            with pytest.raises(StateError, match=r"use \.module"):
                refused(module)
