"""Velocities with a limited jerk, by the differences of positions: limits, ends, and their shortest times."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.motion.jerk.online_profile import (
    LONGEST,
    ReferenceState,
    SoftRamp,
    VelocityRamps,
    stopping_distance,
)

T = 0.004
NOISE = 1e-11
RAMPS = VelocityRamps(500.0, 800.0, 5000.0)


def differences(values: list[float], order: int) -> list[float]:
    for _ in range(order):
        values = [(b - a) / T for a, b in pairwise(values)]
    return values


def highest(values: list[float], order: int) -> float:
    return max(map(abs, differences(values, order)))


def past(reference: ReferenceState) -> list[float]:
    """The places before, with the same acceleration."""
    back = reference.position - reference.velocity * T
    return [back - (reference.velocity - reference.acceleration * T) * T, back, reference.position]


def to_goal(ramp: SoftRamp, positions: list[float]) -> list[float]:
    while not ramp.at_goal:
        ramp.advance(T)
        positions.append(ramp.reference.position)
        assert len(positions) < 50_000
    return positions


def shortest(change: float, ramp: float, jerk: float) -> float:
    """Seconds from one velocity to another, from and to no acceleration, by the formula of books."""
    if change >= ramp * ramp / jerk:
        return change / ramp + ramp / jerk
    return 2.0 * math.sqrt(change / jerk)


@pytest.mark.parametrize("goal", [3.0, 40.0, 90.0, -90.0, 300.0])
def test_a_soft_ramp_from_standstill_takes_the_shortest_time_and_a_cycle_or_two(goal):
    ramp = SoftRamp(ReferenceState(5.0), RAMPS)
    ramp.goal = goal
    positions = to_goal(ramp, [5.0] * 4)
    assert ramp.reference.velocity == goal
    time = (len(positions) - 4) * T
    assert 0.0 <= time - shortest(abs(goal), 500.0, 5000.0) <= 2.5 * T
    assert highest(positions, 2) <= 500.0 * (1 + 1e-9)
    assert 0.95 * 5000.0 < highest(positions, 3) <= 5000.0 * (1 + 1e-9)
    assert all(velocity * goal >= 0.0 for velocity in differences(positions, 1))


def test_away_from_0_and_towards_it_each_has_its_own_acceleration_and_through_0_the_weaker():
    ramp = SoftRamp(ReferenceState(0.0), RAMPS)
    ramp.goal = 300.0
    assert highest(to_goal(ramp, [0.0] * 3), 2) == pytest.approx(500.0)
    ramp.goal = 0.0
    assert highest(to_goal(ramp, past(ramp.reference)), 2) == pytest.approx(800.0)
    ramp.goal = 300.0
    to_goal(ramp, [])
    ramp.goal = -300.0
    assert highest(to_goal(ramp, past(ramp.reference)), 2) == pytest.approx(500.0)
    assert ramp.reference.velocity == -300.0


def test_a_jerk_limited_brake_ends_at_0_and_is_not_replaced_by_another_goal():
    ramp = SoftRamp(ReferenceState(0.0), RAMPS)
    ramp.goal = 100.0
    positions = [0.0] * 4
    for _ in range(30):
        ramp.advance(T)
        positions.append(ramp.reference.position)
    ramp.brake()
    ramp.goal = 200.0
    while not ramp.stopped:
        ramp.advance(T)
        positions.append(ramp.reference.position)
    assert ramp.t == 0.0
    assert highest([*positions, *[positions[-1]] * 3], 3) <= 5000.0 * (1 + 1e-9)
    assert "with 0/s" in ramp.as_text(0.0)


@settings(deadline=None, derandomize=True, max_examples=200)
@given(
    st.integers(0, 10**6),
    st.floats(20.0, 3000.0),
    st.floats(20.0, 3000.0),
    st.floats(4.0, 400.0),
    st.lists(st.floats(-400.0, 400.0) | st.sampled_from([0.0, 400.0]), min_size=1, max_size=6),
)
def test_random_velocities_keep_all_limits_and_end_at_the_last_one(seed, up, down, sharp, goals):
    """New velocities at any time, in both directions, up to the highest speed, which is never passed."""
    chance, jerk = random.Random(seed), sharp * max(up, down)
    ramp = SoftRamp(ReferenceState(0.0), VelocityRamps(up, down, jerk, 400.0))
    positions = [0.0] * 4
    for goal in goals[:-1]:
        ramp.goal = goal
        for _ in range(chance.randint(1, 200)):
            expected = ramp.next(T)
            ramp.advance(T)
            assert ramp.reference == expected
            positions.append(ramp.reference.position)
    ramp.goal = goals[-1]
    to_goal(ramp, positions)
    assert ramp.reference.velocity == goals[-1]
    off = 64 * max(math.ulp(abs(position)) for position in positions)
    assert highest(positions, 1) <= 400.0 * (1 + 1e-9) + off / T
    assert highest(positions, 2) <= max(up, down) * (1 + 1e-9) + off / T**2
    assert highest(positions, 3) <= jerk * (1 + 1e-9) + off / T**3


@pytest.mark.parametrize("rate", [-450.0, 0.0, 450.0])
@pytest.mark.parametrize("speed", [-80.0, 0.0, 80.0])
@pytest.mark.parametrize("goal", [-100.0, 0.0, 30.0])
def test_a_ramp_that_takes_over_begins_with_the_present_velocity_and_acceleration(rate, speed, goal):
    reference = ReferenceState(10.0, speed, rate)
    ramp = SoftRamp(reference, RAMPS)
    ramp.goal = goal
    positions = to_goal(ramp, past(reference))
    assert ramp.reference.velocity == goal
    positions.append(positions[-1] + goal * T)
    assert highest(positions, 2) <= 800.0 * (1 + 1e-9)
    assert highest(positions, 3) <= 5000.0 * (1 + 1e-9)


@pytest.mark.parametrize("top", [400.0, 420.0, 500.0])
def test_a_rising_velocity_never_exceeds_the_axis_limit_and_uses_no_more_jerk_than_needed(top):
    """And no more than it takes."""
    reference = ReferenceState(0.0, 390.0, 2000.0)
    ramp = SoftRamp(reference, RAMPS._replace(top=top))
    ramp.goal = 100.0
    positions = to_goal(ramp, past(reference))
    assert 0.999 * top < highest(positions, 1) <= top * (1 + 1e-9)
    assert highest(positions[:40], 3) <= 1.001 * 2000.0**2 / (2.0 * (top - 390.0))
    settled = [abs(rate) for rate in differences(positions, 3)[60:]]
    assert max(settled) <= 5000.0 * (1 + 1e-9)


def test_an_acceleration_that_its_own_jerk_would_end_in_minutes_ends_in_time():
    ramp = SoftRamp(ReferenceState(0.0, 0.0, 10_000.0), VelocityRamps(50.0, 50.0, 200.0))
    ramp.goal = 10.0
    cycles = 0
    while ramp.reference.acceleration > 50.0:
        ramp.advance(T)
        cycles += 1
    assert cycles * T <= LONGEST + T
    assert ramp.reference.velocity <= 0.5 * 10_000.0 * LONGEST


@pytest.mark.parametrize("moment", [3, 17, 26, 40])
def test_a_ramp_settles_at_the_velocity_and_position_that_it_predicts(moment):
    """And says before where that will be."""
    ramp = SoftRamp(ReferenceState(0.0), RAMPS)
    ramp.goal = 90.0
    for _ in range(moment):
        ramp.advance(T)
    expected = ramp.settled(T)
    before = past(ramp.reference)
    ramp.settle(T)
    positions = to_goal(ramp, before)
    assert ramp.reference.velocity == pytest.approx(expected.velocity, abs=1e-9)
    assert ramp.reference.position == pytest.approx(expected.position, abs=1e-9)
    assert ramp.reference.acceleration == 0.0
    assert len(positions) - 3 <= math.ceil(500.0 / 5000.0 / T) + 1
    assert highest(positions, 3) <= 5000.0 * (1 + 1e-9)


@pytest.mark.parametrize("seed", range(30))
def test_the_braking_distance_is_not_longer_than_reported(seed):
    chance = random.Random(seed)
    ramps = VelocityRamps(500.0, chance.uniform(50.0, 800.0), chance.uniform(2000.0, 9000.0))
    rate = chance.uniform(-0.9, 0.9) * min(ramps.hardest, ramps.jerk * LONGEST)
    reference = ReferenceState(0.0, chance.choice([-1.0, 1.0]) * chance.uniform(1.0, 400.0), rate)
    ramp, way = SoftRamp(reference, ramps), stopping_distance(reference, ramps)
    ramp.brake()
    farthest = 0.0
    while not ramp.stopped:
        ramp.advance(T)
        farthest = max(farthest, ramp.reference.position * math.copysign(1.0, reference.velocity))
    assert 0.0 <= farthest <= way
    assert abs(rate) > 0.3 * ramps.hardest or way <= 1.6 * farthest + 1.0
