"""Moves with a limited jerk whose target changes during the motion: velocity, acceleration and jerk by differences."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.motion.jerk.online_profile import JerkLimits, OnlineProfile, ReferenceState, online_profile_from

T = 0.004
NOISE = 1e-11


def differences(values: list[float], order: int) -> list[float]:
    for _ in range(order):
        values = [(b - a) / T for a, b in pairwise(values)]
    return values


def highest(values: list[float], order: int) -> float:
    return max(map(abs, differences(values, order)))


def to_the_end(online_profile: OnlineProfile, positions: list[float]) -> list[float]:
    while online_profile.t == 0.0:
        online_profile.advance(T)
        positions.append(online_profile.reference.position)
        assert len(positions) < 50_000
    return positions


def test_a_soft_move_from_standstill_takes_the_time_of_a_ramp_and_of_the_mean():
    online_profile = online_profile_from(ReferenceState(5.0), 95.0, JerkLimits(100.0, 500.0, 150.0), 50, T)
    positions = to_the_end(online_profile, [5.0] * 4)
    assert positions[-1] == 95.0
    assert (len(positions) - 4) * T == pytest.approx(1.1 + 0.2, abs=0.012)
    assert min(differences(positions, 1)) >= -1e-9
    assert highest(positions, 1) == pytest.approx(100.0)
    assert highest(positions, 2) == pytest.approx(500.0, rel=0.02)
    assert highest(positions, 3) == pytest.approx(500.0 / 0.2, rel=0.02)


@pytest.mark.parametrize("start", [790836.0, 764657.0, 724325.0, 689619.0, -40284.0])
@pytest.mark.parametrize("window", [1, 5, 25])
def test_a_move_to_0_from_a_large_number_of_increments_ends(start, window):
    positions = to_the_end(
        online_profile_from(ReferenceState(start), 0.0, JerkLimits(98300.0, 196600.0, 98300.0), window, T), []
    )
    assert positions[-1] == 0.0


@settings(deadline=None, derandomize=True, max_examples=150)
@given(
    st.integers(0, 10**6),
    st.integers(2, 100),
    st.lists(st.floats(-200.0, 200.0), min_size=1, max_size=5),
    st.sampled_from([(60.0, 400.0), (200.0, 2000.0)]),
)
def test_random_targets_velocities_and_overrides_cause_no_jump(seed, window, targets, jerk_limits):
    """New targets, velocities and overrides at any time, also back; and it ends at the last one."""
    chance, (velocity, ramp) = random.Random(seed), jerk_limits
    online_profile = online_profile_from(
        ReferenceState(0.0), targets[0], JerkLimits(velocity, ramp, 1.5 * velocity), window, T
    )
    positions = [0.0] * 4
    for target in targets[1:]:
        for _ in range(chance.randint(1, 400)):
            if chance.random() < 0.02:
                online_profile.factor = chance.choice((0.0, 0.3, 1.0, 1.5))
            online_profile.advance(T)
            positions.append(online_profile.reference.position)
        speed = chance.choice((0.2, 1.0)) * velocity
        before, online_profile = (
            online_profile,
            online_profile.retargeted(target, JerkLimits(speed, ramp, 1.5 * velocity), 0.0),
        )
        assert online_profile.reference == before.reference
    online_profile.factor = 1.0
    to_the_end(online_profile, positions)
    assert positions[-1] == targets[-1]
    positions += [positions[-1]] * 4
    assert highest(positions, 1) <= 1.5 * velocity * (1 + 1e-9) + NOISE / T
    assert highest(positions, 2) <= ramp * (1 + 1e-9) + NOISE / T**2
    assert highest(positions, 3) <= 2.0 * ramp / (window * T) * (1 + 1e-9) + NOISE / T**3


@pytest.mark.parametrize("rate", [-300.0, 0.0, 300.0])
@pytest.mark.parametrize("speed", [-80.0, 0.0, 80.0])
@pytest.mark.parametrize("window", [3, 60])
def test_a_walk_that_takes_over_begins_with_the_present_velocity_and_acceleration(rate, speed, window):
    online_profile = online_profile_from(
        ReferenceState(10.0, speed, rate), -50.0, JerkLimits(100.0, 500.0, 150.0), window, T
    )
    step = speed * T
    positions = [
        10.0 - 2.0 * step + rate * T * T,
        10.0 - step,
        10.0,
    ]  # the positions before, with the same motion
    to_the_end(online_profile, positions)
    assert highest(positions[1:], 1) <= 150.0 * (1 + 1e-9)
    assert highest(positions, 2) <= 500.0 * (1 + 1e-9)
    assert highest(positions, 3) <= 2.0 * 500.0 / (window * T) * (1 + 1e-9)
    assert positions[-1] == -50.0


def test_an_acceleration_at_the_take_over_never_exceeds_the_velocity_limit():
    """An acceleration at the take-over could not be ended at once by its jerk: so it is smaller."""
    online_profile = online_profile_from(
        ReferenceState(0.0, 145.0, 400.0), 400.0, JerkLimits(100.0, 500.0, 150.0), 100, T
    )
    positions = to_the_end(online_profile, [-145.0 * T, 0.0])
    assert highest(positions, 1) <= 150.0 * (1 + 1e-9)
    assert highest(positions[1:], 2) <= 500.0 * (1 + 1e-9)


def test_a_jerk_limited_brake_stops_the_walk():
    online_profile = online_profile_from(ReferenceState(0.0), 400.0, JerkLimits(100.0, 500.0, 150.0), 50, T)
    positions = [0.0] * 4
    for _ in range(200):
        online_profile.advance(T)
        positions.append(online_profile.reference.position)
    online_profile.brake()
    while not online_profile.stopped:
        online_profile.advance(T)
        positions.append(online_profile.reference.position)
    assert online_profile.t == 0.0
    assert highest(positions, 3) <= 2.0 * 500.0 / 0.2
    assert len(positions) == 4 + 200 + 50 + 49
    assert "on its way to 400" in online_profile.as_text(0.0)
