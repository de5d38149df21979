"""Drives of ten makes with their deviations from CiA 402, as a user has them: with the keys of the cell file that each make needs.

The drives are simulated (kit/makes.py). Each scenario is judged by the motor, its power and the texts of the errors.
"""

from __future__ import annotations

import pytest

from axisbus.errors import DriveError, FollowingError, LimitError, ModeError, SetPointError
from kit.cell import Cell, Stage, cell_text
from kit.makes import MAKES, SYNC_LOST, Make
from kit.plant_probe import ENABLED, OFF

each_make = pytest.mark.parametrize("name", MAKES)


def opened(scenario: Stage, make: Make, names: str = "x", axis: str | None = None, more: str = "") -> Cell:
    """A cell with a drive of a make for each letter of ``names``; ``axis``: lines instead of those that the make needs."""
    (scenario.folder / "make.eds").write_text(make.eds_text(), encoding="utf-8")
    text = cell_text(names, eds="make.eds", axis=make.axis if axis is None else axis)
    text += "".join(make.node.format(node=node) for node in range(1, len(names) + 1)) + more
    return scenario.simulated(names, text=text, devices=lambda: make.devices(len(names)))


def having(command: str):
    return pytest.mark.parametrize("name", [name for name, make in MAKES.items() if command in make.commands])


# -- a day with a drive ------------------------------------------------------------------------------------------------------


@each_make
def test_it_is_enabled_and_disabled_again_and_again_without_a_motion(scenario, name):
    cell = opened(scenario, MAKES[name])
    for _ in range(3):
        cell.x.enable().wait(5)
        cell.must_be_still(within=0.1, stages=ENABLED, for_good=0.3)
        cell.x.disable().wait(5)
        cell.must_be_still(within=0.1, stages=OFF, for_good=0.3)
    assert cell.farthest() == (0.0, 0.0)


@having("pp")
def test_it_moves_to_positions(scenario, name):
    cell = opened(scenario, MAKES[name]).enabled()
    for command, goal in (
        (lambda: cell.x.move_absolute(150.0), 150.0),
        (lambda: cell.x.move_relative(-40.0), 110.0),
        (lambda: cell.x.move_absolute(110.0), 110.0),
    ):
        command().wait(10)
        cell.must_be_still(within=0.1, stages=ENABLED, for_good=0.3)
        assert cell.where() == pytest.approx(goal, abs=0.02)
    assert cell.top_speed() == pytest.approx(100.0, rel=0.03)  # the default velocity
    low, high = cell.farthest()
    assert low > -0.1
    assert high < 150.1


@having("pp")
def test_a_move_is_replaced_by_another_and_halted(scenario, name):
    cell = opened(scenario, MAKES[name]).enabled()
    cell.x.move_absolute(400.0)
    cell.run(1.0)
    cell.x.move_absolute(-20.0).wait(10)
    cell.must_be_still(within=0.1, stages=ENABLED, for_good=0.3)
    assert cell.where() == pytest.approx(-20.0, abs=0.02)
    cell.x.move_absolute(400.0)
    cell.run(1.0)
    start = cell.where()
    cell.x.halt().wait(5)
    cell.must_be_still(within=0.1, stages=ENABLED)
    cell.must_have_moved("x", start, (8.0, 14.0))  # 10 deg with 500 deg/s²
    cell.x.move_absolute(0.0).wait(10)
    assert cell.where() == pytest.approx(0.0, abs=0.02)


@having("pv")
def test_it_moves_at_a_velocity_and_halts(scenario, name):
    cell = opened(scenario, MAKES[name]).enabled()
    for velocity in (80.0, -30.0):
        cell.x.move_velocity(velocity).wait(5)
        start = cell.where()
        cell.run(1.0)
        assert cell.where() - start == pytest.approx(velocity, rel=0.03)
    cell.x.halt().wait(5)
    cell.must_be_still(within=0.1, stages=ENABLED)


@having("hm")
def test_it_is_homed_in_place_and_used_in_another_mode(scenario, name):
    make = MAKES[name]
    cell = opened(scenario, make).enabled()
    cell.x.home().wait(5)
    assert cell.x.homed
    line = cell.machine.group("x").move_linear((25.0,), velocity=50.0)
    line.wait(5)
    assert cell.where() == pytest.approx(25.0, abs=0.02)


@having("csp")
def test_two_of_them_move_on_a_line_and_halt_on_it(scenario, name):
    cell = opened(scenario, MAKES[name], "xy").enabled()
    group = cell.machine.group("x", "y")
    group.move_linear((60.0, 30.0), velocity=60.0).wait(5)
    group.move_linear((600.0, 300.0), velocity=60.0)
    cell.run(1.0)
    cell.must_move("x")
    group.halt().wait(5)
    for axis in "xy":
        cell.must_be_still(axis, within=0.2, stages=ENABLED, for_good=0.3)
    assert cell.where("x") == pytest.approx(2.0 * cell.where("y"), abs=0.05)
    assert 60.0 < cell.where("x") < 140.0


@each_make
def test_it_stops_quickly_and_is_enabled_again(scenario, name):
    cell = opened(scenario, MAKES[name]).enabled()
    cell.machine.group("x").move_linear((600.0,), velocity=60.0)
    cell.run(1.0)
    cell.must_move("x")
    cell.x.quick_stop().wait(5)
    cell.must_be_still(within=0.1, stages=OFF)
    cell.x.enable().wait(5)
    cell.must_be_still(within=0.1, stages=ENABLED)


@each_make
def test_its_fault_is_reset_and_it_moves_again(scenario, name):
    cell = opened(scenario, MAKES[name]).enabled()
    cell.drive().fault(0x2310)
    cell.run(0.3)
    cell.must_be_still(within=0.1, stages=7)
    assert isinstance(cell.x.error, DriveError)
    assert "2310" in cell.x.error.observed
    cell.x.reset().wait(5)
    cell.must_be_still(within=0.1, stages=OFF)
    cell.x.enable().wait(5)
    cell.machine.group("x").move_linear((20.0,), velocity=50.0).wait(5)
    assert cell.where() == pytest.approx(20.0, abs=0.02)


@each_make
def test_after_a_power_cycle_it_is_booted_and_enabled(scenario, name):
    cell = opened(scenario, MAKES[name]).enabled()
    cell.device().dials.unpowered = True
    cell.run(1.0)
    cell.device().dials.unpowered = False
    cell.run(0.5)
    cell.machine.node(1).boot()
    cell.x.reset().wait(5)
    cell.must_be_still(within=0.1, stages=OFF)
    cell.x.enable().wait(5)
    cell.machine.group("x").move_linear((20.0,), velocity=50.0).wait(5)
    assert cell.where() == pytest.approx(20.0, abs=0.02)


# -- what the errors say without the keys ------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", ["ZeroErr eRob", "Applied Motion ST", "acknowledge at enable"])
def test_without_its_key_the_error_of_a_move_names_it(scenario, name):
    cell = opened(scenario, MAKES[name], axis="").enabled()
    failed = cell.failure_of(cell.x.move_absolute(300.0))
    assert isinstance(failed, SetPointError)
    assert 'handshake = "on-change" in [axes.x]' in failed.remedy
    cell.must_be_still(within=1.0, stages=ENABLED)


def test_a_drive_with_a_velocity_unit_of_its_own_is_too_slow_and_stopped(scenario):
    """300 deg/s are 18 deg/s for this drive."""
    cell = opened(scenario, MAKES["Kinco FD5"], axis="").enabled()
    cell.x.move_velocity(300.0)
    cell.until(lambda: cell.x.error is not None)
    cell.must_be_still(within=2.0, stages=(ENABLED, *OFF))
    assert isinstance(cell.x.error, FollowingError)
    assert cell.where() < 40.0


def test_a_drive_whose_60ffh_has_another_unit_than_6081h_is_stopped_in_pv(scenario):
    """No key gives the two objects different units: such a drive is used without pv."""
    cell = opened(scenario, MAKES["Delta ASDA-A2"], axis="").enabled()
    cell.x.move_absolute(50.0).wait(5)
    failed = cell.failure_of(cell.x.move_velocity(30.0))
    cell.must_be_still(within=2.0, stages=(ENABLED, *OFF))
    assert isinstance(failed, LimitError)
    assert "velocity_scale" in failed.remedy
    assert cell.where() < 200.0


def test_a_mode_that_is_changed_only_without_power_is_refused_and_the_axis_holds_its_position(scenario):
    cell = opened(scenario, MAKES["Schunk LWA"], axis="").enabled()
    failed = cell.failure_of(cell.x.home())
    assert isinstance(failed, ModeError)
    assert not cell.x.homed
    cell.must_be_still(within=0.1, stages=ENABLED)


# -- 1006h -------------------------------------------------------------------------------------------------------------------


def test_boot_reports_a_cycle_period_that_is_not_that_of_the_scan_and_its_remedy_works(scenario):
    make = MAKES["Delta ASDA-A2"]
    other = '[nodes.1.objects]\n"1006" = 4000\n'
    cell = opened(scenario, make, more=other)
    (warning,) = [each for each in cell.machine.reports[0].warnings if "1006h" in each]
    assert "is 4000 µs, and SYNC comes every 10000 µs" in warning
    assert 'write "1006" = 10000 in [nodes.1.objects]' in warning
    failed = cell.failure_of(cell.enabled().machine.group("x").move_linear((30.0,), velocity=50.0))
    assert isinstance(failed, DriveError)
    assert f"{SYNC_LOST:X}" in failed.observed
    cell = opened(scenario, make, more=other.replace("4000", "10000"))
    assert not [each for each in cell.machine.reports[0].warnings if "1006h" in each]
    cell.enabled().machine.group("x").move_linear((30.0,), velocity=50.0).wait(5)
    assert cell.where() == pytest.approx(30.0, abs=0.02)
