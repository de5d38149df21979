"""Leaving the set-points of the master for a move of the drive: the drive's own ramp must end within the position limits."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from axisbus.motion.moves.mode_exit import PathExit
from axisbus.motion.parameters import AxisLimits
from axisbus.motion.position_limits import PositionRange
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.motion.plant_recorder import Watch
from kit.motion.rig import PERIOD, rig

T = 0.0625
BOUNDED = AxisLimits(position=(-100.0, 100.0), velocity=400.0, acceleration=4000.0)


def path() -> SimpleNamespace:
    return SimpleNamespace(at_rest=False, last_step=(0.0, 0.0), permitted_range=PositionRange(-100.0, 100.0))


def answers(steps, down: float = 40.0, soft: float = 0.0) -> list[bool]:
    """Whether it may leave after each step of a path (position, velocity)."""
    led = path()
    check, found = PathExit(led, down, soft, T, 0.001), []
    for step in steps:
        led.last_step = step
        found.append(check(None))
    return found


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize(("at", "fits"), [(91.25, True), (91.26, False)])
def test_a_path_at_an_even_speed_continues_for_three_periods_before_the_drive_brakes(sign, at, fits):
    """At 20: 3.75 in three periods, and 5 to brake."""
    steps = [(sign * (at - 1.25), sign * 20.0), (sign * at, sign * 20.0)]
    assert answers(steps)[-1] is fits


@pytest.mark.parametrize(("at", "fits"), [(84.8, True), (84.9, False)])
def test_a_path_that_accelerates_is_checked_with_the_velocity_that_it_will_have(at, fits):
    """From 20 with 40/s²: 27.5 after three periods and 4.45, and 9.45 to brake; the position itself is 1.25 further than before."""
    steps = [(at, 17.5), (at + 1.25, 20.0)]
    assert answers(steps)[-1] is fits


@pytest.mark.parametrize(("at", "fits"), [(94.9, True), (95.1, False)])
def test_of_a_path_that_brakes_harder_the_set_point_counts_that_the_drive_still_has(at, fits):
    """Two set-points ago: 20, and 5 to brake. The newest one would leave much room."""
    steps = [(at, 20.0), (at + 0.3, 5.0), (at + 0.35, 1.0)]
    assert answers(steps)[-1] is fits
    assert answers([*steps, (at + 0.36, 0.1)])[-1] is True


def test_a_jerk_limit_delays_braking():
    steps = [(85.0, 20.0), (86.25, 20.0)]
    assert answers(steps)[-1] is True
    assert answers(steps, soft=0.25)[-1] is True
    assert answers(steps, soft=0.26)[-1] is False


def test_the_end_of_a_path_at_its_limit_is_no_overrun_after_rounding():
    assert answers([(100.0000001, 0.0)])[-1] is True
    assert answers([(99.0, 1e-9), (100.0005, 1e-9)])[-1] is True
    led = path()
    led.at_rest = True
    assert PathExit(led, 1.0, 0.0, T, 0.001)(None) is True


# On the plant.


@pytest.mark.parametrize("late", [0.0, 0.02, 0.04, 0.06, 0.08])
@pytest.mark.parametrize("target", [0.0, 99.0])
def test_a_weak_move_that_a_path_gets_too_fast_for_stays_within_the_limits(late, target):
    """The path needs 10 deg to brake from 200 deg/s, and the move would need 100. It is given while the path is slow."""
    r = rig(limits=BOUNDED).enabled()
    r.axis.follow(TrapezoidalTrajectory(0.0, 100.0, 200.0, 2000.0))
    r.until(lambda: r.drive.position > 100)
    r.run(late)
    watch = Watch(r)
    moved = r.axis.move_absolute(target, velocity=50.0, acceleration=200.0, deceleration=200.0, jerk=40_000.0)
    r.run(0.5)
    if moved.exception() is None:  # else it was refused at once, and the path continues
        moved.wait(20)
        assert abs(r.drive.axis.motor.position - target * 1000) < 60
    assert max(row.position for row in watch.rows) <= 100_050
    assert r.axis.state is AxisState.STANDSTILL


@pytest.mark.parametrize("late", [0.0, 0.02, 0.04, 0.06, 0.08])
def test_a_weak_move_out_of_csv_stays_within_the_limits(late):
    r = rig(limits=BOUNDED).enabled()
    r.axis.home(37).wait(3)
    r.axis.cyclic_velocity(200.0, acceleration=2000.0, deceleration=2000.0)
    r.until(lambda: r.drive.position > 30_000)
    r.run(late)
    watch = Watch(r)
    moved = r.axis.move_absolute(0.0, velocity=50.0, acceleration=400.0, deceleration=400.0, jerk=80_000.0)
    r.run(PERIOD)
    r.run(5.0)
    assert max(row.position for row in watch.rows) <= 100_050
    assert r.axis.state in (AxisState.STANDSTILL, AxisState.ERRORSTOP), moved
