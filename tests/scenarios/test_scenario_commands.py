"""Commands that meet other commands or the wrong state: which takes over, which is refused, and the message."""

from __future__ import annotations

import logging

import pytest

from axisbus import wait
from axisbus.errors import AxisbusError, MotionTimeout, Replaced, StateError, TransitionError
from axisbus.motion.command_status import Status
from axisbus.motion.states import AxisState
from axisbus.sim.fault_injection import NEVER
from kit.plant_probe import ENABLED, OFF, SWITCH_ON_DISABLED


def test_a_second_move_aborts_the_first_and_the_axis_continues_to_the_new_target(scenario, golden):
    cell = scenario.simulated("x").enabled()
    first = cell.x.move_absolute(100.0)
    cell.run(0.5)
    second = cell.x.move_absolute(-20.0)
    replaced = cell.failure_of(first)
    assert isinstance(replaced, Replaced)
    assert first.aborted
    golden("replaced", replaced)
    second.wait(10)
    cell.run(0.3)
    assert abs(cell.where() + 20.0) < 0.02


def test_a_move_may_interrupt_a_halt(scenario):
    cell = scenario.simulated("x")
    cell.travelling()
    halt = cell.x.halt()
    cell.run(0.05)
    move = cell.x.move_absolute(10.0)
    assert isinstance(cell.failure_of(halt), Replaced)
    move.wait(10)
    cell.run(0.3)
    assert abs(cell.where() - 10.0) < 0.02


@pytest.mark.nets("the stop sequence")
def test_a_stop_locks_until_it_is_released(scenario, golden):
    cell = scenario.simulated("x")
    cell.travelling()
    stop = cell.x.stop()
    golden("move_while_stopping", cell.failure_of(cell.x.move_absolute(0.0)))
    cell.must_be_still(within=1.0, stages=ENABLED)
    stop.wait(1)
    golden("move_while_stopped", cell.failure_of(cell.x.move_absolute(0.0)))
    cell.x.halt().wait(1)  # a halt does not unlock it
    cell.x.enable().wait(1)  # nor does enabling
    assert isinstance(cell.failure_of(cell.x.move_absolute(0.0)), StateError)
    cell.x.release().wait(1)
    cell.x.move_relative(1.0).wait(3)


def test_a_release_before_standstill_is_refused(scenario, golden):
    cell = scenario.simulated("x")
    cell.travelling()
    cell.x.stop()
    golden("release_too_early", cell.failure_of(cell.x.release()))


@pytest.mark.nets("the stop sequence")
def test_a_disable_cannot_be_undone_by_a_move(scenario, golden):
    cell = scenario.simulated("x")
    cell.travelling()
    cell.x.disable()
    golden("move_while_disabling", cell.failure_of(cell.x.move_velocity(50.0)))
    cell.must_be_still(within=1.0, stages=OFF)


@pytest.mark.nets("the stop sequence")
@pytest.mark.parametrize("off", ["disable", "quick_stop"])
def test_an_additive_move_of_an_axis_that_was_turned_by_hand_starts_from_its_actual_position(scenario, off):
    cell = scenario.simulated("x").enabled()
    assert cell.end_of(cell.x.move_absolute(30.0)) is None
    assert cell.end_of(getattr(cell.x, off)()) is None
    cell.must_be(SWITCH_ON_DISABLED)
    cell.drive().axis.motor.position += 100.0 * cell.scale_of("x")
    cell.run(0.2)
    cell.x.release()
    cell.run(0.1)
    assert cell.end_of(cell.x.enable()) is None
    assert cell.end_of(cell.x.move_additive(5.0)) is None
    assert cell.where("x") == pytest.approx(135.0, abs=0.3)


def test_a_stop_that_is_repeated_gets_no_more_time(scenario):
    """An operator or a loop that repeats the command must not restart the stop sequence each time."""
    cell = scenario.simulated("x", stop='halt_time = "500ms"')
    cell.travelling()
    cell.drive().dials.ignore_halt = True
    for _ in range(15):
        cell.x.stop()
        cell.run(0.1)
    cell.must_be_still(within=0.5, stages=OFF)


def test_a_halt_that_has_become_a_quick_stop_is_not_interrupted_by_a_new_move(scenario):
    """The drive is in quick stop active by then: the move would end with the error that it left operation enabled."""
    cell = scenario.simulated("x", stop='halt_time = "300ms"')
    cell.travelling()
    cell.drive().dials.ignore_halt = True
    halt = cell.x.halt()
    cell.run(0.2)
    assert not halt.done
    cell.run(0.12)
    cell.must_move()
    refused = cell.failure_of(cell.x.move_relative(5.0))
    assert "x is being stopped" in refused.message
    assert "stop sequence: halt > quick stop" in refused.observed
    cell.must_be_still(within=0.5, stages=OFF)
    assert "the axis stopped only by a harder stop" in str(cell.failure_of(halt))


def test_commands_in_the_wrong_state_name_the_command_that_must_be_first(scenario, golden):
    cell = scenario.simulated("x")
    cell.run(0.1)
    golden("move_while_disabled", cell.failure_of(cell.x.move_absolute(1.0)))
    golden("home_while_disabled", cell.failure_of(cell.x.home()))
    cell.x.enable().wait(3)
    cell.x.move_velocity(50.0).wait(3)
    golden("home_while_moving", cell.failure_of(cell.x.home()))
    golden("set_position_while_moving", cell.failure_of(cell.x.set_position(0.0)))
    cell.must_move(faster_than=45.0)  # none of them has disturbed the motion


def test_commands_that_are_repeated_are_harmless(scenario):
    cell = scenario.simulated("x").enabled()
    for _ in range(2):
        cell.x.enable().wait(1)
        cell.x.halt().wait(1)
        cell.x.reset().wait(1)
    for _ in range(2):
        cell.x.disable().wait(3)
        cell.x.quick_stop().wait(1)
        cell.x.stop().wait(1)
        cell.x.release().wait(1)
    assert cell.stage() == SWITCH_ON_DISABLED
    cell.x.enable().wait(3)
    assert cell.stage() == ENABLED


def test_a_drive_that_does_not_switch_on_reports_why(scenario, golden):
    cell = scenario.simulated("x")
    cell.drive().dials.no_voltage = True
    cell.run(0.1)
    failed = cell.failure_of(cell.x.enable())
    assert isinstance(failed, TransitionError)
    assert isinstance(failed, TimeoutError)
    golden("enable_no_voltage", failed)


def test_a_drive_under_local_control_reports_so(scenario, golden):
    cell = scenario.simulated("x")
    cell.drive().dials.local_control = True
    cell.run(0.1)
    golden("enable_local_control", cell.failure_of(cell.x.enable()))


def test_a_drive_that_hangs_on_a_transition_is_reported_by_its_path(scenario, golden):
    cell = scenario.simulated("x")
    cell.drive().dials.transition_delay = {4: NEVER}
    golden("enable_hangs", cell.failure_of(cell.x.enable()))
    cell.run(0.5)
    assert cell.stage() in OFF


@pytest.mark.nets("the stop sequence")
def test_a_drive_that_loses_its_power_stops_the_others_and_is_not_enabled_again(scenario, golden):
    cell = scenario.simulated("xy")
    handles = cell.travelling()
    cell.drive("x").power.force(9)  # safe torque off, for one
    cell.must_be_still("y", within=1.0, stages=ENABLED)
    cell.must_be_still("x", within=8.0, stages=OFF)  # it coasts
    golden("power_dropped", cell.failure_of(handles[0]))


def test_a_blocked_axis_without_a_following_error_window_ends_by_its_deadline(scenario, golden):
    cell = scenario.simulated("x", axis="following_error = 1000.0").enabled()
    cell.device().write(0x6065, 0, 0)  # no following-error window: the drive itself pushes on
    cell.drive().dials.blocked = True
    late = cell.failure_of(cell.x.move_relative(20.0))
    assert isinstance(late, MotionTimeout)
    golden("blocked", late)
    assert cell.x.state is AxisState.ERRORSTOP


@pytest.mark.nets("the stop sequence")
def test_a_jog_that_is_not_renewed_halts(scenario):
    cell = scenario.simulated("x").enabled()
    for _ in range(10):
        cell.x.jog(50.0).wait(1)
        cell.run(0.1)
    cell.must_move(faster_than=45.0)
    cell.must_be_still(within=0.5, stages=ENABLED)


def test_several_failures_are_raised_together(scenario):
    cell = scenario.simulated("xy").enabled()
    handles = [axis.move_relative(1000.0) for axis in cell.machine]
    cell.run(0.3)
    cell.drive("x").fault(0x2310)
    with pytest.raises(ExceptionGroup) as caught:
        wait(handles)
    assert [type(error).__name__ for error in caught.value.exceptions] == ["DriveFault", "Stopped"]
    assert "x:" in str(caught.value.exceptions[0])


def test_a_failed_handle_that_the_program_dropped_is_logged_by_name(scenario, golden, caplog):
    cell = scenario.simulated("x")
    cell.travelling()  # its handle is dropped here
    with caplog.at_level(logging.ERROR, "axisbus"):
        cell.drive().fault(0x2310)
        cell.run(0.5)
    (record,) = caplog.records
    golden("handle_dropped", AxisbusError(record.getMessage()))


def test_a_wait_that_runs_out_leaves_the_motion_alone(scenario):
    cell = scenario.simulated("x").enabled()
    handle = cell.x.move_relative(500.0)
    with pytest.raises(
        TimeoutError, match=r"x.move_relative\(500 deg\): not ended after 0.5 s; it continues"
    ):
        handle.wait(0.5)
    assert handle.status is Status.ACTIVE
    cell.must_move()
    assert cell.x.state is AxisState.DISCRETE_MOTION
