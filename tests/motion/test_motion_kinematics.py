"""Kinematics: forward and inverse, geometry by hand, and the limits of the axes along paths in the workspace."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus import CoreXY, Delta, Scara
from axisbus.ipc.messages import CODEC
from axisbus.motion.group.kinematic_segment import KinematicSegment, survey
from axisbus.motion.group.path import CycleVelocity, JerkLimit, build_path
from axisbus.motion.group.path_builder import arc_through, polyline, window
from axisbus.motion.group.path_speed import PathSpeed
from axisbus.motion.group.segments import Straight
from axisbus.motion.override import MAX_OVERRIDE
from axisbus.motion.parameters import AxisLimits

SAME = settings(deadline=None, derandomize=True)
ARM, ROBOT, BELT = Scara(200.0, 150.0), Delta(100.0, 40.0, 120.0, 280.0), CoreXY()
PERIOD = 0.004


@SAME
@given(st.floats(-179.0, 179.0), st.floats(1.0, 179.0), st.booleans(), st.floats(-720.0, 720.0))
def test_an_arm_finds_back_to_its_angles(shoulder, elbow, left, middle):
    arm = Scara(200.0, 150.0, left=left, middle=middle)
    angles = (middle + shoulder, elbow if left else -elbow, 7.0)
    assert arm.inverse(arm.forward(angles)) == pytest.approx(angles, abs=1e-5)


@SAME
@given(*[st.floats(-30.0, 70.0)] * 3)
def test_a_delta_finds_back_to_its_angles_and_its_forearms_keep_their_length(a, b, c):
    angles = (a, b, c)
    x, y, z = ROBOT.forward(angles)
    assert ROBOT.inverse((x, y, z)) == pytest.approx(angles, abs=1e-5)
    for number, angle in enumerate(angles):
        turn, down = math.radians(120.0 * number), math.radians(angle)
        knee = 100.0 + 120.0 * math.cos(down)
        plate = (x + 40.0 * math.cos(turn), y + 40.0 * math.sin(turn), z)
        joint = (knee * math.cos(turn), knee * math.sin(turn), -120.0 * math.sin(down))
        assert math.dist(plate, joint) == pytest.approx(280.0, abs=1e-6)


def test_machines_by_hand():
    assert ARM.forward((0.0, 0.0)) == pytest.approx((350.0, 0.0))
    assert ARM.forward((90.0, -90.0, 5.0)) == pytest.approx((150.0, 200.0, 5.0))
    assert Scara(200.0, 150.0, left=False).inverse((200.0, -150.0)) == pytest.approx((0.0, -90.0))
    assert BELT.inverse((3.0, 1.0, 9.0)) == (4.0, 2.0, 9.0)
    assert BELT.forward((4.0, 2.0)) == (3.0, 1.0)
    assert ROBOT.forward((10.0, 10.0, 10.0))[:2] == pytest.approx((0.0, 0.0), abs=1e-9)
    assert ROBOT.forward((30.0, 30.0, 30.0))[2] < ROBOT.forward((0.0, 0.0, 0.0))[2]


@pytest.mark.parametrize(
    ("machine", "place"),
    [(ARM, (350.1, 0.0)), (ARM, (10.0, 10.0)), (ROBOT, (0.0, 0.0, -500.0)), (ROBOT, (300.0, 0.0, -200.0))],
)
def test_a_pose_out_of_reach_is_reported(machine, place):
    with pytest.raises(ValueError, match="out of the arm"):
        machine.inverse(place)


def test_arms_that_do_not_meet_are_reported():
    with pytest.raises(ValueError, match="do not meet"):
        Delta(300.0, 40.0, 120.0, 100.0).forward((0.0, 0.0, 0.0))


@pytest.mark.parametrize(
    ("machine", "axes"),
    [
        (Delta(100.0, 100.0, 120.0, 200.0), (90.0, 90.0, 90.0)),  # all knees in the middle
        (Delta(100.0, 100.0, 120.0, 200.0), (90.0, 90.0, 0.0)),
        (Delta(100.0, 40.0, 60.0, 200.0), (180.0, 180.0, 180.0)),
    ],
)
def test_arms_that_could_meet_at_many_points_are_reported(machine, axes):
    with pytest.raises(ValueError, match=r"the arms|two arms"):
        machine.forward(axes)


def places(machine: Scara | Delta | CoreXY, rng: random.Random, count: int) -> list[tuple[float, ...]]:
    if isinstance(machine, Scara):
        spots = [(rng.uniform(120.0, 300.0), math.radians(rng.uniform(-80.0, 80.0))) for _ in range(count)]
        return [(r * math.cos(t), r * math.sin(t)) for r, t in spots]
    if isinstance(machine, Delta):
        return [(rng.uniform(-80, 80), rng.uniform(-80, 80), rng.uniform(-300, -220)) for _ in range(count)]
    return [(rng.uniform(-99, 99), rng.uniform(-99, 99)) for _ in range(count)]


@pytest.mark.parametrize("machine", [ARM, ROBOT, BELT], ids=["scara", "delta", "corexy"])
@pytest.mark.parametrize("seed", range(40))
def test_on_a_workspace_path_no_axis_exceeds_its_velocity_or_acceleration(machine, seed):
    rng = random.Random(seed)
    stops: set[int] = set()
    if seed % 4 == 3:
        base = [arc_through(*places(machine, rng, 3))]
    else:
        base, stops = polyline(places(machine, rng, rng.choice([2, 4])), rng.choice([0.0, 3.0, 25.0]))
    segments = [KinematicSegment(segment, machine) for segment in base]
    try:
        for segment in segments:
            survey(segment)
    except ValueError:
        return  # a circle may be out of reach
    axes = len(segments[0].at(0.0))
    limits = [
        AxisLimits(velocity=rng.choice([90.0, 200.0]), acceleration=rng.choice([400.0, 2000.0]))
        for _ in range(axes)
    ]
    velocity, acceleration = rng.choice([50.0, 400.0]), rng.choice([300.0, 3000.0])
    way = build_path(segments, limits, acceleration, stops, CycleVelocity(velocity, PERIOD))
    travel, found = PathSpeed(), [way.at(0.0)]
    travel.begin(way, velocity)
    while travel.t < way.length and len(found) < 20_000:
        if rng.random() < 0.02:
            travel.factor = rng.choice([0.2, 1.0, MAX_OVERRIDE])
        travel.advance(PERIOD)
        found.append(way.at(travel.t))
    assert travel.t == way.length
    for number, limit in enumerate(limits):
        speeds = [(b[number] - a[number]) / PERIOD for a, b in pairwise(found)]
        rates = [(b - a) / PERIOD for a, b in pairwise([0.0, *speeds, 0.0])]
        assert max(map(abs, speeds)) <= limit.velocity * (1 + 1e-6)
        assert max(map(abs, rates)) <= limit.acceleration * (1 + 1e-6)


@pytest.mark.parametrize("machine", [ARM, ROBOT, BELT], ids=["scara", "delta", "corexy"])
@pytest.mark.parametrize("seed", range(30))
def test_softly_neither_the_tool_is_more_sudden_nor_an_axis_faster_or_harder_than_it_may_be(machine, seed):
    """Lines with stops and rounded corners, under an override; the jerk is that of the tool, by the differences of its places."""
    rng = random.Random(seed)
    base, stops = polyline(places(machine, rng, rng.choice([2, 4])), rng.choice([0.0, 3.0, 25.0]))
    segments = [KinematicSegment(segment, machine) for segment in base]
    axes = len(segments[0].at(0.0))
    limits = [
        AxisLimits(velocity=rng.choice([90.0, 200.0]), acceleration=rng.choice([400.0, 2000.0]))
        for _ in range(axes)
    ]
    velocity, acceleration = rng.choice([50.0, 400.0]), rng.choice([300.0, 3000.0])
    cycle = CycleVelocity(velocity, PERIOD)
    hardest = max(build_path(segments, limits, acceleration, stops, cycle).ramps)
    jerk = hardest * rng.choice([4.5, 20.0, 100.0])
    cycles = window(hardest, jerk, PERIOD, "way")
    soft = JerkLimit(jerk, cycles * PERIOD, hardest, MAX_OVERRIDE * velocity)
    way = build_path(segments, limits, acceleration, stops, cycle, soft)
    travel, found, tool = PathSpeed(), [way.at(0.0)] * 4, [base[0].at(0.0)] * 4
    travel.begin(way, velocity, window=cycles)
    while travel.t < way.length and len(found) < 30_000:
        if rng.random() < 0.02:
            travel.factor = rng.choice([0.2, 1.0, MAX_OVERRIDE])
        travel.advance(PERIOD)
        found.append(way.at(travel.t))
        segment, gone = way.segment(travel.t)
        tool.append(segment.base.at(gone))
    assert travel.t == way.length
    found += [found[-1]] * 3
    tool += [tool[-1]] * 3
    for number, limit in enumerate(limits):
        speeds = [(b[number] - a[number]) / PERIOD for a, b in pairwise(found)]
        rates = [(b - a) / PERIOD for a, b in pairwise(speeds)]
        assert max(map(abs, speeds)) <= limit.velocity * (1 + 1e-6)
        assert max(map(abs, rates)) <= limit.acceleration * (1 + 1e-6)
    for _ in range(3):
        tool = [tuple((q - p) / PERIOD for p, q in zip(a, b, strict=True)) for a, b in pairwise(tool)]
    assert 0.05 * jerk < max(math.hypot(*row) for row in tool) <= jerk * (1 + 1e-3)


class Bump:
    """A machine whose second axis is fast for a short while, about 0."""

    characteristic_length = 100.0

    def forward(self, joints: tuple[float, ...]) -> tuple[float, ...]:
        return (joints[0],)

    def inverse(self, coordinates: tuple[float, ...]) -> tuple[float, ...]:
        return coordinates[0], 20.0 * math.tanh(coordinates[0] / 5.0)


@pytest.mark.parametrize("jerk", [4100.0, 20_000.0, 100_000.0])
@pytest.mark.parametrize("hard", [None, 1000.0])
def test_a_jerk_limited_path_keeps_limits_that_an_axis_reaches_briefly(hard, jerk):
    """It is slow there, and in time before and after: the targets of the axes are a mean."""
    limits, velocity, acceleration = [AxisLimits(velocity=400.0, acceleration=hard)] * 2, 600.0, 1000.0
    segment = KinematicSegment(Straight((-100.0,), (100.0,), 200.0), Bump())
    cycles = window(acceleration, jerk, PERIOD, "line")
    soft = JerkLimit(jerk, cycles * PERIOD, acceleration, MAX_OVERRIDE * velocity)
    way = build_path([segment], limits, acceleration, (), CycleVelocity(velocity, PERIOD), soft)
    travel, found = PathSpeed(), [way.at(0.0)] * 3
    travel.begin(way, velocity, window=cycles)
    while travel.t < way.length:
        travel.advance(PERIOD)
        found.append(way.at(travel.t))
    rates = []
    for number in range(2):
        speeds = [(b[number] - a[number]) / PERIOD for a, b in pairwise(found)]
        rates += [abs(b - a) / PERIOD for a, b in pairwise(speeds)]
        assert max(map(abs, speeds)) <= 400.0 * (1 + 1e-6)
    assert hard is None or 0.4 * hard < max(rates) <= hard * (1 + 1e-6)
    assert hard is not None or max(map(abs, speeds)) > 0.8 * 400.0


def test_a_line_too_near_to_the_centre_is_refused():
    straight = Scara(150.0, 150.0)
    with pytest.raises(ValueError, match="too near to a jump"):
        survey(KinematicSegment(Straight((200.0, 0.05), (-200.0, 0.05), 400.0), straight))


@pytest.mark.parametrize("beside", [0.0, 0.3, 1.0, 3.0, 10.0, 40.0])
@pytest.mark.parametrize("length", [0.5, 1.0, 10.0, 60.0])
def test_near_stretched_arms_a_line_keeps_the_limits_or_is_refused(beside, length):
    """The arms of 350 mm begin ``beside`` mm from stretched; there the axes' parts of the speed grow without bound."""
    reach = 350.0 - beside
    segment = KinematicSegment(Straight((reach, 0.0), (reach - length, 0.0), length), ARM)
    limits = [AxisLimits(velocity=200.0, acceleration=600.0)] * 2
    try:
        survey(segment)
    except ValueError:
        assert beside <= 1.0
        return
    assert beside > 0.0
    way = build_path([segment], limits, 400.0, (), CycleVelocity(40.0, 0.002))
    travel, found = PathSpeed(), [way.at(0.0)] * 2
    travel.begin(way, 40.0)
    while travel.t < way.length:
        travel.advance(0.002)
        found.append(way.at(travel.t))
    for number in range(2):
        speeds = [(b[number] - a[number]) / 0.002 for a, b in pairwise(found)]
        rates = [abs(b - a) / 0.002 for a, b in pairwise([*speeds, 0.0])]
        assert max(map(abs, speeds)) <= 200.0 * (1 + 1e-6)
        assert max(rates) <= 600.0 * (1 + 1e-6)


def test_pieces_cross_to_the_core_as_they_are():
    for machine in (ARM, ROBOT, BELT):
        segment = KinematicSegment(Straight((1.0, 2.0), (3.0, 4.0), math.sqrt(8.0)), machine)
        assert (
            CODEC.unpack(
                CODEC.pack(build_path([KinematicSegment(segment.base, BELT)], [AxisLimits()] * 2, 10.0))
            )
            .segments[0]
            .base
            == segment.base
        )
        assert CODEC.unpack(CODEC.pack(machine)) == machine
