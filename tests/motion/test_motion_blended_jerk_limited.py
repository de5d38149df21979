"""The mean of the way of one axis through the ends of its moves: its jerk, and how fast the joints are passed."""

from __future__ import annotations

import math
import random
from collections import deque
from itertools import pairwise

import pytest

from axisbus.motion.blending.blended_profile import (
    BlendedProfile,
    Leg,
    extended_profile,
    profile_from_rest,
    profile_of_move,
)
from axisbus.motion.blending.jerk_limited import SmoothedProfile
from axisbus.motion.blending.mode import BufferMode
from axisbus.motion.jerk.online_profile import JerkLimits, ReferenceState
from axisbus.motion.moves.profile_from_speed import ProfileFromSpeed, Start

T = 0.004
WINDOW = 50
MEAN = WINDOW * T
MODES = [mode for mode in BufferMode if mode.blends]


def ahead_on(profile: BlendedProfile, ramp: float, window: int = WINDOW) -> SmoothedProfile:
    here = profile.position(0.0)
    return SmoothedProfile(profile, deque([here] * window, maxlen=window), ReferenceState(here), ramp, T)


def gone(ahead: SmoothedProfile) -> list[tuple[float, float]]:
    """Time of the mean, and place, from rest to the end."""
    rows = [(ahead.t, ahead.reference.position)]
    while ahead.t < ahead.profile.duration:
        ahead.advance(T)
        rows.append((ahead.t, ahead.reference.position))
        assert len(rows) < 50_000
    return rows


def highest(positions: list[float], order: int) -> float:
    for _ in range(order):
        positions = [(b - a) / T for a, b in pairwise(positions)]
    return max(map(abs, positions))


def passing(rows: list[tuple[float, float]], position: float) -> tuple[float, float]:
    """The speed and the acceleration with which a place is passed for the first time."""
    number = next(k for k, (_, here) in enumerate(rows) if here >= position)
    a, b, c = (rows[number + k][1] for k in (-1, 0, 1))
    return (c - a) / (2 * T), (c - 2 * b + a) / T**2


@pytest.mark.parametrize("mode", MODES)
@pytest.mark.parametrize(("first", "second"), [(50.0, 80.0), (80.0, 50.0)])
def test_a_jerk_limited_transition_has_the_velocity_of_its_mode_and_no_acceleration(mode, first, second):
    legs = [Leg(100.0, first, 200.0, 400.0), Leg(200.0, second, 200.0, 400.0, mode)]
    profile = profile_from_rest(0.0, legs, MEAN)
    rows = gone(ahead_on(profile, 200.0))
    speed, rate = passing(rows, 100.0)
    assert speed == pytest.approx(mode.velocity(first, second), abs=0.01)
    assert abs(rate) < 0.01 * 200.0
    assert rows[-1][1] == 200.0
    positions = [position for _, position in rows]
    assert highest(positions, 2) <= 400.0 * (1 + 1e-9)
    assert highest(positions, 3) <= 2.0 * 400.0 / MEAN * (1 + 1e-9)
    joint = profile.transitions[0]
    due = next(position for t, position in rows if t >= profile.passed_at(joint))
    assert due == pytest.approx(100.0, abs=joint.speed * T)


def test_before_a_reversal_the_stop_is_reached_and_seen():
    legs = [Leg(100.0, 80.0, 200.0, 200.0), Leg(20.0, 80.0, 200.0, 200.0, BufferMode.HIGH)]
    profile = profile_from_rest(0.0, legs, MEAN)
    rows = gone(ahead_on(profile, 200.0))
    assert max(position for _, position in rows) == pytest.approx(100.0, abs=1e-9)
    assert profile.transitions[0].turns
    due = [position for t, position in rows if t >= profile.passed_at(profile.transitions[0])]
    assert due[0] == pytest.approx(100.0, abs=1e-9)
    assert highest([position for _, position in rows], 3) <= 2.0 * 200.0 / MEAN * (1 + 1e-9)


def test_moves_too_short_for_their_jerk_limit_are_blended_at_nearly_the_velocity():
    legs = [
        Leg(100.0, 60.0, 200.0, 200.0),
        *(Leg(end, 60.0, 200.0, 200.0, BufferMode.HIGH) for end in (102.0, 104.0)),
        Leg(200.0, 90.0, 200.0, 200.0, BufferMode.LOW),
    ]
    profile = profile_from_rest(0.0, legs, MEAN)
    assert [joint.speed for joint in profile.transitions] == [60.0, 60.0, 60.0, 0.0]
    rows = gone(ahead_on(profile, 200.0))
    for position in (100.0, 102.0, 104.0):
        assert passing(rows, position)[0] == pytest.approx(60.0, abs=3.0)


@pytest.mark.parametrize("moment", [0.0, 0.03, 0.06, 0.09])
def test_a_move_that_joins_on_a_segment_shorter_than_its_mean_continues(moment):
    legs = [
        Leg(10.0, 20.0, 500.0, 500.0),
        *(Leg(end, 20.0, 500.0, 500.0, BufferMode.NEXT) for end in (11.0, 12.0)),
    ]
    profile = profile_from_rest(0.0, legs, MEAN)
    t = profile.transitions[0].time + moment
    assert t < profile.duration
    left = [leg for leg, joint in zip(legs, profile.transitions, strict=True) if joint.time > t]
    longer = extended_profile(profile, t, [*left, Leg(90.0, 20.0, 500.0, 500.0, BufferMode.NEXT)])
    assert longer.speed(t) == pytest.approx(profile.speed(t))
    assert not any(joint.turns for joint in longer.transitions)
    ahead = ahead_on(profile, 500.0)
    while ahead.time.t < t:
        ahead.advance(T)
    ahead.profile, positions = longer, [ahead.reference.position]
    positions += [position for _, position in gone(ahead)][1:]
    assert positions == sorted(positions)
    assert positions[-1] == 90.0
    assert highest(positions, 3) <= 2.0 * 500.0 / MEAN * (1 + 1e-9)


def test_without_a_mean_the_path_is_unchanged():
    legs = [Leg(100.0, 50.0, 100.0, 100.0), Leg(200.0, 50.0, 100.0, 100.0, BufferMode.LOW)]
    assert profile_from_rest(0.0, legs, 0.0).pieces == profile_from_rest(0.0, legs).pieces
    assert profile_from_rest(0.0, legs, MEAN).duration == pytest.approx(profile_from_rest(0.0, legs).duration)


@pytest.mark.parametrize("factors", [(0.3,), (0.0, 1.0), (1.5, 0.5, 1.0)])
def test_under_an_override_its_jerk_is_kept_and_it_is_never_faster(factors):
    legs = [Leg(60.0, 50.0, 200.0, 300.0), Leg(200.0, 80.0, 200.0, 300.0, BufferMode.HIGH)]
    ahead, positions = ahead_on(profile_from_rest(0.0, legs, MEAN), 200.0), [0.0] * 4
    for factor in factors:
        ahead.aim(factor)
        for _ in range(150):
            ahead.advance(T)
            positions.append(ahead.reference.position)
        assert ahead.time.rate == min(factor, 1.0)
    ahead.aim(0.7)
    positions += [position for _, position in gone(ahead)][1:]
    assert positions[-1] == 200.0
    assert highest(positions, 1) <= 80.0 * (1 + 1e-9)
    assert highest(positions, 3) <= 2.0 * 300.0 / MEAN * (1 + 1e-9)


def test_a_brake_on_the_trajectory_is_as_soft():
    ahead, positions = (
        ahead_on(profile_from_rest(0.0, [Leg(200.0, 80.0, 200.0, 300.0)], MEAN), 200.0),
        [0.0] * 4,
    )
    for number in range(600):
        if number == 150:
            ahead.brake()
        assert not ahead.stopped or number > 150
        ahead.advance(T)
        positions.append(ahead.reference.position)
    assert ahead.stopped
    assert 20.0 < positions[-1] < 100.0
    assert ahead.t < ahead.profile.duration
    assert "s" in ahead.as_text(ahead.t)
    assert highest(positions, 3) <= 2.0 * 200.0 / MEAN * (1 + 1e-9)


def test_a_move_to_another_target_begins_with_the_present_velocity_and_acceleration():
    ahead, positions = (
        ahead_on(profile_from_rest(0.0, [Leg(200.0, 80.0, 200.0, 200.0)], MEAN), 200.0),
        [0.0] * 4,
    )
    for _ in range(60):
        ahead.advance(T)
        positions.append(ahead.reference.position)
    online_profile = ahead.online_profile(50.0, JerkLimits(60.0, 200.0, 90.0), 0.0)
    while online_profile.t == 0.0:
        online_profile.advance(T)
        positions.append(online_profile.reference.position)
    assert positions[-1] == 50.0
    assert highest(positions, 3) <= 2.0 * 200.0 / MEAN * (1 + 1e-9)


@pytest.mark.parametrize("moment", [0.02, 0.3, 1.2])
def test_a_leg_that_joins_behind_a_running_move_does_not_change_the_path_before_it(moment):
    way = ProfileFromSpeed(Start(3.0, 40.0), 100.0, 60.0, 200.0, 200.0)
    profile = profile_of_move(way, MEAN)
    legs = [Leg(100.0, 60.0, 200.0, 200.0), Leg(180.0, 90.0, 200.0, 200.0, BufferMode.PREVIOUS)]
    longer = extended_profile(profile, moment, legs)
    for number in range(100):  # old parts are not kept
        t = max(0.0, moment - 0.9) + min(moment, 0.9) * number / 100
        assert longer.position(t) == profile.position(t)
    assert longer.mean == MEAN
    assert longer.transitions[0].speed == 60.0
    rows = gone(ahead_on(longer, 200.0))
    assert passing(rows, 100.0)[0] == pytest.approx(60.0, abs=0.01)


@pytest.mark.parametrize("seed", range(120))
def test_random_legs_that_join_at_random_times_keep_their_jerk_and_pass_every_end(seed):
    chance = random.Random(seed)
    ramp = chance.choice([100.0, 1000.0])

    def leg(end: float) -> Leg:
        up, down = (ramp * chance.choice([1.0, 0.5, 0.1]) for _ in range(2))
        mode = chance.choice([BufferMode.BUFFERED, *MODES])
        return Leg(end, 10 ** chance.uniform(0, 2.3), up, down, mode if mode.blends else BufferMode.LOW)

    end = chance.uniform(-50.0, 50.0)
    legs = [leg(end)]
    ahead, positions, told = ahead_on(profile_from_rest(0.0, legs, MEAN), 0.1 * ramp), [0.0] * 4, []
    while ahead.t < ahead.profile.duration:
        t = ahead.time.t
        if chance.random() < 0.02 and len(told) + len(legs) < 8 and t < ahead.profile.duration - 1e-9:
            end += chance.choice([0.0, 0.02, 1.0, 30.0]) * chance.choice([1.0, 1.0, -1.0])
            pending = ahead.profile.transitions[-len(legs) :]
            while len(legs) > 1 and pending[0].time <= t:
                told.append(legs.pop(0).end)
                pending = pending[1:]
            legs.append(leg(end))
            before = ahead.profile
            ahead.profile = extended_profile(before, t, legs)
            assert ahead.profile.position(t) == pytest.approx(before.position(t), abs=1e-9)
            assert ahead.profile.speed(t) == pytest.approx(before.speed(t), abs=1e-6)
        if chance.random() < 0.01:
            ahead.aim(chance.choice([0.2, 0.6, 1.0]))
        ahead.advance(T)
        positions.append(ahead.reference.position)
        assert len(positions) < 60_000
    assert positions[-1] == end
    off = 64 * max(math.ulp(abs(position)) for position in positions)
    assert highest(positions, 2) <= ramp * (1 + 1e-6) + off / T**2
    assert highest(positions, 3) <= 2.0 * ramp / MEAN * (1 + 1e-6) + off / T**3
    for stop in [*told, *(each.end for each in legs)]:
        assert min(abs(position - stop) for position in positions) <= 200.0 * T
