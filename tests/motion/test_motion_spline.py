"""Curves through points in time, against differences of their own positions; and the accepted kinds of trajectories."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.errors import ArgumentError
from axisbus.motion.spline import Computed, SplineTrajectory, trajectory_of
from axisbus.motion.trajectory import TrapezoidalTrajectory

SAME = settings(deadline=None, derandomize=True)
COUNT = 4000


def positions_of(curve: SplineTrajectory) -> list[float]:
    return [curve.position(curve.duration * step / COUNT) for step in range(COUNT + 1)]


def test_the_span_of_a_part_that_is_nearly_a_parabola():
    curve = SplineTrajectory((0.0, 1.8046875, 3.5546875, 5.359375), (0.0, 1.0, 1.0, 0.0))
    assert 0.0 < abs(curve._parts[1].twist) < 1e-15
    assert curve.span[1] == pytest.approx(max(positions_of(curve)), abs=1e-6)


@SAME
@given(
    st.lists(st.tuples(st.floats(0.05, 2.0), st.floats(-100.0, 100.0)), min_size=1, max_size=8),
    st.floats(-100, 100),
)
def test_a_spline_is_smooth_passes_its_points_and_reports_its_extremes(steps, start):
    times, positions = [0.0], [start]
    for wait, place in steps:
        times.append(times[-1] + wait)
        positions.append(place)
    curve = SplineTrajectory(times, positions)
    for time, place in zip(times, positions, strict=True):
        assert curve.position(time) == pytest.approx(place, abs=1e-6)
    places = positions_of(curve)
    dt = curve.duration / COUNT
    speeds = [(b - a) / dt for a, b in pairwise(places)]
    bends = [(b - a) / dt for a, b in pairwise(speeds)]
    size, noise = max(1.0, curve.top_speed), 1e-9 / dt**2
    assert (min(places), max(places)) == (
        pytest.approx(curve.span[0], abs=1e-2 * size),
        pytest.approx(curve.span[1], abs=1e-2 * size),
    )
    assert curve.span[0] <= min(places) + 1e-9
    assert curve.span[1] >= max(places) - 1e-9
    assert max(map(abs, speeds)) == pytest.approx(curve.top_speed, rel=1e-2, abs=1e-6)
    assert max(map(abs, bends)) <= curve.top_acceleration * (1 + 1e-6) + noise
    jumps = [abs(b - a) for a, b in pairwise(bends)]
    assert (
        max(jumps)
        <= 2e-3 * COUNT * dt * max(1.0, curve.top_acceleration) / min(wait for wait, _ in steps) + 2 * noise
    )
    assert abs(speeds[0]) <= curve.top_acceleration * dt + noise * dt  # from rest
    assert abs(speeds[-1]) <= curve.top_acceleration * dt + noise * dt  # to rest


def test_a_curve_of_two_points_is_the_cubic_from_standstill_to_standstill():
    curve = SplineTrajectory((0.0, 2.0), (10.0, 20.0))
    assert (curve.position(0.5), curve.position(1.0)) == (11.5625, 15.0)
    assert (curve.span, curve.top_speed, curve.top_acceleration) == ((10.0, 20.0), 7.5, 15.0)
    assert (curve.position(-1.0), curve.position(9.0)) == (10.0, 20.0)
    still = SplineTrajectory((0.0, 1.0), (3.0, 3.0))
    assert (still.span, still.top_speed, still.top_acceleration) == ((3.0, 3.0), 0.0, 0.0)


@pytest.mark.parametrize(
    ("times", "positions", "words"),
    [
        ((0.0,), (1.0,), "two points at least"),
        ((), (), "two points at least"),
        ((0.5, 1.0), (1.0, 2.0), "begin at 0"),
        ((0.0, 1.0, 1.0), (1.0, 2.0, 3.0), "rise"),
        ((0.0, 1.0), (1.0, math.nan), "finite"),
        ((0.0, "1"), (1.0, 2.0), "finite"),
        ((0.0, 1.0, 2.0), (1.0, 2.0), "as many of both"),
    ],
)
def test_points_that_make_no_curve_are_refused(times, positions, words):
    with pytest.raises(ArgumentError, match=words):
        SplineTrajectory(times, positions)


def test_trajectories_rows_and_functions_can_be_followed():
    numpy = pytest.importorskip("numpy")
    ready = TrapezoidalTrajectory(0.0, 1.0, 1.0, 1.0)
    assert trajectory_of(ready, None, "x.follow") is ready
    rows = [(0.0, 0.0), (1.0, 5.0), (2.0, 0.0)]
    curve = trajectory_of(rows, None, "x.follow")
    assert curve == SplineTrajectory((0.0, 1.0, 2.0), (0.0, 5.0, 0.0))
    same = trajectory_of(numpy.array(rows), None, "x.follow")
    assert same == curve
    assert type(same.position(0.7)) is float
    assert trajectory_of(math.sin, 3.0, "x.follow") == Computed(math.sin, 3.0)


@pytest.mark.parametrize(
    ("what", "duration", "words"),
    [
        (5.0, None, r"x\.follow: 5\.0 is not a trajectory"),
        ([1.0, 2.0], None, "is not a trajectory that can be followed"),
        ([(0.0, 1.0, 2.0)], None, "is not a trajectory that can be followed"),
        ([], None, "is not a trajectory that can be followed"),
        (math.sin, None, "a function needs a duration"),
        ([(0.0, 0.0), (1.0, 1.0)], 2.0, "their own duration"),
        (TrapezoidalTrajectory(0.0, 1.0, 1.0, 1.0), 2.0, "their own duration"),
    ],
)
def test_an_invalid_trajectory_is_refused_with_the_reason(what, duration, words):
    with pytest.raises(ArgumentError, match=words):
        trajectory_of(what, duration, "x.follow")
