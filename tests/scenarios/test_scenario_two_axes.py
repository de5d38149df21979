"""A drive of two axes: one node, one NMT state, one emergency object, two motors."""

from __future__ import annotations

import pytest

from axisbus.errors import DriveFault, Stopped
from kit.plant_probe import ENABLED, OFF, SWITCH_ON_DISABLED
from kit.scenarios.simulated_bus import Line
from kit.two_axis_drive import two_axis_cell


def cell_of(scenario):
    return scenario.simulated("xy", text=two_axis_cell(scenario.folder))


def test_both_axes_move_each_by_its_own_objects(scenario):
    cell = cell_of(scenario).enabled()
    assert [len(cell.machine), len(cell.wire.nodes)] == [2, 1]
    cell["x"].move_absolute(30.0).wait(5)
    cell.run(0.3)
    assert abs(cell.where("x") - 30.0) < 0.02
    assert abs(cell.where("y")) < 0.02
    cell["y"].home().wait(5)
    cell["y"].move_absolute(-20.0).wait(5)
    cell.run(0.3)
    assert abs(cell.where("x") - 30.0) < 0.02
    assert abs(cell.where("y") + 20.0) < 0.02
    cell["x"].disable().wait(5)
    assert cell.stage("x") == SWITCH_ON_DISABLED
    assert cell.stage("y") == ENABLED


@pytest.mark.nets("the stop sequence")
def test_a_fault_of_one_axis_stops_the_other(scenario, golden):
    cell = cell_of(scenario)
    lost, other = cell.travelling()
    cell.drive("x").fault(0x2310)
    cell.must_be_still("x", within=1.0, stages=OFF)
    cell.must_be_still("y", within=1.0, stages=ENABLED)
    assert isinstance(cell.failure_of(lost), DriveFault)
    assert isinstance(cell.failure_of(other), Stopped)
    golden("two_axes_fault", cell.failure_of(lost), cell.failure_of(other))


@pytest.mark.nets("the stop sequence")
def test_closing_stops_both_axes_before_the_watch_of_their_node_ends(scenario):
    """The first of them is at standstill at once; the second still brakes, and both share the NMT state of the node."""
    cell = cell_of(scenario)
    cell.enabled()
    cell["y"].move_velocity(90.0, deceleration=60.0).wait(5)
    cell.must_move("y")
    cell.machine.close()
    for name in "xy":
        cell.must_be_still(name, within=0.01, stages=SWITCH_ON_DISABLED)
    cell.run(2.0)
    assert cell.device("x").errors.register == 0


@pytest.mark.nets("the stop sequence", "the drive's watchdog")
def test_a_lost_node_is_lost_for_both_axes(scenario, golden):
    cell = cell_of(scenario)
    handles = cell.travelling()
    cell.device("x").dials.dead = True
    for name in "xy":
        cell.must_be_still(name, within=1.0, stages=OFF)  # by the drive's own watchdog
    golden("two_axes_lost", *map(cell.failure_of, handles))


def test_both_axes_move_and_stop_over_a_bus(tmp_path):
    two_axis_cell(tmp_path)  # its EDS, from which the line makes the device
    with Line(tmp_path, "x", eds="two.eds") as line:
        text = two_axis_cell(tmp_path, interface="virtual", channel=line.channel)
        line.file.write_text(text, encoding="utf-8")
        device = line.devices["x"]
        with line.open() as machine:
            for axis in machine:
                axis.enable().wait(10)
            machine["x"].move_absolute(12.0).wait(10)
            machine["y"].move_absolute(-8.0).wait(10)
            machine.sleep(0.5)
            for drive, target in zip(device.drives, (1200, -800), strict=True):
                assert abs(drive.axis.motor.position - target) < 5
            machine["y"].move_velocity(90.0).wait(10)
        assert [int(drive.power.stage) for drive in device.drives] == [SWITCH_ON_DISABLED] * 2
        assert [drive.axis.motor.velocity for drive in device.drives] == [0, 0]
