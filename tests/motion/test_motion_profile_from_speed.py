"""A move from a present velocity, as a function of time: it ends where it should, within its velocity and accelerations."""

from __future__ import annotations

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.motion.moves.profile_from_speed import ProfileFromSpeed, Start

T = 0.004
PLACES = st.floats(-1000, 1000)
SPEEDS = st.floats(-400, 400)
RAMPS = st.floats(10, 5000)


@given(PLACES, SPEEDS, PLACES, st.floats(1, 400), RAMPS, RAMPS)
def test_a_profile_from_speed_reaches_its_end_without_a_jump_in_position_or_velocity(
    start, speed, end, velocity, up, down
):
    path = ProfileFromSpeed(Start(start, speed), end, velocity, up, down)
    assert path.position(0.0) == start
    assert path.position(path.duration) == pytest.approx(end, abs=1e-6)
    assert path.position(path.duration - 1e-6) == pytest.approx(end, abs=0.01)
    count = min(int(path.duration / T), 3000)
    places = [path.position(number * T) for number in range(count + 2)]
    low, high = path.span
    assert min(places) >= low - 1e-6
    assert max(places) <= high + 1e-6
    speeds = [speed, *((b - a) / T for a, b in itertools.pairwise(places))]
    assert max(map(abs, speeds)) <= max(velocity, abs(speed)) + 1e-3
    hardest = max(abs(b - a) / T for a, b in itertools.pairwise(speeds))
    assert hardest <= max(up, down) * (1 + 1e-3) + 0.05


@pytest.mark.parametrize(
    ("speed", "end", "seconds"),
    [
        (90.0, 90.0, 1.0 + 0.125 / 2),  # continues, and brakes from 90 with 720 in 0.125 s
        (90.0, 5.625, 0.125),  # brakes at once
        (0.0, 0.0, 0.0),
    ],
)
def test_the_duration_of_a_profile_from_speed_is_that_of_its_pieces(speed, end, seconds):
    assert ProfileFromSpeed(Start(0.0, speed), end, 90.0, 720.0, 720.0).duration == pytest.approx(seconds)


def test_a_profile_that_cannot_stop_in_time_overshoots_and_returns():
    path = ProfileFromSpeed(Start(0.0, 100.0), 5.0, 100.0, 500.0, 500.0)
    assert path.span == pytest.approx((0.0, 10.0))
    assert path.position(path.duration) == 5.0
