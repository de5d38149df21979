"""A drive that leaves *operation enabled* without a command gets its power back only by a new command."""

from __future__ import annotations

import pytest

from axisbus.motion.states import AxisState
from kit.motion.plant_recorder import DISABLED, ENABLED, QUICK_STOP, Watch
from kit.motion.rig import PERIOD, rig
from kit.motion.situations import SITUATIONS

WITH_POWER = (
    *(
        "standing",
        "turning",
        "moving",
        "pushed",
        "halting",
        "halted",
        "stopping",
        "stopped",
        "error stop",
        "loaded",
    ),
    *("homing", "following", "jogging"),
)


@pytest.mark.parametrize("transition", [9, 11])
@pytest.mark.parametrize("situation", WITH_POWER)
def test_lost_power_does_not_return_without_a_command(situation, transition):
    r = SITUATIONS[situation]()
    watch = Watch(r)
    r.drive.power.force(transition)  # safe torque off, or another master
    r.run(PERIOD)
    assert r.drive.power.stage in (DISABLED, QUICK_STOP)
    r.run(4.0)
    assert not {4, 16} & set(watch.transitions)
    assert r.drive.power.stage != ENABLED
    moved = r.drive.axis.motor.position
    r.run(0.5)
    assert r.drive.axis.motor.position == pytest.approx(moved, abs=1.0)
    if situation == "error stop":
        assert r.axis.state is AxisState.ERRORSTOP


def test_a_motor_without_power_may_be_turned_by_hand():
    r = SITUATIONS["error stop"]()
    r.drive.power.force(9)
    r.run(1.0)
    told = str(r.axis.error)
    for _ in range(50):
        r.drive.axis.motor.position += 2000.0
        r.run(PERIOD)
    assert str(r.axis.error) == told


def test_while_the_drive_homes_it_is_given_no_target():
    r = SITUATIONS["homing"]()
    watch = Watch(r)
    r.run(0.5)
    assert r.axis.state is AxisState.HOMING
    assert watch.targets == []
    turning = SITUATIONS["turning"]()
    watch = Watch(turning)
    turning.run(0.5)
    assert watch.targets
    assert (
        abs(watch.targets[-1] - turning.drive.axis.motor.position) < 2000
    )  # where it is, were it to fall out of its mode


def test_an_axis_at_standstill_is_left_alone_when_another_one_fails():
    r = rig("xy").enabled()
    r.axes["x"].move_velocity(50.0).wait(3)
    watch = Watch(r, "y")
    r.drive_of("x").fault(0x2310)
    r.run(1.0)
    assert watch.words in ([], [0x0F])
    assert r.axes["y"].state is AxisState.STANDSTILL
    moving = rig("xy").enabled()
    moving.axes["y"].move_velocity(50.0).wait(3)
    moving.drive_of("x").fault(0x2310)
    moving.run(1.0)
    assert moving.axes["y"].state is AxisState.STANDSTILL
    assert abs(moving.drive_of("y").axis.motor.velocity) < 1.0


def test_a_group_that_is_enabled_stops_enabling_when_one_of_it_fails():
    r = rig("xy")
    r.run(0.1)
    r.drive_of("y").dials.fault_on_enable = 0x2310
    handles = [axis.enable() for axis in r.axes.values()]
    r.run(3.0)
    assert all(not handle.busy for handle in handles)
    assert r.drive_of("y").power.stage != ENABLED


def test_a_fault_stops_its_own_group_and_no_other():
    r = rig("xyz", groups={"a": ["x", "y"], "b": ["z"]}).enabled()
    for name in "yz":
        r.axes[name].move_velocity(50.0).wait(3)
    r.drive_of("x").fault(0x2310)
    r.run(1.0)
    assert abs(r.drive_of("y").axis.motor.velocity) < 1.0
    assert r.drive_of("z").axis.motor.velocity == pytest.approx(50_000, rel=0.01)
    assert r.axes["z"].state is AxisState.CONTINUOUS_MOTION


def test_an_axis_that_another_master_turns_is_not_stopped_for_a_fault_of_this_machine():
    r = rig("xy")
    r.drive_of("y").target_velocity = 50_000
    r.drive_of("y").start_enabled(3)
    r.run(0.5)
    r.axes["x"].enable().wait(3)
    watch = Watch(r, "y")
    r.drive_of("x").fault(0x2310)
    r.run(1.0)
    assert watch.words == []
    assert r.drive_of("y").axis.motor.velocity == pytest.approx(50_000, rel=0.01)
