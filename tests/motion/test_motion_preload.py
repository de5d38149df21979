"""Nothing jumps: whatever the target objects held before enabling, and at every change of mode, with and without a load."""

from __future__ import annotations

from itertools import permutations

import pytest

from axisbus.motion.parameters import AxisLimits, HoldsLoad, HomingParameters
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from axisbus.sim.motor import MotorParams
from kit.motion.plant_recorder import ENABLED, Watch
from kit.motion.rig import PERIOD, rig

PP, PV, TQ, HM, CSP, CSV, CST = 1, 3, 4, 6, 8, 9, 10
LOAD = MotorParams(load=300.0, start_position=7_000.0)  # 30 % of rated torque hang on it
SEARCH = HomingParameters(method=37, speed_switch=20.0, speed_zero=5.0)


def stale(drive, mode: int) -> None:
    """Set the state that another program left in the drive: a mode, and targets far away."""
    drive.mode = drive.mode_display = mode
    drive._mode = drive._all_modes[mode]
    drive.target_position, drive.target_velocity, drive.target_torque = 123_456, 50_000, 400


def run_in(r, mode: int) -> None:
    """Bring an enabled axis into a mode by the command that uses it, and to standstill there."""
    axis = r.axis
    if mode == PP:
        axis.move_relative(3.0).wait(5)
    elif mode == PV:
        axis.move_velocity(20.0).wait(5)
        axis.move_velocity(0.0).wait(5)
        r.run(0.1)
        axis.halt().wait(3)
    elif mode == TQ:
        axis.torque_control(0.0, slope=100.0).wait(5)
        axis.halt().wait(5)
    elif mode == HM:
        axis.home(37).wait(5)
    else:
        here = axis.position
        axis.follow(TrapezoidalTrajectory(here, here + 2.0, 50.0, 500.0)).wait(5)
    r.run(0.2)


# Enabling.


@pytest.mark.parametrize("mode", [PP, PV, TQ, HM, CSP, CSV, CST])
def test_stale_targets_move_nothing_when_a_drive_is_enabled_in_any_mode(mode):
    r = rig(motor=MotorParams(start_position=7_000.0))
    stale(r.drive, mode)
    watch = Watch(r)
    r.axis.enable().wait(5)
    r.run(1.0)
    assert r.drive.power.stage == ENABLED
    assert watch.displacement == 0.0
    # while the power stage went up, every target was one that moves nothing
    before = next(item.outputs for item in watch.sent if (item.outputs.controlword or 0) & 0x0F == 0x0F)
    assert (before.target_position, before.target_velocity, before.target_torque) == (7_000, 0, 0)


@pytest.mark.parametrize("mode", [PP, PV, TQ, HM, CSP, CSV, CST])
@pytest.mark.parametrize("refused", [frozenset({PP}), frozenset({PP, CSP})], ids=["no pp", "no pp, no csp"])
def test_stale_targets_move_nothing_if_another_resting_mode_must_be_taken(mode, refused):
    r = rig(motor=MotorParams(start_position=7_000.0))
    stale(r.drive, mode)
    r.drive.dials.modes_refused = refused - {mode}
    watch = Watch(r)
    r.axis.enable().wait(10)
    r.run(0.5)
    assert watch.displacement == 0.0


def test_an_axis_that_was_pushed_while_disabled_is_held_at_its_new_position():
    r = rig().enabled()
    r.axis.move_absolute(20.0).wait(5)
    r.axis.disable().wait(3)
    r.drive.axis.motor.position += 5_000.0  # by hand
    r.run(0.2)
    watch = Watch(r)
    r.axis.enable().wait(3)
    r.run(0.5)
    assert watch.displacement == 0.0


def test_an_axis_that_turns_while_it_is_enabled_is_caught_and_not_thrown_back():
    """It is turned by hand: the target follows the actual position up to the moment at which it is enabled."""
    r = rig()
    r.drive.dials.transition_delay[4] = 0.1
    handle = r.axis.enable()
    motor = r.drive.axis.motor
    r.run(0.05)
    motor.velocity = 30_000.0
    r.until(lambda: not handle.busy)
    watch = Watch(r)
    r.run(1.0)
    assert watch.travel[1] - watch.rows[0].position <= 3_000
    assert abs(motor.velocity) < 1.0


# Changing the mode while enabled.


@pytest.mark.parametrize(("first", "second"), list(permutations([PP, PV, TQ, HM, CSP], 2)))
def test_no_change_of_mode_moves_an_axis_at_standstill(first, second):
    r = rig(homing=SEARCH, limits=AxisLimits()).enabled()
    run_in(r, first)
    r.drive.dials.mode_delay = 0.03
    watch = Watch(r)
    if second == PP:
        r.axis.move_relative(0.0).wait(5)
    elif second == PV:
        r.axis.move_velocity(0.0).wait(5)
    elif second == TQ:
        r.axis.torque_control(0.0, slope=100.0).wait(5)
    elif second == HM:
        r.axis.home(37).wait(5)
    else:
        here = r.axis.position
        r.axis.follow(TrapezoidalTrajectory(here, here, 50.0, 500.0)).wait(5)
    r.run(0.3)
    assert watch.modes[-1] == second
    assert (
        watch.displacement <= 60
    )  # the drive's own window: the remaining deviation of a move may still be closed
    assert watch.speed < 2_000


@pytest.mark.parametrize(("first", "second"), list(permutations([PP, PV, HM, CSP], 2)))
def test_a_loaded_axis_does_not_sag_at_any_change_of_mode(first, second):
    """The reference is the demand: the actual position lies below it, and would go a little deeper at every change."""
    r = rig(motor=LOAD, homing=SEARCH, limits=AxisLimits(), holds_load=HoldsLoad.TORQUE)
    r.drive.start_enabled(1)  # the load hangs on the motor when we come
    r.run(0.2)
    r.axis.enable().wait(2)
    run_in(r, first)
    r.drive.dials.mode_delay = 0.03
    watch = Watch(r)
    start = r.drive.axis.motor.position
    for _ in range(3):
        for mode in (second, first):
            if mode == PP:
                r.axis.move_additive(0.0).wait(5)
            elif mode == PV:
                r.axis.move_velocity(0.0).wait(5)
                r.axis.halt().wait(3)
            elif mode == HM:
                r.axis.home(37).wait(5)
            else:
                here = (r.drive.position_demand - r.core.image.origin) / 1000
                r.axis.follow(TrapezoidalTrajectory(here, here, 50.0, 500.0)).wait(5)
            r.run(0.1)
    assert r.drive.axis.motor.position == pytest.approx(start, abs=60)
    assert watch.travel[0] >= start - 60


@pytest.mark.parametrize("pause", [1, 2, 3, 5, 8, 11])
def test_a_commanded_mode_that_is_no_longer_needed_is_reverted(pause):
    """The drive still shows pp, but 6060h holds pv already: it would change in the middle of the move."""
    r = rig().enabled()
    r.drive.dials.mode_delay = 0.12
    r.axis.move_velocity(0.0)
    r.run(pause * PERIOD)
    watch = Watch(r)
    r.axis.move_absolute(20.0).wait(5)
    r.run(0.2)
    assert watch.modes == [PP]
    assert r.drive.mode_display == PP
    assert r.drive.position == 20_000


def test_a_load_does_not_fall_while_torque_mode_is_entered_and_left():
    r = rig(motor=LOAD, limits=AxisLimits(), holds_load=HoldsLoad.TORQUE)
    r.drive.start_enabled(1)
    r.run(0.2)
    r.axis.enable().wait(2)
    r.drive.dials.mode_delay = 0.05
    watch = Watch(r)
    r.axis.torque_control(3.0, slope=1000.0).wait(3)  # the torque that the load needs
    r.axis.halt().wait(3)
    r.axis.move_relative(0.0).wait(5)
    r.run(0.5)
    assert watch.travel[0] >= watch.rows[0].position - 200
    assert r.axis.state is AxisState.STANDSTILL


def test_after_homing_and_set_position_the_reference_is_loaded_again():
    r = rig(motor=MotorParams(start_position=50_000.0), homing=SEARCH).enabled()
    r.axis.move_relative(10.0).wait(5)
    r.axis.home(37).wait(5)
    watch = Watch(r)
    r.axis.follow(TrapezoidalTrajectory(0.0, 0.0, 50.0, 500.0)).wait(5)
    r.axis.set_position(123.0).wait(1)
    r.axis.follow(TrapezoidalTrajectory(123.0, 123.0, 50.0, 500.0)).wait(5)
    r.axis.move_relative(0.0).wait(5)
    r.run(0.3)
    assert watch.displacement <= 2
    assert set(watch.targets) <= {-1, 0, 1}  # the drive's own count begins at home


def test_offsets_of_another_program_are_taken_back_before_a_trajectory():
    r = rig().enabled()
    r.device.write(0x60B0, 0, 30_000)
    watch = Watch(r)
    r.axis.follow(TrapezoidalTrajectory(0.0, 1.0, 50.0, 500.0)).wait(5)
    r.run(PERIOD)
    assert watch.travel[1] <= 1_010
    assert r.device.read(0x60B0, 0) == 0


def test_offsets_of_another_program_move_nothing_when_a_drive_is_enabled_in_a_cyclic_mode():
    r = rig()
    for index in (0x60B0, 0x60B1, 0x60B2):
        r.device.write(index, 0, 300)
    stale(r.drive, CSP)
    r.drive.dials.modes_refused = frozenset({PP})
    watch = Watch(r)
    r.axis.enable().wait(5)
    r.run(0.5)
    assert r.drive.mode_display == CSP
    assert watch.displacement == 0.0
    assert [r.device.read(index, 0) for index in (0x60B0, 0x60B1, 0x60B2)] == [0, 0, 0]
