"""A move that takes over from a trajectory, step by step: control of the axis before it begins, its stops, its time limit."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import pytest

from axisbus.errors import LimitError, MotionTimeout, StaleError
from axisbus.motion.group.start_barrier import OPEN, StartBarrier
from axisbus.motion.moves.coast_and_reset import Coast, ResetActivity
from axisbus.motion.moves.continuous_motion import Jog, TorqueMove, VelocityMove
from axisbus.motion.moves.csp_move import CspMove
from axisbus.motion.moves.enable import EnableActivity
from axisbus.motion.moves.follow import Follow
from axisbus.motion.moves.homing import HomingRun
from axisbus.motion.moves.position import PositionMove
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.parameters import AxisLimits
from axisbus.motion.trajectory import TrapezoidalTrajectory
from kit.motion.rig import Rig, rig
from kit.motion.steps import Drive

PROFILE = MoveProfile(20_000, 40, 40, 20_000.0, 40_000.0, None, 40_000.0, 40_000.0)
PERIOD = 0.01


def led(**changes) -> tuple[Drive, Follow]:
    """An axis that follows a trajectory at 20 deg/s."""
    drive = Drive(scan_period=PERIOD, **changes)
    follow = Follow(TrapezoidalTrajectory(0.0, 400.0, 20.0, 40.0), drive.parameters, OPEN)
    for _ in range(100):
        step(drive, follow)
    assert not follow.at_rest
    return drive, follow


def step(drive: Drive, activity) -> int | None:
    """One cycle later; the axis is where it was led to last."""
    for request in drive.order.sdo:
        drive.answers(request.id)
    led_to = drive.order.target_position
    place = {} if led_to is None and drive.image.position is not None else {"position": led_to or 0}
    activity.step(*drive.cycle(statusword=0x1237, mode=8, **place))
    return drive.order.target_position


def going_on(
    drive: Drive, before: Follow, target: int = 60_000, gate: StartBarrier = OPEN, **changes
) -> CspMove:
    return CspMove(target, PROFILE._replace(**changes), drive.parameters, gate, before)


def test_until_the_new_move_begins_the_trajectory_before_it_controls_the_axis():
    drive, before = led()
    gate = StartBarrier()
    move = going_on(drive, before, gate=gate)
    targets = [step(drive, move) for _ in range(10)]
    assert [b - a for a, b in pairwise(targets)] == [200] * 9
    assert move.last_step == before.last_step
    gate.update(1)
    assert gate.is_open
    after = [step(drive, move) for _ in range(10)]
    assert after[0] - targets[-1] == 200
    assert move.last_step != before.last_step
    for _ in range(1000):
        last = step(drive, move)
    assert last == 60_000


def test_while_a_move_waits_the_running_path_stops_in_time_for_the_deceleration_of_the_move():
    """From 20 deg/s it needs 100 deg to brake with 2 deg/s²; the axis had room for that when it was commanded."""
    drive, before = led(limits=AxisLimits(position=(-10.0, 400.0), velocity=400.0))
    gate = StartBarrier()
    move = going_on(drive, before, 399_000, gate, ramp=2_000.0, down=2_000.0)
    move.require_stop_within_limits(0)
    while not before.clock.braking:
        targets = [step(drive, move)]
        assert targets[0] < 310_000
    assert targets[0] == pytest.approx(300_000, abs=400)
    targets += [step(drive, move) for _ in range(300)]
    steps = [b - a for a, b in pairwise(targets)]
    assert max(abs(b - a) for a, b in pairwise(steps)) <= 55  # 500 deg/s²
    assert before.at_rest
    gate.update(0)
    while targets[-1] != 399_000:
        targets.append(step(drive, move))
        assert len(targets) < 20_000
    assert max(targets) <= 400_000


def test_a_path_that_brakes_because_it_got_too_fast_continues_as_the_move_once_that_has_room():
    drive, before = led(limits=AxisLimits(position=(-10.0, 400.0), velocity=400.0))
    gate = StartBarrier()
    move = going_on(drive, before, 399_000, gate, ramp=2_000.0, down=2_000.0)
    while not before.clock.braking:
        assert step(drive, move) < 310_000
    gate.update(0)
    targets = [step(drive, move) for _ in range(2000)]
    steps = [b - a for a, b in pairwise(targets)]
    assert max(abs(b - a) for a, b in pairwise(steps)) <= 55
    assert min(steps[:20]) > 100  # it need not stop before
    assert targets[-1] <= 400_000
    assert not before.at_rest


def test_a_move_that_replaces_a_waiting_move_continues_the_trajectory_before_both():
    drive, before = led()
    replaced = going_on(drive, before)
    move = going_on(drive, replaced, gate=StartBarrier())
    targets = [step(drive, move) for _ in range(10)]
    assert [b - a for a, b in pairwise(targets)] == [200] * 9
    assert move.last_step == before.last_step


def test_a_move_that_is_stopped_before_it_begins_never_begins():
    drive, before = led()
    gate = StartBarrier()
    move = going_on(drive, before, gate=gate)
    step(drive, move)
    gate.update(1)
    assert move.begin_braking()
    targets = [step(drive, move) for _ in range(100)]
    assert before.clock.braking
    assert before.at_rest
    assert move.at_rest
    assert 100 <= targets[-1] - targets[0] <= 400  # 500 deg/s²
    running = going_on(drive, led()[1])
    other, fresh = led()
    running = going_on(other, fresh)
    step(other, running)
    assert running.begin_braking()
    assert running.clock.braking
    assert not fresh.clock.braking


@pytest.mark.parametrize(("timeout", "told"), [(0.5, True), (30.0, False), (None, False)])
def test_a_following_move_has_the_time_that_the_caller_gives(timeout, told):
    drive, before = led()
    move = going_on(drive, before, timeout=timeout)
    began = drive.now

    def run() -> None:
        while drive.now - began < 2.0:
            step(drive, move)

    if not told:
        run()
        return
    with pytest.raises(MotionTimeout, match="has not arrived at 60 deg") as caught:
        run()
    assert drive.now - began == 0.5 + 2 / 64  # its first cycle begins the time
    assert "0.5 s has passed" in caught.value.observed


@pytest.mark.parametrize(
    ("room", "way", "fits"),
    [(50.0, 40.0, True), (40.0, 40.0, True), (39.99, 40.0, False), (5.1, 3.0, True), (4.9, 3.0, False)],
)
def test_a_following_move_needs_room_to_brake_within_the_limits(room, way, fits):
    """From 20 deg/s with 40 deg/s² it stops after 5 deg at the earliest."""
    drive, before = led()
    where = before.last_step.position
    limits = AxisLimits(position=(-10.0, where + room), velocity=400.0)
    drive.parameters = replace(drive.parameters, limits=limits)
    move = going_on(drive, before, round((where + way) * 1000))
    if fits:
        move.require_stop_within_limits(0)
        return
    with pytest.raises(LimitError, match="could not stop within the position limits"):
        move.require_stop_within_limits(0)


def turned(r: Rig) -> float:
    return r.drive.axis.motor.position / 1000.0


def test_on_the_plant_it_continues_without_a_jolt():
    r = rig().enabled()
    r.axis.follow(TrapezoidalTrajectory(0.0, 100.0, 20.0, 40.0))
    r.run(1.0)
    moved = r.axis.move_absolute(40.0, velocity=20.0, acceleration=40.0)
    speeds = []
    for _ in range(50):
        before = turned(r)
        r.run(PERIOD)
        speeds.append((turned(r) - before) / PERIOD)
    assert min(speeds) > 19.0
    assert max(speeds) < 21.0
    moved.wait(5)
    assert turned(r) == pytest.approx(40.0, abs=0.05)


@pytest.mark.parametrize(
    ("activity", "mode", "keeps_moving", "clears_error", "ends_at_rest"),
    [
        (EnableActivity, None, False, False, False),
        (Coast, None, False, False, False),
        (ResetActivity, None, False, True, False),
        (PositionMove, 1, False, False, True),
        (VelocityMove, 3, True, False, False),
        (TorqueMove, 4, True, False, False),
        (HomingRun, 6, False, False, True),
        (Follow, 8, False, False, True),
        (CspMove, 8, False, False, True),
        (Jog, 3, True, False, False),
    ],
)
def test_mode_and_end_conditions_of_each_activity(activity, mode, keeps_moving, clears_error, ends_at_rest):
    assert (activity.mode, activity.keeps_moving, activity.clears_error, activity.ends_at_rest) == (
        *(mode, keeps_moving, clears_error, ends_at_rest),
    )


def test_a_planned_trajectory_begins_at_the_demand_or_else_at_the_actual_position():
    drive = Drive(scan_period=PERIOD)
    follow = Follow(None, drive.parameters, OPEN)
    assert follow.reference(drive.cycle(statusword=0x1237, mode=1, position=500, demand=510)[0]) == 510
    assert follow.reference(drive.cycle(demand=None)[0]) == 500
    with pytest.raises(StaleError):
        follow.reference(drive.cycle(position=None)[0])


def test_an_axis_has_two_seconds_to_reach_the_end_of_its_trajectory():
    drive = Drive(scan_period=PERIOD)
    follow = Follow(TrapezoidalTrajectory(0.0, 1.0, 20.0, 40.0), drive.parameters, OPEN)
    ended = None
    with pytest.raises(MotionTimeout, match="the axis does not reach the end of its trajectory, 1 deg"):
        for _ in range(400):
            for request in drive.order.sdo:
                drive.answers(request.id)
            assert not follow.step(*drive.cycle(statusword=0x1237, mode=8, position=0))
            if ended is None and drive.order.target_position == 1000:
                ended = drive.now
    assert drive.now - ended == 2.0 + 1 / 64


@pytest.mark.parametrize(("position", "arrived"), [(992, False), (993, True), (1007, True), (1008, False)])
def test_a_move_has_arrived_when_the_axis_is_at_standstill_within_its_window(position, arrived):
    drive = Drive(scan_period=PERIOD, position_window=7)
    follow = Follow(TrapezoidalTrajectory(0.0, 1.0, 20.0, 40.0), drive.parameters, OPEN)
    for _ in range(60):
        for request in drive.order.sdo:
            drive.answers(request.id)
        assert not follow.step(*drive.cycle(statusword=0x1237, mode=8, position=0))
    ends = [follow.step(*drive.cycle(statusword=0x1237, position=position)) for _ in range(8)]
    assert ends == [False] * 4 + [arrived] * 4
