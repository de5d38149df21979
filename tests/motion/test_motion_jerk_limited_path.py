"""Paths with a limit of jerk: their results by the differences of positions, over all axes, for any override."""

from __future__ import annotations

import math
import random
from itertools import pairwise, product
from typing import NamedTuple

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from axisbus.motion.group.path import (
    CycleVelocity,
    JerkLimit,
    Path,
    SpeedZone,
    build_path,
    jerk_limited_corner,
)
from axisbus.motion.group.path_builder import polyline, window
from axisbus.motion.group.path_speed import PathSpeed
from axisbus.motion.group.segments import corner
from axisbus.motion.parameters import AxisLimits

Places = list[tuple[float, ...]]
SQUARE: Places = [(0.0, 0.0), (60.0, 0.0), (60.0, 60.0), (0.0, 60.0), (20.0, 20.0)]
NARROW, SOME = AxisLimits(velocity=30.0, acceleration=150.0), AxisLimits(velocity=90.0, acceleration=400.0)


class Softly(NamedTuple):
    """A path, the number of cycles of its mean, and the positions of a trip along it, at standstill before and after."""

    way: Path
    window: int
    places: Places

    def highest(self, order: int, period: float) -> float:
        """The highest difference of an order, over all axes."""
        return max(math.hypot(*row) for row in differences(self.places, order, period))

    def highest_of(self, number: int, order: int, period: float) -> float:
        """That of one axis."""
        return max(abs(row[number]) for row in differences(self.places, order, period))


def differences(rows: Places, order: int, period: float) -> Places:
    for _ in range(order):
        rows = [tuple((q - p) / period for p, q in zip(a, b, strict=True)) for a, b in pairwise(rows)]
    return rows


def planned(
    points: Places,
    blend: float,
    limits: list[AxisLimits],
    velocity: float,
    hard: float,
    jerk: float,
    t: float,
) -> tuple[Path, int]:
    pieces, stops = polyline(points, blend)
    cycle = CycleVelocity(velocity, t)
    hardest = max(build_path(pieces, limits, hard, stops, cycle).ramps)
    cycles = window(hardest, jerk, t, "path")
    return build_path(pieces, limits, hard, stops, cycle, JerkLimit(jerk, cycles * t, hardest)), cycles


def gone(way: Path, cycles: int, velocity: float, t: float, factors: tuple[float, ...] = ()) -> Softly:
    travel, chance = PathSpeed(), random.Random(cycles)
    travel.begin(way, velocity, 0.0, cycles)
    places = [way.at(0.0)] * 4
    while travel.t < way.length:
        if factors and chance.random() < 0.03:
            travel.factor = chance.choice(factors)
        travel.advance(t)
        places.append(way.at(travel.t))
        assert len(places) < 100_000
    return Softly(way, cycles, [*places, *[way.at(way.length)] * 4])


@settings(deadline=None, derandomize=True, max_examples=150)
@given(
    st.integers(1, 3).flatmap(
        lambda n: st.lists(st.tuples(*[st.floats(-60.0, 60.0)] * n), min_size=2, max_size=7)
    ),
    st.sampled_from([0.0, 0.3, 3.0, 20.0]),
    st.lists(st.sampled_from([AxisLimits(), NARROW, SOME]), min_size=3, max_size=3),
    st.floats(30.0, 300.0),
    st.floats(100.0, 3000.0),
    st.floats(0.02, 0.45),
    st.sampled_from([0.004, 0.01]),
    st.sampled_from([(), (0.3, 1.0, 1.5), (0.05, 1.5)]),
)
def test_no_path_exceeds_velocity_acceleration_or_jerk(
    points, blend, limits, velocity, hard, mean, period, factors
):
    limits = limits[: len(points[0])]
    jerk = 2.0 * hard / mean
    way, cycles = planned(points, blend, limits, velocity, hard, jerk, period)
    assume(way.length > 1e-3)  # else there is nothing to be gone along
    trip = gone(way, cycles, velocity, period, factors)
    noise = 1e-11
    assert trip.highest(1, period) <= 1.5 * velocity * (1 + 1e-6)
    assert trip.highest(2, period) <= hard * (1 + 1e-6) + noise / period**2
    assert trip.highest(3, period) <= jerk * (1 + 1e-6) + noise / period**3
    for number, limit in enumerate(limits):
        if limit.velocity is not None:
            assert trip.highest_of(number, 1, period) <= limit.velocity * (1 + 1e-6) + noise / period
            assert trip.highest_of(number, 2, period) <= limit.acceleration * (1 + 1e-6) + noise / period**2
    assert trip.places[-1] == pytest.approx(points[-1], abs=1e-6)


@pytest.mark.parametrize("tiny", [1e-3, 1e-6, 5e-8, 2e-8, 1e-8])
@pytest.mark.parametrize("blend", [0.0, 0.3])
def test_a_tiny_line_is_still_a_segment_of_the_path(tiny, blend):
    points = [(0.0, 0.0), (0.0, -tiny), (1.0, 14.0), (1.0, 14.0 + tiny), (9.0, 14.0)]
    way, cycles = planned(points, blend, [AxisLimits()] * 2, 30.0, 100.0, 800.0, 0.004)
    trip = gone(way, cycles, 30.0, 0.004)
    assert trip.places[-1] == pytest.approx(points[-1], abs=1e-6)
    assert trip.highest(2, 0.004) <= 100.0 * (1 + 1e-6)


def test_the_allowed_jerk_is_used_in_corners():
    way, cycles = planned(SQUARE, 3.0, [AxisLimits()] * 2, 120.0, 500.0, 5000.0, 0.004)
    trip = gone(way, cycles, 120.0, 0.004)
    assert 0.9 * 5000.0 < trip.highest(3, 0.004) <= 5000.0 * (1 + 1e-6)
    through = min(math.hypot(*row) for row in differences(trip.places, 1, 0.004)[100:-100])
    assert through > 10.0  # and no corner is stopped at


@pytest.mark.parametrize(
    ("turn", "length", "blend", "hard", "mean"),
    [(0.32, 60.0, 0.05, 2000.0, 0.45), (0.2, 20.0, 0.3, 200.0, 0.45)],
)
def test_the_limits_of_a_short_corner_apply_before_and_after_it_within_the_mean(
    turn, length, blend, hard, mean
):
    points = [(0.0, 0.0), (length, 0.0), (length * (1.0 + math.cos(turn)), length * math.sin(turn))]
    jerk = 2.0 * hard / mean
    trip = gone(*planned(points, blend, [AxisLimits()] * 2, 200.0, hard, jerk, 0.004), 200.0, 0.004)
    assert trip.highest(3, 0.004) <= jerk * (1 + 1e-6)


@pytest.mark.parametrize("turn", [0.3, 1.5, 2.9])
@pytest.mark.parametrize("hard", [100.0, 5000.0])
def test_the_jerk_in_a_corner_combines_acceleration_and_turning(turn, hard):
    """At its highest speed and acceleration, and that changing, either way: by differences of its places in a very short time."""
    soft, t = JerkLimit(2.0 * hard / 0.3, 0.3, hard), 1e-4
    found = corner((0.0, 0.0), (1.0, 0.0), (math.cos(turn), math.sin(turn)), within=3.0, max_trim=50.0)
    assert found is not None
    part = jerk_limited_corner(found, [SpeedZone(0, found.length, 1e9, 1e9)], soft)[0]
    v, times = part.top, [-1.5 * t, -0.5 * t, 0.5 * t, 1.5 * t]
    jerks = []
    for a, j in product(
        (part.ramp, -part.ramp), (2.0 * part.ramp / soft.seconds, -2.0 * part.ramp / soft.seconds)
    ):
        for begin in (found.length * n / 400 for n in range(20, 381)):
            places = [found.at(begin + d * (v + d * (0.5 * a + d * j / 6.0))) for d in times]
            jerks.append(math.hypot(*differences(places, 3, t)[0]))
    assert 0.9 * soft.jerk < max(jerks) <= 1.001 * soft.jerk


def test_a_mean_without_slower_corners_would_be_more_sudden():
    """The effect of the plan: the same mean over the path without it."""
    pieces, stops = polyline(SQUARE, 3.0)
    way = build_path(pieces, [AxisLimits()] * 2, 500.0, stops, CycleVelocity(120.0, 0.004))
    trip = gone(way, 50, 120.0, 0.004)
    assert trip.highest(3, 0.004) > 1.4 * 5000.0


def test_a_higher_jerk_is_never_slower_and_a_very_high_one_is_as_fast_as_no_limit():
    pieces, stops = polyline(SQUARE, 3.0)
    without = gone(
        build_path(pieces, [AxisLimits()] * 2, 500.0, stops, CycleVelocity(120.0, 0.004)), 1, 120.0, 0.004
    )
    counts = [
        len(gone(*planned(SQUARE, 3.0, [AxisLimits()] * 2, 120.0, 500.0, jerk, 0.004), 120.0, 0.004).places)
        for jerk in (2500.0, 5000.0, 20_000.0, 100_000.0, 1e9)
    ]
    assert counts == sorted(counts, reverse=True)
    assert counts[-1] <= 1.06 * len(without.places)  # of the acceleration, corners have a smaller share


def test_at_a_stop_within_the_path_the_mean_reaches_standstill_before_it_continues():
    way, cycles = planned(SQUARE, 0.0, [AxisLimits()] * 2, 120.0, 500.0, 5000.0, 0.004)
    trip = gone(way, cycles, 120.0, 0.004)
    for tip in SQUARE[1:-1]:
        assert tip in [tuple(round(value, 9) for value in place) for place in trip.places]
    assert trip.highest(3, 0.004) <= 5000.0 * (1 + 1e-6)


def test_a_path_of_a_thousand_corners_is_planned():
    chance = random.Random(5)
    points = [(0.0, 0.0), *((x * 2.0, chance.uniform(-3.0, 3.0)) for x in range(1, 1000))]
    way, cycles = planned(points, 0.5, [SOME] * 2, 60.0, 400.0, 8000.0, 0.004)
    trip = gone(way, cycles, 60.0, 0.004)
    assert trip.highest(3, 0.004) <= 8000.0 * (1 + 1e-6)
    assert trip.highest(2, 0.004) <= 400.0 * (1 + 1e-6)
