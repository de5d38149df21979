"""Segments of a path by samples: the values between them, their bounds, and the axes' limits along it."""

from __future__ import annotations

import math
import random
from itertools import pairwise
from types import SimpleNamespace

import pytest

from axisbus import Delta, Scara
from axisbus.errors import LimitError
from axisbus.ipc.messages import CODEC
from axisbus.machine.user_kinematics.kinematics import UserKinematicsAdapter
from axisbus.machine.user_kinematics.sampling import Sampling
from axisbus.motion.group.path import CycleVelocity, build_path
from axisbus.motion.group.path_builder import arc_through, polyline
from axisbus.motion.group.path_speed import PathSpeed
from axisbus.motion.group.sampled_segment import sampled_segment_of, surveyed
from axisbus.motion.group.segments import Straight
from axisbus.motion.override import MAX_OVERRIDE
from axisbus.motion.parameters import AxisLimits
from axisbus.motion.point_stream.curve_fit import Motion

PERIOD = 0.004
ARM, ROBOT = Scara(200.0, 150.0), Delta(100.0, 40.0, 120.0, 280.0)


class Plugged:
    """A machine of the core, as a program would bring it."""

    def __init__(self, machine):
        self.machine = machine

    def forward(self, joints):
        return self.machine.forward(tuple(joints))

    def inverse(self, coordinates, near):
        del near
        return self.machine.inverse(coordinates)


def axes(count, increment=0.01):
    limits = SimpleNamespace(position=None)
    return {
        name: SimpleNamespace(
            room_from=lambda _: None, increment=increment, start_tolerance=0.1, unit="deg", limits=limits
        )
        for name in "abc"[:count]
    }


def sampled(machine, base, stops=(), increment=0.01):
    start = machine.inverse(base[0].at(0.0))
    own = UserKinematicsAdapter(Plugged(machine), axes(len(start), increment), None)
    return Sampling(own, base, stops, start, "a.move_path").sampled_segments()


def places(machine, rng, count):
    if machine is ARM:
        spots = [(rng.uniform(120.0, 300.0), math.radians(rng.uniform(-80.0, 80.0))) for _ in range(count)]
        return [(r * math.cos(t), r * math.sin(t)) for r, t in spots]
    return [(rng.uniform(-80, 80), rng.uniform(-80, 80), rng.uniform(-300, -220)) for _ in range(count)]


def made(machine, seed):
    """A random path of pieces, with its stops."""
    rng = random.Random(seed)
    if seed % 4 == 3:
        return [arc_through(*places(machine, rng, 3))], set()
    return polyline(places(machine, rng, rng.choice([2, 4])), rng.choice([0.0, 3.0, 25.0]))


@pytest.mark.parametrize("machine", [ARM, ROBOT], ids=["scara", "delta"])
@pytest.mark.parametrize("seed", range(40))
def test_a_tabled_path_stays_on_the_path_and_within_the_limits_of_the_axes(machine, seed):
    base, stops = made(machine, seed)
    try:
        pieces = sampled(machine, base, stops)
    except LimitError:
        return  # a circle may be out of reach
    for piece, path in zip(pieces, base, strict=True):
        for n in range(301):
            joints = piece.at(path.length * n / 300)
            lever = 2.0 * math.radians(0.01) * 350.0
            assert math.dist(machine.forward(joints), path.at(path.length * n / 300)) < lever
    rng = random.Random(seed)
    count = len(pieces[0].at(0.0))
    limits = [
        AxisLimits(velocity=rng.choice([90.0, 200.0]), acceleration=rng.choice([400.0, 2000.0]))
        for _ in range(count)
    ]
    velocity, acceleration = rng.choice([50.0, 400.0]), rng.choice([300.0, 3000.0])
    way = build_path(pieces, limits, acceleration, stops, CycleVelocity(velocity, PERIOD))
    travel, found = PathSpeed(), [way.at(0.0)]
    travel.begin(way, velocity)
    while travel.t < way.length and len(found) < 40_000:
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


@pytest.mark.parametrize("seed", [0, 1, 2, 4])
def test_neither_slope_nor_bend_jumps_at_a_transition_without_a_stop(seed):
    base, stops = made(ARM, seed)
    pieces = sampled(ARM, base, stops)
    for number, (before, behind) in enumerate(pairwise(pieces)):
        if number in stops:
            continue
        assert before.row(before.count) == behind.row(0)
    for piece, path in zip(pieces, base, strict=True):
        h = 1e-4 * path.length
        if h == 0.0:
            continue
        for part in (0.1, 0.5, 0.77):
            s = part * path.length
            first, last = (ARM.inverse(path.at(s + by)) for by in (-h, h))
            mine = [piece.at(s + by) for by in (-h, h)]
            for axis in range(2):
                slope, own = (last[axis] - first[axis]) / (2 * h), (mine[1][axis] - mine[0][axis]) / (2 * h)
                assert own == pytest.approx(slope, abs=2e-3 + 2e-3 * abs(slope))


@pytest.mark.parametrize("increment", [1.0, 0.01, 1e-5])
def test_a_tabled_path_is_as_fine_as_the_increments(increment):
    line = [Straight((200.0, 150.0), (150.0, -220.0), math.dist((200.0, 150.0), (150.0, -220.0)))]
    (piece,) = sampled(ARM, line, increment=increment)
    off = max(
        math.dist(ARM.forward(piece.at(s)), line[0].at(s))
        for s in (line[0].length * n / 997 for n in range(998))
    )
    assert off <= 1.2 * math.radians(increment) * 350.0
    assert piece.count <= {1.0: 8, 0.01: 32, 1e-5: 256}[increment]


def test_the_bounds_of_a_section_cover_more_than_its_samples():
    rows = [(Motion(0.0, 3.0, 0.0),), (Motion(0.0, 3.0, 0.0),)]  # there and back between two samples
    piece = sampled_segment_of(2.0, rows, (0.0,))
    (part,) = surveyed(piece)
    values = [piece.at(2.0 * n / 200)[0] for n in range(201)]
    assert part.low[0] <= min(values) < -0.2
    assert part.high[0] >= max(values) > 0.2
    assert part.speed_ratios[0] >= 3.0
    assert part.acceleration_ratios[0] > 1.0


def test_a_segment_of_no_length_is_constant_and_segments_are_transferred_unchanged():
    here = [(Motion(1.0, 0.0, 0.0), Motion(2.0, 0.0, 0.0))] * 3
    still = sampled_segment_of(0.0, here, (0.0,))
    assert still.at(0.0) == still.at(1.0) == (1.0, 2.0)
    assert still.box == ((1.0, 2.0), (1.0, 2.0))
    (piece,) = sampled(ARM, [Straight((200.0, 150.0), (150.0, -220.0), 373.3630940518894)])
    way = build_path([piece], [AxisLimits()] * 2, 10.0)
    assert CODEC.unpack(CODEC.pack(way)) == way
    assert piece.at(-1.0) == piece.at(0.0)
    assert piece.at(1e9) == pytest.approx(piece.at(piece.length))


def test_a_section_of_many_intervals_has_their_highest_values():
    rows = [
        (Motion(math.sin(0.3 * n), 0.3 * math.cos(0.3 * n), -0.09 * math.sin(0.3 * n)),) for n in range(101)
    ]
    curved = tuple(0.01 * n for n in range(100))
    found = surveyed(sampled_segment_of(100.0, rows, curved))
    assert len(found) == 34
    assert sum(part.length for part in found) == pytest.approx(100.0)
    for number, part in enumerate(found):
        near = [0.3 * (3 * number + 0.01 * n) for n in range(301) if 3 * number + 0.01 * n <= 100.0]
        assert part.curvature == curved[min(3 * number + 2, 99)]
        assert part.low[0] <= min(map(math.sin, near)) + 1e-3
        assert part.high[0] >= max(map(math.sin, near)) - 1e-3
        for bound, values in (
            (part.speed_ratios, [0.3 * math.cos(t) for t in near]),
            (part.acceleration_ratios, [0.09 * math.sin(t) for t in near]),
        ):
            highest = max(map(abs, values))
            assert highest - 2e-3 <= bound[0] <= 1.1 * highest + 2e-3
