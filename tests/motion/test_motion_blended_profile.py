"""The way of one axis through the ends of its moves: within the limits of each, and how fast the joints are passed."""

from __future__ import annotations

import itertools
import math
import random

import pytest

from axisbus.motion.blending.blended_profile import BlendedProfile, Leg, extended_profile, profile_from_rest
from axisbus.motion.blending.mode import BufferMode

STEP = 0.001
MODES = [mode for mode in BufferMode if mode.blends]


def sampled(course: BlendedProfile) -> list[float]:
    return [course.position(number * STEP) for number in range(int(course.duration / STEP) + 3)]


def speed_near(course: BlendedProfile, t: float) -> float:
    """By places alone, around a time."""
    return abs(course.position(t + STEP) - course.position(t - STEP)) / (2 * STEP)


def must_hold(course: BlendedProfile, legs: list[Leg], start: float) -> None:
    """No place jumps, no acceleration is higher than a leg's, no speed higher than both legs' around it."""
    places = sampled(course)
    hardest = max(max(leg.up, leg.down) for leg in legs)
    fastest = max(leg.velocity for leg in legs)
    speeds = [(b - a) / STEP for a, b in itertools.pairwise(places)]
    off = 1e-6 + 64 * max(math.ulp(abs(place)) for place in places) / STEP
    assert places[0] == start
    assert abs(speeds[0]) <= hardest * STEP + off
    assert max(map(abs, speeds)) <= fastest + off
    for before, after in itertools.pairwise(speeds):
        assert abs(after - before) <= hardest * STEP * (1 + 1e-9) + 2 * off
    assert places[-1] == course.end == legs[-1].end
    assert abs(speeds[-1]) <= hardest * STEP + off


@pytest.mark.parametrize(
    ("mode", "joint"), [("low", 50.0), ("previous", 50.0), ("next", 80.0), ("high", 80.0)]
)
@pytest.mark.parametrize("turned", [1.0, -1.0])
def test_a_faster_move_is_blended_at_the_velocity_of_the_buffer_mode(mode, joint, turned):
    legs = [
        Leg(100.0 * turned, 50.0, 200.0, 400.0),
        Leg(200.0 * turned, 80.0, 200.0, 400.0, BufferMode(f"blending_{mode}")),
    ]
    course = profile_from_rest(0.0, legs)
    assert course.transitions[0].speed == joint
    assert course.position(course.transitions[0].time) == pytest.approx(100.0 * turned)
    assert speed_near(course, course.transitions[0].time) == pytest.approx(joint, abs=0.5)
    assert speed_near(course, course.transitions[0].time - 0.3) == pytest.approx(
        50.0
    )  # its own, before it changes
    assert course.top_speed == 80.0
    must_hold(course, legs, 0.0)


@pytest.mark.parametrize(
    ("mode", "joint"), [("low", 50.0), ("previous", 80.0), ("next", 50.0), ("high", 80.0)]
)
def test_a_slower_move_is_blended_at_the_velocity_of_the_buffer_mode(mode, joint):
    legs = [Leg(100.0, 80.0, 200.0, 400.0), Leg(200.0, 50.0, 200.0, 400.0, BufferMode(f"blending_{mode}"))]
    course = profile_from_rest(0.0, legs)
    assert speed_near(course, course.transitions[0].time) == pytest.approx(joint, abs=0.5)
    assert speed_near(course, course.transitions[0].time + 0.3) == pytest.approx(50.0)
    must_hold(course, legs, 0.0)


def test_the_time_of_a_path_is_that_of_its_ramps_and_of_the_part_between():
    legs = [Leg(100.0, 50.0, 100.0, 100.0), Leg(200.0, 50.0, 100.0, 100.0, BufferMode.LOW)]
    course = profile_from_rest(0.0, legs)  # one trapezoid over 200, up and down in 0.5 s each
    assert course.duration == pytest.approx(200.0 / 50.0 + 0.5)
    assert course.transitions[0].time == pytest.approx(100.0 / 50.0 + 0.25)
    assert course.span == (0.0, 200.0)
    assert (course.top_speed, course.top_acceleration) == (50.0, 100.0)


def test_if_the_path_reverses_the_axis_stops_at_the_transition_which_notes_it():
    legs = [Leg(100.0, 50.0, 200.0, 200.0), Leg(20.0, 80.0, 200.0, 200.0, BufferMode.HIGH)]
    course = profile_from_rest(0.0, legs)
    assert course.transitions[0].speed == 0.0
    assert course.transitions[0].turns
    assert course.span == (0.0, 100.0)
    must_hold(course, legs, 0.0)


def test_a_move_without_length_is_a_stop():
    legs = [
        Leg(30.0, 50.0, 200.0, 200.0),
        *(Leg(end, 50.0, 200.0, 200.0, BufferMode.NEXT) for end in (30.0, 60.0)),
    ]
    course = profile_from_rest(0.0, legs)
    assert [joint.speed for joint in course.transitions] == [0.0, 0.0, 0.0]
    assert [joint.turns for joint in course.transitions] == [True, True, False]
    must_hold(course, legs, 0.0)
    assert profile_from_rest(5.0, [Leg(5.0, 1.0, 1.0, 1.0)]).position(1.0) == 5.0


def test_the_transition_before_a_short_move_is_slow_enough_to_brake_within_that_move():
    legs = [Leg(100.0, 80.0, 200.0, 200.0), Leg(101.0, 80.0, 200.0, 100.0, BufferMode.PREVIOUS)]
    course = profile_from_rest(0.0, legs)
    assert course.transitions[0].speed == pytest.approx(math.sqrt(2 * 100.0 * 1.0))
    assert course.transitions[0].requested == 80.0
    must_hold(course, legs, 0.0)


def test_the_transition_after_a_short_move_is_as_fast_as_can_be_reached():
    legs = [Leg(1.0, 80.0, 100.0, 200.0), Leg(101.0, 80.0, 200.0, 200.0, BufferMode.NEXT)]
    course = profile_from_rest(0.0, legs)
    assert course.transitions[0].speed == pytest.approx(math.sqrt(2 * 100.0 * 1.0))
    must_hold(course, legs, 0.0)


def test_between_two_faster_ends_a_short_move_slows_down_no_further_than_it_must():
    legs = [
        Leg(100.0, 80.0, 200.0, 200.0),
        Leg(104.0, 20.0, 200.0, 200.0, BufferMode.PREVIOUS),
        Leg(300.0, 80.0, 200.0, 200.0, BufferMode.NEXT),
    ]
    course = profile_from_rest(0.0, legs)
    assert [joint.speed for joint in course.transitions] == [80.0, 80.0, 0.0]
    middle = (course.transitions[0].time + course.transitions[1].time) / 2
    assert speed_near(course, middle) == pytest.approx(math.sqrt(80.0**2 - 2 * 200.0 * 2.0), abs=0.1)
    must_hold(course, legs, 0.0)


@pytest.mark.parametrize("ahead", [0.001, 0.004, 0.02])
def test_the_part_planned_beyond_the_time_of_joining_is_planned_again(ahead):
    legs = [Leg(100.0, 50.0, 200.0, 400.0)]
    course = profile_from_rest(0.0, legs)
    t = course.pieces[-1].begin - ahead  # it would begin to brake then
    legs.append(Leg(200.0, 50.0, 200.0, 400.0, BufferMode.LOW))
    longer = extended_profile(course, t, legs)
    for number in range(-20, 200):
        assert longer.position(t + number * STEP) == pytest.approx(course.position(t) + 50.0 * number * STEP)


@pytest.mark.parametrize("seed", range(100))
def test_random_legs_that_join_at_random_times_keep_their_limits_and_the_planned_path(seed):
    chance = random.Random(seed)

    def leg(end: float) -> Leg:
        return Leg(
            end,
            10 ** chance.uniform(0, 2.5),
            10 ** chance.uniform(1, 3.5),
            10 ** chance.uniform(1, 3.5),
            chance.choice(MODES),
        )

    def beyond(end: float) -> float:
        far = 10 ** chance.uniform(-2, 2)
        return end + far * (1.0 if chance.random() < 0.8 else chance.choice([-1.0, 0.0]))

    start = chance.choice([0.0, -7.5, 1e4])
    legs = [leg(beyond(start))]
    all_legs = legs.copy()
    course, t = profile_from_rest(start, legs), 0.0
    for _ in range(chance.randint(1, 8)):
        legs.append(leg(beyond(legs[-1].end)))
        all_legs.append(legs[-1])
        before, course = course, extended_profile(course, t, legs)
        if t:
            assert course.position(t) == pytest.approx(before.position(t), abs=1e-9)
            assert course.speed(t) == pytest.approx(before.speed(t), abs=1e-9)
            earlier = max(t - 0.02, 0.0)
            assert course.position(earlier) == pytest.approx(before.position(earlier), abs=1e-9)
        must_keep_speeds(course, t, legs)
        t = min(t + chance.choice([0.0, 0.003, 0.1, 1.0]), course.duration * 0.999)
        while len(legs) > 1 and course.transitions[len(course.transitions) - len(legs)].time <= t:
            legs.pop(0)
    if t < 1.0:  # nothing of it has been dropped
        must_hold(course, all_legs, start)


def must_keep_speeds(course: BlendedProfile, t: float, legs: list[Leg]) -> None:
    """From ``t`` on: within the ramps of the legs, and at each joint no faster than was asked."""
    times = [t + number * STEP for number in range(int((course.duration - t) / STEP) + 2)]
    ramp = max(max(leg.up, leg.down) for leg in legs)
    speeds = [course.speed(time) for time in times]
    for before, after in itertools.pairwise(speeds):
        assert abs(after - before) <= ramp * STEP * (1 + 1e-6) + 1e-6
    for joint, leg in zip(course.transitions, legs, strict=True):
        assert joint.speed <= joint.requested * (1 + 1e-12)
        assert course.position(joint.time) == pytest.approx(leg.end, abs=1e-6)
        assert abs(course.speed(joint.time)) == pytest.approx(joint.speed, abs=1e-4 * ramp)
