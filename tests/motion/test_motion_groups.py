"""Groups: common start in one SYNC, straight lines, and the effect of a failed axis on the others."""

from __future__ import annotations

import math
from itertools import pairwise
from types import SimpleNamespace

import pytest

from axisbus.errors import (
    ArgumentError,
    AxisbusError,
    DriveFault,
    Interrupted,
    LimitError,
    Replaced,
    StateError,
    Stopped,
    TransitionError,
)
from axisbus.motion.group.start_barrier import OPEN, StartBarrier
from axisbus.motion.parameters import AxisLimits, Defaults, Units
from axisbus.motion.states import AxisState
from axisbus.motion.stop.policy import FaultPolicy
from axisbus.sim.fault_injection import NEVER
from axisbus.sim.motor import MotorParams
from axisbus.units import Scale
from kit.motion.plant_recorder import ENABLED, SWITCHED_ON, Watch
from kit.motion.rig import PERIOD, Rig, rig


def watches(r) -> dict[str, Watch]:
    return {name: Watch(r, name) for name in r.axes}


def path(seen: dict[str, Watch]) -> list[tuple[float, ...]]:
    """Positions of all axes in degrees, cycle by cycle (one watch per axis sees the same cycles)."""
    columns = [[row.position / 1000.0 for row in watch.rows] for watch in seen.values()]
    return list(zip(*columns, strict=False))


def off_the_line(points, start, end) -> float:
    """The greatest distance of any point from the straight line, in degrees."""
    length = math.dist(start, end)
    along = [(b - a) / length for a, b in zip(start, end, strict=True)]
    worst = 0.0
    for point in points:
        way = [p - a for p, a in zip(point, start, strict=True)]
        share = sum(w * d for w, d in zip(way, along, strict=True))
        worst = max(worst, math.sqrt(max(0.0, sum(w * w for w in way) - share * share)))
    return worst


def time_of_motion(seen: dict[str, Watch]) -> float:
    spans = [watch.moving() for watch in seen.values() if watch.speed > 20]
    return max(end for _, end in spans) - min(begin for begin, _ in spans)


# Enabling and stopping together.


def test_all_axes_take_transition_4_in_the_same_sync():
    r = rig("xyz")
    r.drive_of("x").dials.transition_delay[2] = 0.25
    r.drive_of("z").dials.transition_delay[3] = 0.4
    seen = watches(r)
    r.groups["all"].enable().wait(5)
    times = [watch.stage_times(ENABLED) for watch in seen.values()]
    assert [len(t) for t in times] == [1, 1, 1]
    assert times[0] == times[1] == times[2]
    waited = seen["y"].stage_times(SWITCHED_ON)[0]
    assert times[0][0] - waited > 0.3  # y was ready and waited for the slowest


def test_a_repeated_group_enable_continues_and_both_handles_end_as_it_does():
    r = rig("xyz")
    r.drive_of("y").dials.transition_delay[3] = 0.2
    watches = [Watch(r, name) for name in "xyz"]
    group = r.groups["all"]
    first = group.enable()
    r.run(0.1)  # x and z wait at the gate
    second = group.enable()
    r.run(0.05)
    one = r.axes["x"].enable()  # nor does one axis jump the queue
    second.wait(3)
    assert first.done
    assert one.done
    assert [watch.transitions for watch in watches] == [[2, 3, 4]] * 3
    assert len({tuple(watch.stage_times(ENABLED)) for watch in watches}) == 1  # still all in one SYNC


def test_waiting_threads_wake_in_the_cycle_in_which_a_group_command_ends_and_in_no_other():
    r = rig("xy")
    r.drive_of("y").dials.transition_delay[3] = 0.2
    woken: list[float] = []
    r.scan.waiter = SimpleNamespace(notify=lambda: woken.append(r.now))
    group = r.groups["all"].enable()
    r.run(0.1)
    assert woken == []
    r.until(lambda: not group.busy)
    assert woken[-1:] == [r.now]


def test_an_axis_that_is_being_enabled_alone_does_not_block_its_group():
    r = rig("xy")
    r.drive_of("x").dials.transition_delay[3] = 0.2
    one = r.axes["x"].enable()
    r.run(0.1)
    r.groups["all"].enable().wait(3)
    assert one.done
    assert all(device.drives[0].power.stage == ENABLED for device in r.devices)


def test_a_repeated_group_enable_that_fails_fails_for_both_handles():
    r = rig("xy")
    r.drive_of("y").dials.transition_delay[3] = 1e9
    first = r.groups["all"].enable()
    r.run(0.5)
    second = r.groups["all"].enable()
    r.until(lambda: not second.busy)
    assert second.exception() is first.exception()
    assert "y" in str(first.exception())
    r.run(1.0)
    assert r.drive_of("x").power.stage != ENABLED


@pytest.mark.parametrize("how", ["halt", "stop", "disable", "quick_stop", "reset"])
def test_a_group_command_given_twice_ends_well_for_both(how):
    r = rig("xy").enabled()
    for axis in r.axes.values():
        axis.move_velocity(50.0)
    r.run(0.3)
    group = r.groups["all"]
    if how == "reset":
        r.drive.fault(0x4310)
        r.run(1.0)
    first = getattr(group, how)()
    r.run(2 * PERIOD)
    second = getattr(group, how)()
    second.wait(5)
    first.wait(1)
    assert first.done
    assert all(abs(device.drives[0].axis.motor.velocity) < 1.0 for device in r.devices)


def test_a_repeated_halt_stops_an_axis_that_started_to_move_after_the_first():
    r = rig("xy", each={"y": {"defaults": Defaults(velocity=100.0, acceleration=20.0)}}).enabled()
    r.axes["y"].move_velocity(50.0)
    r.run(1.0)
    group = r.groups["all"]
    first = group.halt()
    r.run(0.2)  # y takes its time
    moved = r.axes["x"].move_velocity(50.0)
    r.run(0.2)
    assert first.busy
    group.halt().wait(5)
    assert not moved.busy
    assert first.done
    assert all(abs(device.drives[0].axis.motor.velocity) < 1.0 for device in r.devices)


def test_a_group_is_enabled_if_one_axis_is_enabled_already():
    r = rig("xyz")
    r.axes["y"].enable().wait(2)
    seen = watches(r)
    r.groups["all"].enable().wait(5)
    assert seen["x"].stage_times(ENABLED) == seen["z"].stage_times(ENABLED)
    assert seen["y"].transitions == []
    r.groups["all"].enable().wait(2)  # and again, with all enabled
    assert all(axis.state is AxisState.STANDSTILL for axis in r.axes.values())


def test_one_axis_that_cannot_be_enabled_takes_the_others_back():
    r = rig("xyz")
    r.drive_of("y").dials.transition_delay[3] = NEVER
    seen = watches(r)
    handle = r.groups["all"].enable()
    with pytest.raises(TransitionError, match="y: the drive does not change"):
        handle.wait(10)
    r.run(0.5)
    assert all(4 not in watch.transitions for watch in seen.values())
    assert r.axes["x"].state is AxisState.DISABLED
    assert r.axes["y"].state is AxisState.ERRORSTOP


def test_one_axis_in_fault_keeps_the_group_from_being_enabled_and_is_named():
    r = rig("xy")
    r.drive_of("y").fault(0x2310)
    r.run(0.6)
    seen = watches(r)
    with pytest.raises(StateError, match=r"(?s)y is in ErrorStop.*reset"):
        r.groups["all"].enable().wait(5)
    r.run(0.5)
    assert all(4 not in watch.transitions for watch in seen.values())


def test_disable_halt_stop_release_and_reset_for_all():
    r = rig("xy").enabled()
    group = r.groups["all"]
    for axis in r.axes.values():
        axis.move_velocity(50.0).wait(2)
    group.halt().wait(3)
    assert {axis.state for axis in r.axes.values()} == {AxisState.STANDSTILL}
    group.stop().wait(3)
    assert {axis.state for axis in r.axes.values()} == {AxisState.STOPPING}
    with pytest.raises(StateError):
        r.axes["x"].move_absolute(0.0).wait(1)
    group.release().wait(1)
    group.quick_stop().wait(3)
    assert {axis.state for axis in r.axes.values()} == {AxisState.DISABLED}
    group.enable().wait(3)
    group.disable().wait(3)
    assert {axis.state for axis in r.axes.values()} == {AxisState.DISABLED}
    r.drive_of("x").fault(0x2310)
    r.run(0.6)
    group.reset().wait(3)
    assert {axis.state for axis in r.axes.values()} == {AxisState.DISABLED}


# Straight lines.


def test_a_straight_line_takes_the_time_of_its_trapezoid_and_stays_straight():
    r = rig("xy").enabled()
    seen = watches(r)
    r.groups["all"].move_linear((30.0, 40.0), velocity=50.0, acceleration=250.0).wait(5)
    # 50 deg at 50 deg/s with 250 deg/s²: 50/50 + 50/250 = 1.2 s
    assert time_of_motion(seen) == pytest.approx(1.2, abs=0.04)
    assert seen["x"].speed == pytest.approx(30_000, rel=0.01)
    assert seen["y"].speed == pytest.approx(40_000, rel=0.01)
    assert off_the_line(path(seen), (0.0, 0.0), (30.0, 40.0)) < 0.003
    assert r.drive_of("x").position == 30_000
    assert r.drive_of("y").position == 40_000
    assert {axis.state for axis in r.axes.values()} == {AxisState.STANDSTILL}


def test_a_short_line_is_a_triangle():
    r = rig("xy").enabled()
    seen = watches(r)
    r.groups["all"].move_linear((3.0, 4.0), velocity=200.0, acceleration=500.0).wait(5)
    assert time_of_motion(seen) == pytest.approx(2 * math.sqrt(5.0 / 500.0), abs=0.03)  # 0.2 s
    assert off_the_line(path(seen), (0.0, 0.0), (3.0, 4.0)) < 0.003


def test_the_slowest_axis_slows_all_and_the_line_stays_straight():
    r = rig(
        "xyz",
        each={"y": {"limits": AxisLimits(velocity=10.0)}, "z": {"limits": AxisLimits(acceleration=40.0)}},
    )
    r.enabled()
    seen = watches(r)
    r.groups["all"].move_linear((20.0, 20.0, 10.0), velocity=300.0, acceleration=1000.0).wait(10)
    # y may do 10 deg/s over 20 deg; z may do 40 deg/s² over 10 deg: shares of the path 0.5 /s and 4 /s²; 1/0.5 + 0.5/4 s
    assert time_of_motion(seen) == pytest.approx(2.0 + 0.125, abs=0.04)
    assert seen["y"].speed <= 10_000 * 1.01
    assert seen["z"].acceleration(5) <= 40_000 * 1.1
    assert off_the_line(path(seen), (0.0, 0.0, 0.0), (20.0, 20.0, 10.0)) < 0.004


def test_a_line_with_an_axis_that_does_not_move_and_one_of_no_length():
    r = rig("xy").enabled()
    r.groups["all"].move_linear((20.0, 0.0), velocity=100.0).wait(5)
    assert (r.drive_of("x").position, r.drive_of("y").position) == (20_000, 0)
    start = r.now
    r.groups["all"].move_linear((20.0, 0.0), velocity=100.0).wait(5)
    assert r.now - start < 0.5


def test_a_line_begins_at_the_demand_and_both_begin_in_the_same_cycle():
    r = rig("xy").enabled()
    r.drive_of("y").dials.mode_delay = 0.3
    seen = watches(r)
    r.groups["all"].move_linear((30.0, 30.0), velocity=100.0).wait(5)
    assert seen["x"].moving()[0] == pytest.approx(seen["y"].moving()[0], abs=1e-9)
    assert seen["x"].moving()[0] > 0.3


def test_halt_brakes_along_the_line():
    r = rig("xy").enabled()
    handle = r.groups["all"].move_linear((90.0, 120.0), velocity=100.0, acceleration=400.0)
    r.run(0.8)
    seen = watches(r)
    r.groups["all"].halt().wait(3)
    assert isinstance(handle.exception(), Interrupted)
    assert off_the_line(path(seen), (0.0, 0.0), (90.0, 120.0)) < 0.004
    # 100 deg/s with 400 deg/s²: 0.25 s, the two cycles until the command acts, and the one until its last target acts
    assert seen["x"].moving()[1] - seen["x"].rows[0].t == pytest.approx(0.25 + 3 * PERIOD, abs=0.02)
    assert {axis.state for axis in r.axes.values()} == {AxisState.STANDSTILL}
    assert r.drive_of("x").mode_display == 8
    r.groups["all"].move_linear((0.0, 0.0), velocity=100.0).wait(5)
    assert r.drive_of("x").position == 0


@pytest.mark.parametrize("after", [0.08, 0.15, 1.0, 1.62, 1.75])
def test_braking_along_the_line_never_exceeds_the_acceleration_of_the_path(after):
    """Also while the line itself speeds up (0.25 s) or slows down (from 1.5 s on)."""
    r = rig("xy").enabled()
    r.groups["all"].move_linear((90.0, 120.0), velocity=100.0, acceleration=400.0)
    r.run(0.05 + after)
    seen = watches(r)
    r.groups["all"].halt().wait(3)
    assert off_the_line(path(seen), (0.0, 0.0), (90.0, 120.0)) < 0.004
    assert seen["x"].acceleration(2) <= 400_000 * 0.6 * 1.1
    assert seen["y"].acceleration(2) <= 400_000 * 0.8 * 1.1


def test_a_halt_of_one_axis_brakes_all_axes_on_the_line():
    r = rig("xy").enabled()
    handle = r.groups["all"].move_linear((90.0, 120.0), velocity=100.0, acceleration=400.0)
    r.run(0.8)
    seen = watches(r)
    r.axes["x"].halt().wait(3)
    r.run(0.5)
    assert not handle.busy
    assert handle.exception() is not None
    assert off_the_line(path(seen), (0.0, 0.0), (90.0, 120.0)) < 0.004
    assert all(abs(watch.rows[-1].velocity) < 1.0 for watch in seen.values())
    assert {axis.state for axis in r.axes.values()} == {AxisState.STANDSTILL}


def test_one_axis_taken_away_by_another_command_brakes_the_others_along_the_line():
    r = rig("xyz").enabled()
    handle = r.groups["all"].move_linear((90.0, 120.0, 60.0), velocity=100.0, acceleration=400.0)
    r.run(0.8)
    seen = watches(r)
    own = r.axes["x"].move_absolute(0.0)
    r.run(0.6)
    assert not handle.busy
    with pytest.raises(Interrupted, match="x"):
        handle.wait()
    others = {name: seen[name] for name in "yz"}
    assert off_the_line(path(others), (0.0, 0.0), (120.0, 60.0)) < 0.004
    assert all(abs(watch.rows[-1].velocity) < 1.0 for watch in others.values())
    own.wait(5)
    assert r.drive_of("x").position == pytest.approx(0, abs=60)


@pytest.mark.parametrize("known", [True, False])
def test_a_fault_of_one_member_stops_the_others_along_the_line(known):
    """Also where the fault policy does not know the group."""
    groups = None if known else {"one": ["x"], "two": ["y"], "three": ["z"]}
    r = rig("xyz", groups=groups).enabled()
    group = r.groups["all"] if known else r.group("x", "y", "z")
    handle = group.move_linear((90.0, 120.0, 60.0), velocity=100.0, acceleration=400.0)
    r.run(0.8)
    seen = watches(r)
    r.drive_of("x").fault(0x2310)
    r.run(1.0)
    with pytest.raises(DriveFault):
        handle.wait(2)
    others = {name: seen[name] for name in "yz"}
    assert off_the_line(path(others), (0.0, 0.0), (120.0, 60.0)) < 0.004
    assert all(abs(watch.rows[-1].velocity) < 1.0 for watch in others.values())
    assert r.drive_of("y").position < 110_000
    assert {r.axes[name].state for name in "yz"} == {AxisState.STANDSTILL}
    assert r.axes["x"].state is AxisState.ERRORSTOP


@pytest.mark.parametrize("trouble", ["disabled", "found enabled", "moving", "fault", "locked"])
def test_a_line_with_an_axis_that_cannot_move_is_refused_without_a_motion(trouble):
    r = rig("xyz")
    for name in "xz":
        r.axes[name].enable().wait(2)
    if trouble == "found enabled":
        r.drive_of("y").start_enabled(1)
        r.run(0.3)
    elif trouble != "disabled":
        r.axes["y"].enable().wait(2)
    if trouble == "moving":
        r.axes["y"].move_velocity(10.0).wait(2)
    elif trouble == "fault":
        r.drive_of("y").fault(0x2310)
        r.run(0.6)
    elif trouble == "locked":
        r.axes["y"].stop().wait(2)
    seen = watches(r)
    handle = r.groups["all"].move_linear((30.0, 30.0, 30.0), velocity=50.0)
    with pytest.raises(StateError, match="y"):
        handle.wait(3)
    r.run(0.5)
    assert seen["x"].displacement < 1.0
    assert seen["z"].displacement < 1.0
    assert {r.axes[name].state for name in "xz"} == {AxisState.STANDSTILL}


def test_a_member_that_refuses_the_mode_stops_the_others_before_they_start():
    r = rig("xyz").enabled()
    r.drive_of("y").dials.modes_refused = frozenset({8})
    seen = watches(r)
    handle = r.groups["all"].move_linear((30.0, 30.0, 30.0), velocity=50.0)
    with pytest.raises(AxisbusError, match="y: the drive does not enter mode 8"):
        handle.wait(5)
    r.run(0.5)
    assert all(watch.displacement < 1.0 for watch in seen.values())


def test_a_line_needs_a_number_for_each_axis_and_keeps_the_limits():
    r = rig("xy", limits=AxisLimits(position=(-50.0, 50.0), velocity=400.0)).enabled()
    group = r.groups["all"]
    with pytest.raises(ArgumentError, match="1 position for 2 axes"):
        group.move_linear((1.0,), velocity=10.0)
    with pytest.raises(LimitError, match="position limits"):
        group.move_linear((1.0, 51.0), velocity=10.0)
    with pytest.raises(ArgumentError, match="velocity"):
        group.move_linear((1.0, 2.0), velocity=0.0)
    with pytest.raises(ArgumentError):
        group.move_linear((1.0, math.nan), velocity=10.0)


def test_a_line_returns_an_axis_that_is_outside_its_limits():
    outside = MotorParams(start_position=15_000)
    r = rig("xy", motor=outside, each={"x": {"limits": AxisLimits(position=(-10.0, 10.0))}}).enabled()
    watch = Watch(r, "x")
    r.groups["all"].move_linear((5.0, 20.0), velocity=50.0, acceleration=200.0).wait(5)
    assert [device.drives[0].position for device in r.devices] == [5_000, 20_000]
    assert watch.travel[1] <= 15_001


def test_a_line_without_an_acceleration_uses_the_smallest_default_or_names_the_axis_without_one():
    r = rig("xy", each={"y": {"defaults": Defaults(velocity=10.0, acceleration=50.0)}}).enabled()
    seen = watches(r)
    r.groups["all"].move_linear((30.0, 40.0), velocity=50.0).wait(10)
    assert time_of_motion(seen) == pytest.approx(50 / 50 + 50 / 50, abs=0.04)
    lacking = rig("xy", each={"y": {"defaults": Defaults()}})
    with pytest.raises(ArgumentError, match="acceleration is missing") as caught:
        lacking.groups["all"].move_linear((30.0, 40.0), velocity=50.0)
    assert "y" in caught.value.observed


def test_a_line_from_another_origin_and_in_another_direction():
    r = rig("xy").enabled()
    r.axes["x"].move_absolute(10.0).wait(3)
    r.run(0.2)
    r.axes["x"].set_position(-5.0).wait(1)
    seen = watches(r)
    r.groups["all"].move_linear((25.0, -40.0), velocity=50.0, acceleration=250.0).wait(5)
    assert r.drive_of("x").position == 40_000  # 30 deg further
    assert r.axes["x"].position == pytest.approx(25.0)
    assert off_the_line(path(seen), (10.0, 0.0), (40.0, -40.0)) < 0.003


def test_an_endless_axis_takes_the_shortest_direction_on_a_line_too():
    endless = Units(
        Scale.of(1000, "deg"),
        Scale.of(1000, "deg/s"),
        Scale.of(1000, "deg/s²"),
        ratio_known=True,
        modulo=360.0,
    )
    r = rig("xy", each={"x": {"units": endless}}).enabled()
    r.axes["x"].move_absolute(350.0, direction=1, velocity=400.0).wait(5)
    assert r.drive_of("x").position == pytest.approx(350_000, abs=60)
    r.groups["all"].move_linear((10.0, 20.0), velocity=100.0).wait(5)
    assert r.drive_of("x").position == pytest.approx(370_000, abs=5)
    assert r.axes["x"].position == pytest.approx(10.0, abs=0.01)


def test_move_direct_starts_all_in_the_same_cycle_each_by_its_own_profile():
    r = rig("xy", each={"y": {"defaults": Defaults(velocity=50.0, acceleration=500.0)}}).enabled()
    r.axes["y"].home(37).wait(3)  # y has to change its mode first
    r.drive_of("y").dials.mode_delay = 0.2
    seen = watches(r)
    handle = r.groups["all"].move_direct((30.0, 40.0))
    handle.wait(5)
    assert seen["x"].moving()[0] == pytest.approx(seen["y"].moving()[0], abs=1e-9)
    assert seen["x"].moving()[1] - seen["x"].moving()[0] == pytest.approx(0.3 + 0.2, abs=0.03)
    assert seen["y"].moving()[1] - seen["y"].moving()[0] == pytest.approx(40 / 50 + 0.1, abs=0.03)


def test_move_direct_at_a_common_velocity_and_its_refusals():
    r = rig("xy", limits=AxisLimits(position=(-50.0, 50.0), velocity=400.0)).enabled()
    seen = watches(r)
    r.groups["all"].move_direct((30.0, -30.0), velocity=60.0).wait(5)
    assert seen["x"].speed == pytest.approx(60_000, rel=0.01)
    assert seen["y"].speed == pytest.approx(60_000, rel=0.01)
    with pytest.raises(LimitError):
        r.groups["all"].move_direct((30.0, 60.0))


def test_a_member_that_is_not_enabled_keeps_move_direct_from_starting():
    r = rig("xy")
    r.axes["x"].enable().wait(2)
    seen = watches(r)
    with pytest.raises(StateError, match="y is Disabled"):
        r.groups["all"].move_direct((30.0, 40.0)).wait(3)
    r.run(0.5)
    assert seen["x"].displacement < 1.0
    assert r.axes["x"].state is AxisState.STANDSTILL


def test_a_group_command_takes_over_from_the_one_before():
    r = rig("xy").enabled()
    group = r.groups["all"]
    first = group.move_direct((100.0, 100.0))
    r.run(0.3)
    second = group.move_direct((0.0, 10.0))
    second.wait(5)
    assert isinstance(first.exception(), Replaced)
    assert r.drive_of("x").position == pytest.approx(0, abs=60)
    third = group.move_direct((100.0, 100.0))
    r.run(0.3)
    group.disable().wait(5)
    assert isinstance(third.exception(), Interrupted)


@pytest.mark.parametrize(
    ("do", "error"),
    [
        (lambda r: r.axes["x"].disable(), Stopped),
        (lambda r: r.axes["x"].halt(), Stopped),
        (lambda r: r.axes["x"].move_absolute(20.0), Replaced),
        (lambda r: r.drive_of("x").fault(0x7500), DriveFault),
    ],
    ids=["disabled", "halted", "moved on", "in fault"],
)
def test_a_group_command_is_not_done_if_an_axis_that_had_ended_its_part_was_taken_away(do, error):
    r = rig("xy").enabled()
    handle = r.groups["all"].move_direct((1.0, 100.0))
    r.run(0.4)
    assert r.axes["x"].state is AxisState.STANDSTILL
    do(r)
    with pytest.raises(error, match="x"):
        handle.wait(5)


def test_a_later_command_of_one_axis_leaves_an_ended_group_command_done():
    r = rig("xy").enabled()
    handle = r.groups["all"].move_direct((1.0, 2.0))
    handle.wait(5)
    r.axes["x"].enable().wait(1)
    r.axes["x"].disable().wait(1)
    assert handle.exception() is None


def test_a_line_during_a_line_is_refused_and_the_line_continues():
    r = rig("xy").enabled()
    first = r.groups["all"].move_linear((30.0, 40.0), velocity=50.0)
    r.run(0.3)
    with pytest.raises(StateError, match="SynchronizedMotion"):
        r.groups["all"].move_linear((0.0, 0.0), velocity=50.0).wait(1)
    first.wait(5)
    assert r.drive_of("x").position == 30_000


def test_a_command_to_a_group_of_chosen_axes_leaves_the_others_alone():
    r = rig("xyz").enabled()
    watch = Watch(r, "y")
    r.group("z", "x").move_linear((10.0, 20.0), velocity=50.0).wait(5)
    assert (r.drive_of("z").position, r.drive_of("x").position) == (10_000, 20_000)
    assert watch.displacement < 1.0


# The fault policy and the gate.


def test_a_failure_stops_its_group_and_an_axis_outside_every_group_stops_the_cell():
    policy = FaultPolicy(("a", "b", "c", "d", "e"), {"left": ["a", "b"], "both": ["b", "c"]})
    assert policy.stops("a") == {"b"}
    assert policy.stops("b") == {"a", "c"}
    assert policy.stops("d") == {"a", "b", "c", "e"}
    assert FaultPolicy(("a", "b"), {}).stops("a") == {"b"}
    assert policy.all_stops(["a", "c"]) == {"b": "c"} or policy.all_stops(["a", "c"]) == {"b": "a"}


def test_a_fault_stops_the_moving_axes_of_its_group_and_no_others():
    r = rig("xyz", groups={"pair": ["x", "y"], "own": ["z"]}).enabled()
    moves = {name: axis.move_absolute(300.0, velocity=100.0) for name, axis in r.axes.items()}
    r.run(0.5)
    r.drive_of("x").fault(0x2310)
    r.run(1.5)
    assert isinstance(moves["y"].exception(), Stopped)
    assert "x" in str(moves["y"].exception())
    assert r.axes["y"].state is AxisState.STANDSTILL
    assert moves["z"].busy
    assert abs(r.drive_of("z").axis.motor.velocity) > 90_000


def quick_stop_for_want_of_a_statusword(r: Rig) -> None:
    port, until = r.ports["y"], r.now + 0.1
    read = port.read
    port.read = lambda now: read(now)._replace(statusword=None) if now < until else read(now)


def drive_that_switches_off(r: Rig) -> None:
    r.drive_of("y").power.force(9)


@pytest.mark.parametrize(
    ("cause", "why"),
    [
        (quick_stop_for_want_of_a_statusword, "its statusword (6041h) was missing during the halt"),
        (drive_that_switches_off, "its drive switched off by itself during the halt"),
    ],
    ids=["statusword missing", "drive off"],
)
def test_an_axis_that_lost_its_power_in_a_stop_of_the_policy_says_why(cause, why):
    """It is Disabled without an error of its own, so the error of its command must not say that it is enabled."""
    r = rig("xy").enabled()
    moving = r.axes["y"].move_absolute(300.0)
    r.run(0.5)
    r.drive_of("x").fault(0x2310)
    r.until(lambda: r.scan.axes["y"].stop_sequence is not None)
    cause(r)
    r.run(2.0)
    stopped = moving.exception()
    assert isinstance(stopped, Stopped)
    assert "if its stop has taken its power (it is Disabled), enable it" in stopped.remedy
    assert (r.axes["y"].state, r.axes["y"].error) == (AxisState.DISABLED, None)
    with pytest.raises(StateError, match="y is Disabled") as caught:
        r.axes["y"].move_absolute(0.0).wait(1)
    assert why in caught.value.observed
    assert "the last stop (y was stopped because x: " in caught.value.observed
    r.axes["x"].reset().wait(2)
    r.axes["y"].enable().wait(2)
    r.axes["y"].move_absolute(0.0).wait(5)
    r.axes["y"].disable().wait(2)
    with pytest.raises(StateError, match="y is Disabled") as caught:
        r.axes["y"].move_absolute(0.0).wait(1)
    assert caught.value.observed == ""


def test_a_drive_found_moving_is_not_stopped_by_the_policy():
    r = rig("xy")
    r.drive_of("y").start_enabled(3)
    r.drive_of("y").target_velocity = 20_000
    r.axes["x"].enable().wait(2)
    r.run(0.5)
    watch = Watch(r, "y")
    r.drive_of("x").fault(0x2310)
    r.run(1.0)
    assert watch.words == []
    assert r.drive_of("y").velocity == 20_000


def test_new_commands_wait_until_the_stop_of_the_policy_is_at_standstill():
    r = rig("xy").enabled()
    r.axes["y"].move_velocity(100.0).wait(2)
    r.drive_of("x").fault(0x2310)
    r.until(lambda: r.scan.axes["y"].stop_sequence is not None)
    with pytest.raises(StateError, match="being stopped"):
        r.axes["y"].move_velocity(-100.0).wait(1)
    r.until(lambda: r.scan.axes["y"].stop_sequence is None)
    r.axes["y"].move_absolute(0.0).wait(5)


def test_a_start_barrier_opens_in_the_cycle_after_all_expected_axes_were_waiting():
    gate = StartBarrier()
    a, b, c = object(), object(), object()
    assert not gate.pass_through(a)
    assert not gate.pass_through(a)
    gate.update(3)
    assert not gate.pass_through(a)
    assert not gate.pass_through(b)
    assert not gate.is_open
    gate.update(3)
    assert [gate.pass_through(one) for one in (a, b, c)] == [False] * 3
    gate.update(3)
    assert gate.is_open
    assert gate.pass_through(a)
    leaving = StartBarrier()
    assert not leaving.pass_through(a)
    leaving.update(1)  # the other needs no gate any more
    assert leaving.pass_through(a)


def test_an_axis_that_has_left_a_start_barrier_does_not_count_any_more():
    gate = StartBarrier()
    gone, here, coming = object(), object(), object()
    gate.pass_through(gone)
    gate.pass_through(here)
    gate.update(3)
    assert not gate.pass_through(here)
    gate.update(2)  # here and coming
    assert not gate.is_open
    gate.pass_through(here)
    gate.pass_through(coming)
    gate.update(2)
    assert gate.is_open


def test_a_closed_start_barrier_never_opens_and_an_open_one_is_not_closed():
    gate = StartBarrier()
    gate.pass_through(gate)
    gate.shut()
    gate.update(1)
    assert not gate.is_open
    OPEN.shut()
    assert OPEN.pass_through(gate)


# Paths, to the increment.


def targets_of(seen: dict[str, Watch]) -> list[tuple[float, ...]]:
    """The targets sent to the drives, cycle by cycle, in degrees."""
    columns = [[item.outputs.target_position for item in watch.sent] for watch in seen.values()]
    rows = zip(*columns, strict=True)
    return [tuple(value / 1000.0 for value in row) for row in rows if None not in row]


def test_every_target_of_a_line_lies_on_it_to_the_increment():
    r = rig("xyz").enabled()
    seen = watches(r)
    r.groups["all"].move_linear((90.0, -33.3, 12.34), velocity=150.0).wait(5)
    assert off_the_line(targets_of(seen), (0.0, 0.0, 0.0), (90.0, -33.3, 12.34)) < 0.001


def test_every_target_of_a_circle_lies_on_it_to_the_increment():
    r = rig("xy").enabled()
    seen = watches(r)
    r.groups["all"].move_circular((0.0, 0.0), centre=(25.0, 10.0), velocity=150.0).wait(5)
    radius = math.hypot(25.0, 10.0)
    targets = targets_of(seen)
    assert max(abs(math.dist(target, (25.0, 10.0)) - radius) for target in targets) < 0.001
    assert len(targets) > 100


@pytest.mark.parametrize("blend", [0.2, 3.0])
def test_every_target_of_a_path_lies_on_its_lines_or_within_the_blend_of_a_corner(blend):
    r = rig("xy").enabled()
    seen = watches(r)
    corners = [(0.0, 0.0), (60.0, 0.0), (60.0, 45.0), (10.0, 45.0)]
    r.groups["all"].move_path(corners[1:], velocity=150.0, blend=blend).wait(5)
    for target in targets_of(seen):
        lines = [off_the_line([target], a, b) for a, b in pairwise(corners)]
        assert min(lines) < 0.001 or min(math.dist(target, corner) for corner in corners[1:-1]) < 12.0 * blend
        assert min(lines) <= blend + 0.001
