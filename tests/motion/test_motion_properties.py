"""Properties of the pure parts over random inputs: trajectories, profiles, lines, the clock of a path, 60C2h, policy and gate."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from axisbus.errors import LimitError
from axisbus.motion.group.path_builder import plan_line
from axisbus.motion.group.start_barrier import OPEN, StartBarrier
from axisbus.motion.moves.interpolation import interpolation_period
from axisbus.motion.moves.profile import braking_distance, duration
from axisbus.motion.parameters import AxisLimits
from axisbus.motion.pathclock import PathClock
from axisbus.motion.stop.policy import FaultPolicy
from axisbus.motion.trajectory import SampledTrajectory, TrapezoidalTrajectory
from kit.motion.rig import GENERIC, dictionary_of, parameters

PLACES = st.floats(-1e4, 1e4)
SPEEDS = st.floats(0.1, 1e3)
RAMPS = st.floats(0.1, 1e4)
TRAPEZOIDS = st.builds(TrapezoidalTrajectory, PLACES, PLACES, SPEEDS, RAMPS)
STEPS = 400
SAME = settings(deadline=None, derandomize=True)  # the same examples in every run, on however busy a computer


def samples(path, steps: int = STEPS) -> tuple[float, list[float]]:
    """Positions at equal intervals from rest to rest, and the interval."""
    dt = path.duration / steps
    return dt, [path.position(number * dt) for number in range(steps + 1)]


# Trapezoids.


@SAME
@given(TRAPEZOIDS)
def test_a_trapezoid_begins_and_ends_exactly_at_its_ends(path):
    assert path.position(0.0) == path.start
    assert path.position(path.duration) == path.end
    assert path.position(-1.0) == path.start
    assert path.position(path.duration + 1.0) == path.end


@SAME
@given(TRAPEZOIDS)
def test_a_trapezoid_moves_only_towards_its_end(path):
    assume(abs(path.end - path.start) > 1e-6)
    _, way = samples(path)
    sign = math.copysign(1.0, path.end - path.start)
    slack = 1e-9 * (1 + abs(path.start) + abs(path.end))
    assert all((b - a) * sign >= -slack for a, b in pairwise(way))


@SAME
@given(TRAPEZOIDS)
def test_a_trapezoid_keeps_its_velocity_and_acceleration(path):
    assume(abs(path.end - path.start) > 1e-3)
    dt, way = samples(path)
    noise = 1e-11 * (1 + abs(path.start) + abs(path.end))  # of the subtraction of two positions
    speeds = [(b - a) / dt for a, b in pairwise(way)]
    assert max(map(abs, speeds)) <= path.velocity * (1 + 1e-9) + noise / dt
    bends = [(b - a) / dt for a, b in pairwise(speeds)]
    assert max(map(abs, bends)) <= path.acceleration * (1 + 1e-9) + 4 * noise / dt**2


@SAME
@given(TRAPEZOIDS)
def test_a_trapezoid_is_symmetric_in_time(path):
    whole, t = path.duration, 0.37 * path.duration
    middle = path.start + path.end
    assert path.position(t) + path.position(whole - t) == pytest.approx(middle, abs=1e-6)


@pytest.mark.parametrize(
    ("distance", "speed", "ramp", "seconds"),
    [
        (90.0, 100.0, 500.0, 1.1),  # 0.2 up, 0.7 along, 0.2 down
        (-90.0, 100.0, 500.0, 1.1),
        (20.0, 100.0, 500.0, 0.4),  # just reaches its velocity
        (5.0, 100.0, 500.0, 0.2),  # a triangle: 2 * sqrt(5 / 500)
        (0.0, 100.0, 500.0, 0.0),
    ],
)
def test_durations_computed_by_hand(distance, speed, ramp, seconds):
    assert duration(distance, speed, ramp) == pytest.approx(seconds)


@SAME
@given(st.floats(0, 1e4), SPEEDS, RAMPS)
def test_a_duration_is_that_of_the_motion_integrated_step_by_step(distance, speed, ramp):
    """The oracle: half the distance up to the peak velocity, the lower of the limit and the velocity that this half allows."""
    peak = min(speed, math.sqrt(ramp * distance))
    along = max(0.0, distance - peak * peak / ramp)
    assert duration(distance, speed, ramp) == pytest.approx(
        2 * peak / ramp + along / speed, rel=1e-9, abs=1e-9
    )


@SAME
@given(SPEEDS, RAMPS)
def test_braking_takes_half_of_the_distance_that_full_speed_would_cover_in_its_time(speed, ramp):
    assert braking_distance(speed, ramp) == pytest.approx(speed * (speed / ramp) / 2)


# Sampled points.


@SAME
@given(st.lists(PLACES, min_size=2, max_size=40), st.floats(1e-3, 1.0))
def test_sampled_points_are_met_and_nothing_lies_outside_two_neighbours(points, step):
    path = SampledTrajectory(points, step)
    for number, point in enumerate(points):
        assert path.position(number * step) == pytest.approx(point, rel=1e-6, abs=1e-6)
    assert path.position(path.duration) == points[-1]
    assert path.position(path.duration + step) == points[-1]
    assert path.position(-step) == points[0]
    for number, (a, b) in enumerate(pairwise(points)):
        between = path.position((number + 0.3) * step)
        assert min(a, b) - 1e-6 <= between <= max(a, b) + 1e-6


# Lines.


@SAME
@given(
    st.lists(st.tuples(PLACES, PLACES, st.none() | SPEEDS, st.none() | RAMPS), min_size=1, max_size=4),
    SPEEDS,
    RAMPS,
)
def test_a_line_is_straight_and_keeps_every_axis_s_limits(rows, velocity, acceleration):
    names = [f"a{number}" for number in range(len(rows))]
    starts = {name: row[0] for name, row in zip(names, rows, strict=True)}
    ends = {name: row[1] for name, row in zip(names, rows, strict=True)}
    axes = {
        name: parameters(
            name, dictionary_of(GENERIC), limits=AxisLimits(velocity=row[2], acceleration=row[3])
        )
        for name, row in zip(names, rows, strict=True)
    }
    length = math.dist(list(starts.values()), list(ends.values()))
    assume(length == 0 or length > 1e-3)
    way, speed = plan_line(starts, ends, axes, velocity, acceleration)
    assert way.at(0.0) == tuple(starts.values())
    assert way.at(way.length) == pytest.approx(tuple(ends.values()))
    if length == 0:
        return
    for number, name in enumerate(names):
        far, limits = abs(ends[name] - starts[name]), axes[name].limits
        assert min(speed, *way.max_speeds) * far <= min(velocity, limits.velocity or math.inf) * (1 + 1e-9)
        assert way.accelerations[number] <= min(acceleration, limits.acceleration or math.inf) * (1 + 1e-9)
    third = way.at(way.length / 3)
    parts = [
        (third[number] - starts[name]) / (ends[name] - starts[name])
        for number, name in enumerate(names)
        if abs(ends[name] - starts[name]) > 1
    ]
    assert all(part == pytest.approx(1 / 3, abs=1e-6) for part in parts)


# The clock of a path.


@SAME
@given(TRAPEZOIDS, st.floats(0.0, 1.0), st.floats(1.0, 1e4), st.sampled_from([0.001, 0.004, 0.01]))
def test_braking_a_path_stays_on_it_and_within_the_deceleration(path, share, deceleration, period):
    assume(0.05 < path.duration < 50)
    clock = PathClock()
    before = path.start
    cycles = int(share * path.duration / period)
    assume(cycles <= 2_000)
    for _ in range(cycles):
        before = path.position(clock.t)
        clock.advance(period)
    assert clock.t == pytest.approx(cycles * period)  # exactly one period per cycle
    here = path.position(clock.t)
    speed = abs(here - before) / period
    clock.brake(path.position, deceleration)
    last, noise = clock.t, 1e-9 * (1 + abs(path.start) + abs(path.end)) / period
    for _ in range(int(1.2 * speed / deceleration / period) + 5):
        clock.advance(period)
        assert last <= clock.t <= last + period * (1 + 1e-9)  # never backwards, never faster than time
        now = abs(path.position(clock.t) - path.position(last)) / period
        # never harder than was asked for or than the path itself slows down, never faster again; a cycle holds a corner
        corner = path.acceleration * period / 8 + noise
        assert speed - now <= max(deceleration, path.acceleration) * period + corner
        assert now <= speed + corner
        last, speed = clock.t, now
    assert clock.stopped or clock.t >= path.duration
    assert clock.braking


@SAME
@given(st.floats(0.1, 1e3), st.floats(1.0, 1e4))
def test_an_even_motion_brakes_over_its_braking_distance(speed, deceleration):
    """The oracle: v² / 2a, and the distance of one period more or less."""
    period = 0.001
    assume(speed / deceleration < 5)
    clock = PathClock()
    for _ in range(3):
        clock.advance(period)
    start = clock.t
    clock.brake(lambda t: speed * t, deceleration)
    while not clock.stopped:
        clock.advance(period)
    way = speed * (clock.t - start)
    assert way == pytest.approx(speed**2 / (2 * deceleration), abs=speed * period * 1.01)


def test_a_clock_that_has_not_begun_stops_at_once_and_braking_twice_changes_nothing():
    clock = PathClock()
    clock.brake(lambda t: t, 1.0)
    assert clock.stopped
    clock.advance(0.01)
    assert clock.t == 0.0
    moving = PathClock()
    moving.advance(0.01)
    moving.brake(lambda t: t, 1.0)
    moving.advance(0.01)
    rate = moving.rate
    moving.brake(lambda t: t, 1000.0)
    moving.advance(0.01)
    assert moving.rate == pytest.approx(rate - 0.01)


# 60C2h.


@SAME
@given(st.integers(1, 255), st.integers(-6, 0))
def test_every_period_that_60c2h_can_hold_is_written_exactly(value, exponent):
    period = value * 10.0**exponent
    written, power = interpolation_period(period)
    assert 1 <= written <= 255
    assert written * 10.0**power == pytest.approx(period, rel=1e-9)


@pytest.mark.parametrize(
    ("period", "pair"),
    [(0.01, (10, -3)), (0.0025, (25, -4)), (0.001, (1, -3)), (0.0005, (5, -4)), (0.25, (250, -3))],
)
def test_periods_as_drives_know_them(period, pair):
    assert interpolation_period(period) == pair


@pytest.mark.parametrize("period", [0.0012345, 1 / 300, 0.25625])
def test_a_period_that_60c2h_cannot_hold_is_refused(period):
    with pytest.raises(LimitError, match="60C2h"):
        interpolation_period(period)


# Policy and gate.

AXES = "uvwxyz"


@SAME
@given(
    st.dictionaries(st.sampled_from(["g", "h", "i"]), st.sets(st.sampled_from(AXES), min_size=1)),
    st.sampled_from(AXES),
)
def test_a_failure_stops_the_other_axes_of_its_groups_or_all_axes(groups, failed):
    policy = FaultPolicy(tuple(AXES), {name: sorted(members) for name, members in groups.items()})
    stopped = policy.stops(failed)
    assert failed not in stopped
    mates = [members for members in groups.values() if failed in members]
    if mates:
        assert stopped == set().union(*mates) - {failed}
    else:
        assert stopped == set(AXES) - {failed}


@SAME
@given(st.sets(st.sampled_from(AXES), min_size=1))
def test_each_axis_that_is_stopped_is_reported_a_failed_one_as_the_reason(failed):
    told = FaultPolicy(tuple(AXES), {"g": ["x", "y"]}).all_stops(sorted(failed))
    assert set(told) & failed == set()
    assert set(told.values()) <= failed
    for axis in "xy":  # axes of a group are stopped by each other or by an axis outside every group
        assert (axis in told) == (axis not in failed and bool(failed & ({"x", "y"} | set("uvwz"))))


@SAME
@given(st.lists(st.frozensets(st.sampled_from([1, 2, 3, 4])), max_size=30))
def test_no_axis_passes_a_start_barrier_before_all_wait_in_one_cycle_and_then_all_do(cycles):
    gate, everybody, opened = StartBarrier(), {1: object(), 2: object(), 3: object(), 4: object()}, False
    for here in cycles:
        assert {gate.pass_through(everybody[who]) for who in here} <= {opened}
        gate.update(4)
        opened = opened or len(here) == 4
        assert gate.is_open == opened
    if opened:
        assert all(gate.pass_through(one) for one in everybody.values())


def test_the_open_start_barrier_lets_every_axis_through_and_stores_none():
    assert OPEN.is_open
    assert OPEN.pass_through(object())
