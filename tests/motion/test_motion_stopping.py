"""Halt, stop with its lock, quick stop: the behaviour of the drive, the state of the axis afterwards, and the next commands."""

from __future__ import annotations

from dataclasses import replace

import pytest

from axisbus.cia402.options import Ramp
from axisbus.cia402.state import PowerState
from axisbus.errors import DriveError, Replaced, StateError, Stopped, UncommandedMotion
from axisbus.motion.parameters import AxisLimits, HoldsLoad, StopTimes
from axisbus.motion.states import AxisState
from axisbus.motion.stop_deceleration import Braking
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.sim.motor import MotorParams
from kit.motion.plant_recorder import DISABLED, ENABLED, HALT, QUICK_STOP, Watch
from kit.motion.rig import PERIOD, rig


def turning(**options):
    """A rig whose axis turns at 100 deg/s."""
    r = rig(**options).enabled()
    r.axis.move_velocity(100.0).wait(3)
    return r


def at_standstill(r) -> bool:
    return abs(r.drive.axis.motor.velocity) < 1.0


# Halt.


def test_halt_brakes_on_the_profile_s_deceleration_to_standstill_and_keeps_the_power():
    r = turning()
    watch = Watch(r)
    start = r.now
    r.axis.halt().wait(3)
    # 100 / 500 = 0.2 s, and 50 ms until standing is certain
    assert r.now - start == pytest.approx(0.25, abs=0.06)
    assert watch.acceleration() <= 500_000 * 1.05
    assert watch.transitions == []
    assert watch.words == [0x0F | HALT]
    assert r.axis.state is AxisState.STANDSTILL
    r.run(2.0)
    assert watch.words == [0x0F | HALT]  # it stays halted until something new is wanted
    assert at_standstill(r)


def test_halt_repeated_is_harmless_and_all_handles_end():
    r = turning()
    handles = [r.axis.halt() for _ in range(3)]
    r.run(0.1)
    handles.append(r.axis.halt())
    for handle in handles:
        handle.wait(3)
    again = r.axis.halt()
    again.wait(1)
    assert r.axis.state is AxisState.STANDSTILL
    assert r.axis.error is None


def test_a_new_motion_may_interrupt_a_halt():
    r = turning()
    halt = r.axis.halt()
    r.run(0.05)
    r.axis.move_velocity(60.0).wait(3)
    with pytest.raises(Replaced, match="halt"):
        halt.wait()
    assert r.drive.axis.motor.velocity == pytest.approx(60_000, rel=0.01)


@pytest.mark.parametrize("how", ["halt", "stop", "quick_stop"])
def test_without_a_driven_motor_a_stop_succeeds_at_once(how):
    r = rig()
    r.run(0.1)
    watch = Watch(r)
    getattr(r.axis, how)().wait(1)
    r.run(0.2)
    assert watch.words == []
    assert r.axis.state is AxisState.DISABLED


def test_a_drive_switched_off_during_a_halt_at_standstill_disables_its_axis_at_once():
    r = rig().enabled()
    r.run(0.3)
    halted = r.axis.halt()
    r.drive.controlword = 0x0000
    r.drive.evaluate_controlword()
    seen = []
    for _ in range(3):
        r.run(PERIOD)
        seen.append((r.core.image.state, r.axis.state))
    assert seen == [
        (PowerState.OPERATION_ENABLED, AxisState.STANDSTILL),
        *[(PowerState.SWITCH_ON_DISABLED, AxisState.DISABLED)] * 2,
    ]
    assert not halted.done
    halted.wait(1)
    assert (r.axis.state, r.axis.error) == (AxisState.DISABLED, None)


def creeps(r) -> None:
    """Let the drive turn its axis at 50 deg/s, whatever the command."""
    r.drive.dials.ignore_halt = True
    r.drive._mode.step = lambda axis, dt: axis.follow(axis.position + 50_000 * dt, 50_000, dt)


def test_an_axis_that_moves_again_during_its_halt_is_not_left_for_the_whole_halt_time():
    r = rig(stop_times=StopTimes(halt=2.0)).enabled()
    r.run(0.3)
    halted = r.axis.halt()
    creeps(r)
    began = r.now
    r.until(lambda: r.axis.error is not None)
    assert r.now - began < 0.5
    assert isinstance(r.axis.error, UncommandedMotion)
    assert "moves without a command" in r.axis.error.message
    assert r.axis.state is AxisState.ERRORSTOP
    assert not halted.done  # it is stopped harder, and the halt goes with that


def test_a_drive_found_enabled_has_the_halt_time_while_it_moves():
    """It is not ours to say that nothing should move it."""
    r = rig(stop_times=StopTimes(halt=2.0))
    for word in (0x06, 0x07, 0x0F):  # another master's
        r.drive.controlword = word
        r.drive.evaluate_controlword()
    r.run(0.3)
    assert r.axis.state is AxisState.STANDSTILL
    r.axis.halt()
    creeps(r)
    r.run(1.5)
    assert r.axis.error is None


def test_a_halt_that_the_drive_ignores_is_followed_by_a_quick_stop_and_reported():
    r = turning(stop_times=StopTimes(halt=0.3))
    r.drive.dials.ignore_halt = True
    r.drive._mode.step = lambda axis, dt: axis.follow(axis.position + axis.velocity * dt, axis.velocity, dt)
    watch = Watch(r)
    with pytest.raises(DriveError, match="harder stop than was commanded") as caught:
        r.axis.halt().wait(5)
    assert "halt > quick stop" in caught.value.observed
    assert "halt_time" in caught.value.remedy
    assert 11 in watch.transitions
    assert at_standstill(r)
    assert r.axis.state is AxisState.ERRORSTOP


# Stop and its lock.


def test_stop_locks_the_axis_until_it_is_released():
    r = turning()
    watch = Watch(r)
    r.axis.stop().wait(3)
    assert r.axis.state is AxisState.STOPPING
    assert at_standstill(r)
    for command in (
        lambda: r.axis.move_relative(5.0),
        lambda: r.axis.move_velocity(5.0),
        lambda: r.axis.home(37),
    ):
        with pytest.raises(StateError, match=r"release"):
            command().wait(1)
    watch.forget()
    r.run(0.5)
    assert watch.displacement < 1.0
    r.axis.release().wait(1)
    assert r.axis.state is AxisState.STANDSTILL
    r.axis.move_relative(5.0).wait(3)


def test_a_release_before_standstill_is_refused_and_the_stop_continues():
    r = turning()
    stop = r.axis.stop()
    r.run(0.05)
    with pytest.raises(StateError, match="is not at standstill yet"):
        r.axis.release().wait(1)
    stop.wait(3)
    assert r.axis.state is AxisState.STOPPING


def test_release_without_a_stop_is_harmless():
    r = turning()
    r.axis.release().wait(1)
    r.run(0.1)
    assert r.axis.state is AxisState.CONTINUOUS_MOTION
    assert r.drive.axis.motor.velocity == pytest.approx(100_000, rel=0.01)


def test_stop_twice_and_halt_during_a_stop_keep_the_lock():
    r = turning()
    first, second = r.axis.stop(), r.axis.stop()
    r.run(0.05)
    halt = r.axis.halt()
    for handle in (first, second, halt):
        handle.wait(3)
    assert r.axis.state is AxisState.STOPPING
    r.axis.halt().wait(1)
    r.axis.stop().wait(1)
    assert r.axis.state is AxisState.STOPPING
    r.axis.release().wait(1)
    assert r.axis.state is AxisState.STANDSTILL


def test_a_stop_during_a_halt_locks_and_gives_no_more_time():
    r = turning(stop_times=StopTimes(halt=0.5))
    r.drive.dials.ignore_halt = True
    r.drive._mode.step = lambda axis, dt: axis.follow(axis.position + axis.velocity * dt, axis.velocity, dt)
    start = r.now
    r.axis.halt()
    r.run(0.3)
    stop = r.axis.stop()
    r.until(lambda: r.drive.power.stage == QUICK_STOP)
    assert r.now - start == pytest.approx(0.5, abs=0.05)
    r.until(lambda: not stop.busy)


def test_stopped_holds_the_axis_within_a_block():
    r = turning()
    with r.axis.held_stopped(3.0):
        assert at_standstill(r)
        assert r.axis.state is AxisState.STOPPING
    assert r.axis.state is AxisState.STANDSTILL
    with pytest.raises(ZeroDivisionError), r.axis.held_stopped(3.0):
        raise ZeroDivisionError
    assert r.axis.state is AxisState.STANDSTILL


def test_disable_out_of_a_stop_takes_the_power_away():
    r = turning()
    r.axis.stop().wait(3)
    watch = Watch(r)
    r.axis.disable().wait(3)
    assert watch.transitions == [5, 6, 7]
    assert r.axis.state is AxisState.DISABLED


# Quick stop.


@pytest.mark.parametrize("streamed", ["csp", "csv"])
@pytest.mark.parametrize("accepts", [True, False], ids=["accepts-6084h", "refuses-6084h"])
def test_a_quick_stop_on_the_slow_ramp_brakes_set_points_with_the_deceleration_of_the_cell_file(
    streamed, accepts
):
    """Such a motion needs no 6084h itself, so the drive may still have the value of a gentle move, or of another program."""
    r = rig(braking=Braking(quick_stop=Ramp.SLOW), limits=AxisLimits()).enabled()
    r.device.write(0x605A, 0, 1)
    r.device.write(0x6084, 0, 200_000)
    if not accepts:
        r.device.dials.sdo_write_aborts[0x6084, 0] = 0x06010002
    if streamed == "csp":
        r.axis.follow(TrapezoidalTrajectory(0.0, 300.0, 100.0, 500.0))
    else:
        r.axis.cyclic_velocity(100.0).wait(5)
    r.run(1.0)
    before = r.drive.position
    r.axis.quick_stop().wait(5)
    braked = (r.drive.position - before) / 1000.0
    assert braked == pytest.approx(100.0**2 / 2 / (500.0 if accepts else 200.0), abs=3.0)  # 2 periods of lag


def test_quick_stop_with_an_option_that_disables_ends_disabled():
    r = turning()
    r.device.write(0x605A, 0, 2)
    watch = Watch(r)
    r.axis.quick_stop().wait(3)
    r.run(0.2)
    assert watch.transitions == [11, 12]
    assert r.axis.state is AxisState.DISABLED
    assert at_standstill(r)
    watch.forget()
    r.run(1.0)
    assert watch.transitions == []  # nothing switches it on again


@pytest.mark.parametrize("option", [0, 1, 2])
def test_a_drive_that_takes_its_time_to_switch_off_after_a_quick_stop_is_waited_for(option):
    """Transition 12 comes once its brake holds: that is the quick stop's end, and no power that was lost."""
    r = turning()
    r.device.write(0x605A, 0, option)
    r.drive.dials.transition_delay[12] = 0.3
    watch = Watch(r)
    r.axis.quick_stop().wait(3)
    assert watch.transitions == [11, 12]
    assert r.axis.state is AxisState.DISABLED
    r.run(1.0)
    assert r.axis.error is None
    r.axis.enable().wait(3)


def test_a_drive_without_605ah_that_stays_in_quick_stop_is_held_there_after_its_time():
    r = turning()
    r.device.write(0x605A, 0, 6)
    assert not r.core.parameters.quick_stop_holds
    handle = r.axis.quick_stop()
    taken = r.until(lambda: not handle.busy)
    handle.wait()
    assert taken == pytest.approx(r.core.parameters.stop_times.quick_stop, abs=0.05)
    assert r.axis.state is AxisState.STOPPING
    r.axis.enable().wait(3)


def test_a_drive_that_is_known_to_hold_after_a_quick_stop_is_not_waited_for():
    r = turning(quick_stop_holds=True)
    r.device.write(0x605A, 0, 6)
    handle = r.axis.quick_stop()
    assert r.until(lambda: not handle.busy) < 0.5
    assert r.axis.state is AxisState.STOPPING


@pytest.mark.parametrize("option", [5, 6])
def test_quick_stop_with_an_option_that_holds_stays_in_stopping_until_it_is_enabled_again(option):
    r = turning()
    r.device.write(0x605A, 0, option)
    watch = Watch(r)
    r.axis.quick_stop().wait(3)
    assert watch.transitions == [11]
    assert r.axis.state is AxisState.STOPPING
    with pytest.raises(StateError, match="quick stop active"):
        r.axis.release().wait(1)
    with pytest.raises(StateError):
        r.axis.move_relative(1.0).wait(1)
    watch.forget()
    r.run(1.0)
    assert watch.transitions == []
    r.axis.enable().wait(3)
    assert watch.transitions == [16]
    assert r.axis.state is AxisState.STANDSTILL
    assert watch.displacement < 1.0
    r.axis.move_relative(1.0).wait(3)


def test_a_held_quick_stop_can_be_disabled():
    r = turning()
    r.device.write(0x605A, 0, 6)
    r.axis.quick_stop().wait(3)
    watch = Watch(r)
    r.axis.disable().wait(3)
    assert watch.transitions == [12]
    assert r.axis.state is AxisState.DISABLED


def test_quick_stop_twice_is_harmless():
    r = turning()
    r.device.write(0x605A, 0, 6)
    first, second = r.axis.quick_stop(), r.axis.quick_stop()
    first.wait(3)
    second.wait(3)
    r.axis.quick_stop().wait(3)
    assert r.drive.power.stage == QUICK_STOP
    assert r.axis.state is AxisState.STOPPING


def test_quick_stop_during_a_halt_is_harder_at_once():
    r = rig().enabled()
    r.device.write(0x6085, 0, 5_000_000)
    r.axis.move_velocity(100.0, deceleration=50.0).wait(5)
    halt = r.axis.halt()
    r.run(0.1)
    watch = Watch(r)
    r.axis.quick_stop().wait(3)
    begin, end = watch.moving()
    assert end - begin < 0.1
    halt.wait()
    assert at_standstill(r)


def test_a_motion_that_a_stop_has_ended_names_the_stop():
    r = rig().enabled()
    move = r.axis.move_absolute(300.0)
    r.run(0.3)
    r.axis.quick_stop().wait(3)
    with pytest.raises(Stopped, match=r"x.quick_stop\(\)"):
        move.wait()


def test_a_quick_stop_that_the_drive_ignores_is_followed_by_disable_voltage():
    r = turning(stop_times=StopTimes(quick_stop=0.3))
    r.drive.dials.ignore_quick_stop = True
    watch = Watch(r)
    with pytest.raises(DriveError) as caught:
        r.axis.quick_stop().wait(5)
    assert "quick_stop_time" in caught.value.remedy
    assert 9 in watch.transitions
    assert r.drive.power.stage == DISABLED


def test_an_unanswered_quick_stop_does_not_drop_a_load():
    load = MotorParams(load=300.0)
    r = rig(motor=load, holds_load=HoldsLoad.TORQUE, stop_times=StopTimes(quick_stop=0.3))
    r.drive.start_enabled(1)
    r.run(0.2)
    r.axis.enable().wait(2)
    r.axis.move_velocity(20.0).wait(3)
    r.drive.dials.ignore_quick_stop = True
    watch = Watch(r)
    handle = r.axis.quick_stop()
    r.until(lambda: not handle.busy)
    r.run(0.5)
    assert r.drive.power.stage == ENABLED  # the power holds it
    assert watch.travel[0] >= watch.rows[0].position - 1
    assert "did not execute the quick stop" in handle.exception().message
    assert "remains on because it holds a load" in handle.exception().observed
    assert r.axis.state is AxisState.ERRORSTOP


def test_an_axis_with_a_brake_is_not_switched_off_before_standstill():
    r = turning(motor=MotorParams(brake=True), holds_load=HoldsLoad.BRAKE)
    watch = Watch(r)
    r.axis.disable().wait(5)
    moving_off = [row for row in watch.rows if row.stage != ENABLED and abs(row.velocity) > 20]
    assert moving_off == []
    assert r.axis.state is AxisState.DISABLED


def test_disabling_without_a_quick_stop_active_never_takes_transition_9_while_it_turns():
    r = turning()
    watch = Watch(r)
    r.axis.disable().wait(5)
    assert watch.transitions == [5, 6, 7]
    last = next(row for row in watch.rows if row.stage != ENABLED)
    assert abs(last.velocity) < 1.0


def test_no_enabling_controlword_is_sent_while_a_stop_runs_without_a_statusword():
    r = turning(port={"max_age": {"statusword": 0.05}})
    read = r.ports["x"].read
    r.ports["x"].read = lambda now: read(now)._replace(statusword=None)
    r.run(0.1)
    watch = Watch(r)
    r.axis.halt()
    r.run(2.0)
    blind = [item.outputs.controlword for item in watch.sent if item.outputs.controlword is not None]
    assert all(word & 0x0F != 0x0F for word in blind)
    assert at_standstill(r)


def test_halt_in_a_stop_time_of_one_cycle_is_no_trap():
    """A deadline shorter than the standstill window only leads to the next step; the axis ends safe."""
    r = turning(stop_times=replace(StopTimes(), halt=PERIOD))
    handle = r.axis.halt()
    r.until(lambda: not handle.busy)
    r.run(0.5)
    assert at_standstill(r)
