"""Looking ahead along a path: braking it in time keeps it within the limits, and a path within them is not changed."""

from __future__ import annotations

import math

from hypothesis import assume, given, settings
from hypothesis import strategies as st

from axisbus.motion.group.path import build_path
from axisbus.motion.group.path_motion import AxisPathShare, PathPosition
from axisbus.motion.group.segments import Straight
from axisbus.motion.parameters import AxisLimits
from axisbus.motion.pathclock import PathClock
from axisbus.motion.position_limits import LookaheadTrajectory, excess, widened
from axisbus.motion.trajectory import SampledTrajectory, TrapezoidalTrajectory
from kit.motion.rig import PERIOD

LIMITS = (-10.0, 10.0)


def run(path, duration: float, deceleration: float) -> tuple[list[float], bool]:
    """Go along ``path`` as an axis does; return where it was in each cycle, and whether it was braked."""
    clock, seen = PathClock(), [path(0.0)]
    for _ in range(round(duration / PERIOD) + 200):
        if not clock.braking and excess(path, clock.t, PERIOD, LIMITS, deceleration) is not None:
            clock.brake(path, deceleration)
        clock.advance(PERIOD)
        seen.append(path(clock.t))
    return seen, clock.braking


def ended(path, duration: float):
    return lambda t: path(min(max(t, 0.0), duration))


@settings(max_examples=150, deadline=None, derandomize=True)
@given(
    st.lists(
        st.tuples(st.floats(0.0, 15.0), st.floats(0.1, 8.0), st.floats(0.0, 6.28)), min_size=1, max_size=3
    ),
    st.floats(5.0, 500.0),
)
def test_no_sum_of_waves_leaves_the_limits(waves, deceleration):
    def wave(t: float) -> float:
        return sum(a * (math.sin(w * t + phase) - math.sin(phase)) for a, w, phase in waves)

    path = ended(wave, 3.0)
    assume(abs(path(PERIOD)) < 5.0)
    seen, braked = run(path, 3.0, deceleration)
    inside = all(-10.0 <= path(k * PERIOD) <= 10.0 for k in range(302))
    first = (
        abs(path(PERIOD)) ** 2 / PERIOD**2 / (2 * deceleration)
    )  # it does not begin at standstill, as it should
    assume(first < 5.0)
    assert all(-10.0 <= position <= 10.0 for position in seen)
    assert not (inside and braked)


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.lists(st.floats(-20.0, 20.0), min_size=2, max_size=8), st.floats(5.0, 500.0), st.floats(0.005, 0.5))
def test_no_path_with_corners_and_jumps_leaves_the_limits(points, deceleration, step):
    sampled = SampledTrajectory([0.0, 0.0, *points], step)
    seen, _ = run(ended(sampled.position, sampled.duration), sampled.duration, deceleration)
    assert all(-10.0 <= position <= 10.0 for position in seen)


def test_the_report_of_an_excess_gives_the_position_at_which_the_axis_would_have_stopped():
    path = ended(TrapezoidalTrajectory(0.0, 100.0, 50.0, 500.0).position, 2.1)
    found = next(e for k in range(300) if (e := excess(path, k * PERIOD, PERIOD, LIMITS, 500.0)) is not None)
    assert math.isclose(found.speed, 50.0)
    assert 10.0 < found.stop <= 10.5  # the first cycle that is too much is at most 0.5 too late
    assert math.isclose(found.stop, found.here + 0.5 + 50.0**2 / 1000)
    assert found.there > 10.0
    assert math.isclose(path(found.time), found.there)


def test_trapezoids_samples_and_lines_report_how_far_and_how_fast_they_go():
    way = build_path([Straight((5.0,), (-3.0,), 1.0)], [AxisLimits(velocity=4.5)], 2.0)
    line = AxisPathShare(PathPosition(way, 0.0, (5.0,)), 0, 0.5)
    known = [
        TrapezoidalTrajectory(4.0, -2.0, 3.0, 10.0),
        TrapezoidalTrajectory(0.0, 1.0, 3.0, 4.0),
        SampledTrajectory([0.0, 2.0, -1.0], 0.5),
        line,
    ]
    assert all(isinstance(path, LookaheadTrajectory) for path in known)
    assert [path.span for path in known] == [(-2.0, 4.0), (0.0, 1.0), (-1.0, 2.0), (-3.0, 5.0)]
    assert [path.top_speed for path in known] == [3.0, 2.0, 6.0, 4.0]


def test_limits_are_widened_to_the_start_of_a_motion():
    assert widened(LIMITS, 3.0, 0.5) == (-10.5, 10.5)
    assert widened(LIMITS, 12.0, 0.5) == (-10.5, 12.5)
    assert widened(LIMITS, -12.0, 0.0) == (-12.0, 10.0)
