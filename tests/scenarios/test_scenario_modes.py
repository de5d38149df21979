"""Modes that the drive does not take, and cyclic modes whose conditions are not there: refused with the reason, nothing jumps."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus import eds
from axisbus.cia402.port import ValueTransport
from axisbus.eds.builtin import resolve
from axisbus.errors import DriveError, LimitError, ModeError, StateError
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.sim.build import device_from_eds
from kit.cell import GENERIC, SCALE
from kit.plant_probe import ENABLED, OFF, QUICK_STOP

PP, PV, HM, CSP = 1, 3, 6, 8  # values of 6060h (CiA 402-2 8.4.9)
HOLDING = (ENABLED,)


class Ramp:
    """A way of many seconds: it speeds up to 100 deg/s and continues."""

    duration = 60.0

    def position(self, t: float) -> float:
        return 50.0 * t * t if t < 1.0 else 50.0 + 100.0 * (t - 1.0)


def following(scenario, names: str = "x", **changes):
    """A cell whose axes follow a trajectory at 100 deg/s; return it with the handles."""
    cell = scenario.simulated(names, **changes).enabled()
    handles = [axis.follow(Ramp()) for axis in cell.machine]
    cell.run(1.5)
    for name in names:
        cell.must_move(name, 90.0)
    return cell, handles


APART = {"apart": ("position",)}  # the position has a TPDO of its own,
POSITION = frozenset({2})  # which may fail


def left_in_homing():
    """A drive in the mode in which a commissioning tool left it."""
    device = device_from_eds(eds.load(resolve(GENERIC, Path())), 1, seed=1)
    device.drive.mode = device.drive.mode_display = 6
    return {1: device}


# -- 6061h does not follow -----------------------------------------------------------------------------------------------


def test_no_resting_mode_at_enable_leaves_the_drive_off(scenario, golden):
    cell = scenario.simulated("x", devices=left_in_homing)
    cell.drive().dials.modes_refused = frozenset({1, 3, 4, 8, 9})
    failed = cell.failure_of(cell.x.enable())
    assert isinstance(failed, ModeError)
    golden("mode_refused_at_enable", failed)
    assert cell.stage() in OFF


def test_a_resting_mode_that_is_refused_is_replaced_by_the_next(scenario):
    cell = scenario.simulated("x", devices=left_in_homing)
    cell.drive().dials.modes_refused = frozenset({PP})
    cell.x.enable().wait(5)
    assert cell.drive().mode_display == CSP
    assert cell.stage() == ENABLED


@pytest.mark.parametrize(("what", "mode"), [("move_velocity", PV), ("home", HM), ("follow", CSP)])
def test_a_mode_refused_while_enabled_fails_the_command_and_the_axis_holds_its_position(
    scenario, golden, what, mode
):
    cell = scenario.simulated("x").enabled()
    cell.drive().dials.modes_refused = frozenset({mode})
    place = cell.where()
    asked = {
        "move_velocity": lambda: cell.x.move_velocity(50.0),
        "home": lambda: cell.x.home(),
        "follow": lambda: cell.x.follow(TrapezoidalTrajectory(0, 10, 10, 10)),
    }
    failed = cell.failure_of(asked[what]())
    assert isinstance(failed, ModeError)
    golden(f"mode_refused_{what}", failed)
    cell.run(0.5)
    assert cell.stage() == ENABLED
    assert abs(cell.where() - place) < 0.02
    assert cell.x.state is AxisState.ERRORSTOP


def test_a_refused_mode_does_not_stay_commanded(scenario):
    """A drive that takes it late, perhaps when its load hangs, would change under our feet."""
    cell = scenario.simulated("x").enabled()
    cell.drive().dials.modes_refused = frozenset({PV})
    cell.failure_of(cell.x.move_velocity(50.0))
    cell.drive().dials.modes_refused = frozenset()
    cell.run(0.5)
    assert cell.drive().mode_display == PP


@pytest.mark.nets("the stop sequence")
def test_a_mode_refused_in_mid_move_stops_the_axis(scenario, golden):
    cell = scenario.simulated("x")
    cell.travelling()
    cell.drive().dials.modes_refused = frozenset({PV})
    handle = cell.x.move_velocity(-50.0)
    cell.run(1.1)
    cell.must_be_still(within=1.0, stages=ENABLED)
    golden("mode_refused_in_mid_move", cell.failure_of(handle))


# -- conditions of the cyclic modes --------------------------------------------------------------------------------------


def test_csp_is_refused_if_the_drive_refuses_60c2(scenario, golden):
    cell = scenario.simulated("x").enabled()
    cell.device().dials.sdo_write_aborts[0x60C2, 1] = 0x0609_0030
    failed = cell.failure_of(cell.x.follow(Ramp()))
    assert isinstance(failed, DriveError)
    golden("csp_60c2_refused", failed)
    cell.must_be_still(within=0.5, stages=ENABLED)
    assert cell.drive().mode_display == PP


def test_csp_is_refused_if_60c2_reads_back_another_period(scenario, golden):
    cell = scenario.simulated("x").enabled()
    dictionary = cell.device().dictionary
    dictionary.on_write(0x60C2_01, lambda _: dictionary.values.__setitem__(0x60C2_01, 2))
    failed = cell.failure_of(cell.x.follow(Ramp()))
    assert isinstance(failed, DriveError)
    golden("csp_60c2_other", failed)
    cell.must_be_still(within=0.5, stages=ENABLED)


@pytest.mark.parametrize(
    ("name", "port"),
    [
        ("statusword", {"inputs": {"statusword": ValueTransport.EVENT_PDO}, "event_timer": 0.02}),
        ("position", {"inputs": {"position": ValueTransport.SDO}}),
        ("target", {"outputs": {"target_position": ValueTransport.SDO}}),
    ],
)
def test_csp_is_refused_if_its_values_are_not_sent_with_sync(scenario, golden, name, port):
    cell = scenario.simulated("x", port=port).enabled()
    failed = cell.failure_of(cell.x.follow(Ramp()))
    assert isinstance(failed, StateError)
    golden(f"csp_without_sync_{name}", failed)
    assert cell.x.state is AxisState.STANDSTILL


def test_a_trajectory_that_does_not_begin_at_the_present_position_is_refused(scenario, golden):
    cell = scenario.simulated("x").enabled()
    failed = cell.failure_of(cell.x.follow(TrapezoidalTrajectory(5.0, 10.0, 10.0, 10.0)))
    golden("csp_begins_elsewhere", failed)
    cell.run(0.3)
    assert abs(cell.where()) < 0.02


@pytest.mark.nets("the stop sequence")
def test_a_trajectory_that_becomes_too_fast_is_braked_along_its_path(scenario, golden):
    cell = scenario.simulated("x").enabled()

    class Faster:
        duration = 60.0

        def position(self, t: float) -> float:
            return 100.0 * t * t

    handle = cell.x.follow(Faster())
    cell.until(lambda: cell.where() > 400.0)  # at 2 s, when it is at the limit of 400 deg/s
    cell.must_be_still(within=1.5, stages=(ENABLED, *OFF))
    cell.must_have_moved("x", 400.0, (145.0, 175.0))  # along the path with 500 deg/s², the default, 160 deg
    golden("csp_too_fast", cell.failure_of(handle))


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_trajectory_beyond_the_limit_is_braked_to_standstill_within_it(scenario, golden, way):
    cell = scenario.simulated("x", axis="position_limits = [-90.0, 90.0]").enabled()

    class Onwards(Ramp):
        def position(self, t: float) -> float:
            return way * super().position(t)

    handle = cell.x.follow(Onwards())
    cell.until(lambda: way * cell.where() > 78.0)  # braking from 100 deg/s with 500 deg/s² takes 10 deg
    cell.must_be_still(within=1.0, stages=ENABLED)
    assert 85.0 < way * cell.where() < 90.01
    failed = cell.failure_of(handle)
    if way > 0:
        golden("csp_leaves_limits", failed)


def test_a_trajectory_that_is_known_to_leave_the_limits_is_refused_at_the_call(scenario, golden):
    cell = scenario.simulated("x", axis="position_limits = [-90.0, 90.0]").enabled()
    with pytest.raises(LimitError) as caught:
        cell.x.follow(TrapezoidalTrajectory(0.0, 91.0, 50.0, 500.0))
    golden("csp_known_to_leave_limits", caught.value)


# -- in mid-motion -------------------------------------------------------------------------------------------------------


@pytest.mark.nets("the stop sequence")
def test_csp_without_feedback_is_stopped(scenario, golden):
    cell, (handle, other) = following(scenario, "xy", port=APART)
    cell.device("x").dials.tpdos_stop = POSITION
    cell.must_be_still("x", within=1.5, stages=OFF)
    cell.must_be_still("y", within=1.5, stages=ENABLED)
    golden("csp_feedback_lost", cell.failure_of(handle))
    cell.failure_of(other)


@pytest.mark.nets("the stop sequence")
def test_a_turning_axis_that_sync_no_longer_reaches_is_stopped_by_sdo(scenario, golden):
    cell = scenario.simulated("x")
    cell.turning()
    cell.faults.sync_lost = True
    cell.must_be_still(within=1.5, stages=OFF)
    golden("sync_lost_turning", cell.x.error)
    assert "TREAT" not in str(cell.x.error)


def test_a_following_axis_that_sync_no_longer_reaches_stops_at_its_last_target(scenario, golden):
    cell, (handle,) = following(scenario)
    cell.faults.sync_lost = True
    cell.must_be_still(within=1.5, stages=OFF)
    golden("sync_lost_following", cell.failure_of(handle))


@pytest.mark.parametrize("hears_halt", [True, False], ids=["obeys halt", "ignores halt"])
@pytest.mark.nets("the stop sequence")
def test_a_halt_brakes_along_the_trajectory(scenario, hears_halt):
    cell, (handle,) = following(scenario)
    cell.drive().dials.halt_in_cyclic_modes = hears_halt
    start = cell.where()
    halt = cell.x.halt()
    cell.must_be_still(within=1.0, stages=ENABLED)
    halt.wait(1)
    # 100 deg/s with 500 deg/s² takes 10 deg; a target that stayed behind would have stopped it within one period.
    cell.must_have_moved("x", start, (8.0, 13.0))
    assert handle.aborted


@pytest.mark.nets("the stop sequence")
def test_a_halt_whose_feedback_stops_while_it_brakes_ends_in_the_halt_of_the_drive(scenario):
    cell, _ = following(scenario, port=APART)
    start = cell.where()
    halt = cell.x.halt()
    cell.run(0.05)
    cell.device().dials.tpdos_stop = POSITION  # and now the feedback goes, too
    cell.must_be_still(within=2.5, stages=(ENABLED, QUICK_STOP, *OFF))
    cell.must_have_moved("x", start, (8.0, 13.0))
    assert cell.scan_runs
    cell.end_of(halt)


def test_a_group_on_a_line_is_stopped_on_the_line_by_another_axis_fault(scenario):
    cell = scenario.simulated("xyz").enabled()
    line = cell.machine.group("x", "y").move_linear((600.0, 300.0), velocity=150.0)
    cell.run(1.0)
    cell.drive("z").fault(0x2310)
    cell.must_be_still("x", within=1.0, stages=ENABLED)
    cell.must_be_still("y", within=1.0, stages=ENABLED)
    assert abs(cell.where("x") - 2.0 * cell.where("y")) < 3 / SCALE
    assert line.aborted
