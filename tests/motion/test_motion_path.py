"""Ways of groups: their pieces, their limits, and travel along them, which is computed here a second time by differences."""

from __future__ import annotations

import math
import random
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.motion.group.path import CycleVelocity, Path, build_path
from axisbus.motion.group.path_builder import arc_about, arc_through, polyline
from axisbus.motion.group.path_motion import AxisPathShare, PathPosition
from axisbus.motion.group.path_speed import PathSpeed
from axisbus.motion.group.segments import Corner, Straight, corner, direction, turned
from axisbus.motion.parameters import AxisLimits

SAME = settings(deadline=None, derandomize=True)
PLACES = st.floats(-20.0, 20.0)
PERIODS = st.sampled_from([0.001, 0.004, 0.01])


def points(least: int, most: int) -> st.SearchStrategy[list[tuple[float, ...]]]:
    return st.integers(1, 3).flatmap(
        lambda n: st.lists(st.tuples(*[PLACES] * n), min_size=least, max_size=most)
    )


def limits(number: int, kind: int) -> list[AxisLimits]:
    """Of some axes: none, or odd ones."""
    some = [
        AxisLimits(),
        AxisLimits(velocity=90.0),
        AxisLimits(acceleration=400.0),
        AxisLimits(velocity=30.0, acceleration=150.0),
    ]
    return [some[(kind + place) % len(some)] for place in range(number)]


def seen(way: Path, count: int = 4000) -> list[tuple[float, ...]]:
    return [way.at(way.length * step / count) for step in range(count + 1)]


# Corners.


@pytest.mark.parametrize("angle", [0.01, 1.0, 2.0, 3.1])
@pytest.mark.parametrize("share", [0.1, 0.5])
def test_the_position_in_a_corner_is_the_integral_of_its_direction(angle, share):
    count, x, y = 4000, 0.0, 0.0
    for step in range(count):
        at = share * (step + 0.5) / count
        heading = angle * (at - math.sin(2 * math.pi * at) / (2 * math.pi))
        x, y = x + math.cos(heading) * share / count, y + math.sin(heading) * share / count
    assert turned(angle, share) == pytest.approx((x, y), abs=1e-7)


@SAME
@given(points(3, 3), st.floats(0.01, 5.0))
def test_a_corner_joins_its_lines_within_the_tolerance(three, within):
    a, tip, b = three
    (into, came), (out, goes) = direction(a, tip), direction(tip, b)
    if min(came, goes) < 1e-3:
        return
    try:
        found = corner(tip, into, out, within=within, max_trim=min(came, goes))
    except ValueError:
        return
    if found is None or found.angle < 1e-6:
        return
    assert isinstance(found, Corner)
    assert found.trim <= min(came, goes) * (1 + 1e-9)
    before = tuple(t - found.trim * part for t, part in zip(tip, into, strict=True))
    after = tuple(t + found.trim * part for t, part in zip(tip, out, strict=True))
    assert found.at(0.0) == pytest.approx(before, abs=1e-6)
    assert found.at(found.length) == pytest.approx(after, abs=1e-6)
    assert math.dist(found.at(0.5 * found.length), tip) <= within * (1 + 1e-6)
    assert math.dist(found.at(0.5 * found.length), found.at(0.5001 * found.length)) <= 2e-4 * found.length
    places = [found.at(found.length * step / 500) for step in range(501)]
    steps = [math.dist(p, q) * 500 / found.length for p, q in pairwise(places)]
    assert min(steps) > 0.999
    assert max(steps) < 1.001


def test_without_a_turn_there_is_no_corner_and_a_reversal_cannot_be_rounded():
    assert corner((0.0, 0.0), (1.0, 0.0), (1.0, 0.0), within=1.0, max_trim=1.0) is None
    with pytest.raises(ValueError, match="a reversal of the path"):
        corner((0.0, 0.0), (1.0, 0.0), (-1.0, 0.0), within=1.0, max_trim=1.0)


# Arcs.


def test_arcs_by_hand():
    quarter = arc_about((10.0, 0.0), (0.0, 0.0), (0.0, 10.0), clockwise=False)
    assert quarter.length == pytest.approx(5.0 * math.pi)
    assert quarter.at(quarter.length / 2) == pytest.approx((math.sqrt(50.0), math.sqrt(50.0)))
    back = arc_about((10.0, 0.0), (0.0, 0.0), (0.0, 10.0), clockwise=True)
    assert back.length == pytest.approx(15.0 * math.pi)
    assert back.box == (pytest.approx((-10.0, -10.0)), pytest.approx((10.0, 10.0)))
    once = arc_about((10.0, 0.0), (0.0, 0.0), (10.0, 0.0), clockwise=False)
    assert once.angle == math.tau
    assert once.at(once.length) == pytest.approx((10.0, 0.0))
    tilted = arc_through((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (-1.0, 0.0, 0.0))
    assert (tilted.angle, tilted.radius) == pytest.approx((math.pi, 1.0))
    assert tilted.speed_ratios == pytest.approx((1.0, 0.0, 1.0))


@SAME
@given(points(3, 3))
def test_an_arc_passes_through_its_points_and_stays_in_its_box(three):
    start, via, end = three
    if len(start) < 2:
        return
    try:
        arc = arc_through(start, via, end)
    except ValueError:
        return
    if arc.radius > 1e4:
        return
    assert arc.at(0.0) == pytest.approx(start, abs=1e-5)
    assert arc.at(arc.length) == pytest.approx(end, abs=1e-4)
    places = [arc.at(arc.length * step / 3000) for step in range(3001)]
    assert min(math.dist(place, via) for place in places) < arc.length / 2000 + 1e-4
    low, high = arc.box
    for axis, column in enumerate(zip(*places, strict=True)):
        assert low[axis] - 1e-6 <= min(column) <= low[axis] + 1e-3 * arc.radius
        assert high[axis] + 1e-6 >= max(column) >= high[axis] - 1e-3 * arc.radius


@pytest.mark.parametrize(
    "three", [((0.0, 0.0), (1.0, 1.0), (2.0, 2.0)), ((0.0, 0.0), (0.0, 0.0), (1.0, 0.0)), ((1.0, 0.0),) * 3]
)
def test_points_on_a_line_make_no_circle(three):
    with pytest.raises(ValueError, match="on one line"):
        arc_through(*three)


@pytest.mark.parametrize("centre", [(10.0, 0.0), (4.0, 0.0)])
def test_a_centre_must_be_in_the_middle(centre):
    with pytest.raises(ValueError, match="as far"):
        arc_about((10.0, 0.0), centre, (0.0, 10.0), clockwise=False)


# Lines through points.


def test_lines_are_cut_at_their_corners_and_stop_at_reversals():
    corners = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (20.0, 10.0), (15.0, 10.0)]
    pieces, stops = polyline(corners, 1.0)
    kinds = [type(piece).__name__ for piece in pieces]
    assert kinds == ["Straight", "Corner", "Straight", "Corner", "Straight", "Straight"]
    assert stops == {4}  # it goes straight back there
    pieces, stops = polyline(corners, 0.0)
    assert [type(piece) for piece in pieces] == [Straight] * 4
    assert stops == {0, 1, 2}
    pieces, stops = polyline([(0.0, 0.0), (1.0, 0.0), (2.0, 0.0), (2.0, 0.0)], 0.5)
    assert (len(pieces), stops) == (2, set())  # straight on
    pieces, stops = polyline([(3.0, 4.0)] * 3, 0.5)
    assert [(piece.length, piece.at(0.0)) for piece in pieces] == [(0.0, (3.0, 4.0))]


@settings(SAME, max_examples=40)
@given(points(2, 7), st.sampled_from([0.0, 0.1, 2.0]))
def test_a_path_is_one_piece_without_gaps_from_its_first_point_to_its_last(places, blend):
    pieces, _ = polyline(places, blend)
    for before, after in pairwise(pieces):
        assert before.at(before.length) == pytest.approx(after.at(0.0), abs=1e-6)
    assert pieces[0].at(0.0) == pytest.approx(places[0], abs=1e-6)
    assert pieces[-1].at(pieces[-1].length) == pytest.approx(places[-1], abs=1e-6)
    walked = seen(build_path(pieces, [AxisLimits()] * len(places[0]), 100.0), 20_000)
    for place in places:
        reach = blend + 1e-6 + sum(piece.length for piece in pieces) / 20_000
        assert min(math.dist(place, other) for other in walked) <= reach


# Travel.


class Trip:
    """The motion of a group on a path: its positions, cycle by cycle, until standstill at the end."""

    def __init__(self, way: Path, velocity: float, period: float, factors: list[float]) -> None:
        self.travel = PathSpeed()
        self.travel.begin(way, velocity)
        self.way, self.period = way, period
        self.places = [way.at(0.0)]
        self.speeds = [0.0]
        self._factors = factors
        self._run()
        self.places += [self.places[-1]] * 2

    def _run(self) -> None:
        cycles = 0
        while self.travel.t < self.way.length:
            if self._factors and cycles % 37 == 36:
                self.travel.factor = self._factors[(cycles // 37) % len(self._factors)]
            self.travel.advance(self.period)
            self.places.append(self.way.at(self.travel.t))
            self.speeds.append(self.travel.speed)
            cycles += 1
            assert cycles < 50_000

    def worst(self, axis: int) -> tuple[float, float]:
        """The highest speed and acceleration of an axis, by differences."""
        column = [place[axis] for place in self.places]
        speeds = [(b - a) / self.period for a, b in pairwise(column)]
        bends = [(b - a) / self.period for a, b in pairwise(speeds)]
        return max(map(abs, speeds)), max(map(abs, bends))


@settings(deadline=None, derandomize=True, max_examples=200)
@given(
    points(2, 6),
    st.sampled_from([0.0, 0.1, 2.0]),
    st.integers(0, 3),
    st.floats(20.0, 300.0),
    st.floats(50.0, 3000.0),
    PERIODS,
    st.lists(st.sampled_from([0.4, 1.0, 1.2, 1.5]), max_size=5),
)
def test_no_axis_exceeds_its_limits_for_any_override(
    places, blend, kind, velocity, acceleration, period, factors
):
    pieces, stops = polyline(places, blend)
    axes = limits(len(places[0]), kind)
    way = build_path(pieces, axes, acceleration, stops)
    trip = Trip(way, velocity, period, factors)
    noise = 1e-9 / period**2
    for number, limit in enumerate(axes):
        speed, bend = trip.worst(number)
        assert speed <= min(1.5 * velocity, limit.velocity or math.inf) * (1 + 1e-6) + 1e-9 / period
        assert bend <= min(acceleration, limit.acceleration or math.inf) * (1 + 1e-6) + noise
    assert trip.places[-1] == pytest.approx(places[-1], abs=1e-6)


def square(blend: float, acceleration: float = 500.0) -> Path:
    pieces, stops = polyline([(0.0, 0.0), (40.0, 0.0), (40.0, 40.0), (0.0, 40.0)], blend)
    return build_path(pieces, [AxisLimits()] * 2, acceleration, stops)


def test_the_velocity_is_kept_through_corners_that_are_wide_enough_for_it():
    wide = Trip(square(4.0), 30.0, 0.004, [])
    assert min(wide.speeds[20:-20]) == pytest.approx(30.0)
    narrow = Trip(square(0.1), 30.0, 0.004, [])
    assert 1.0 < min(narrow.speeds[20:-20]) < 29.0
    none = Trip(square(0.0), 30.0, 0.004, [])
    assert none.speeds.count(0.0) == 4  # the beginning, two corners, the end


def test_a_path_takes_the_time_of_its_trapezoid():
    way = build_path([Straight((0.0,), (90.0,), 90.0)], [AxisLimits()], 500.0)
    trip = Trip(way, 100.0, 0.01, [])
    assert (len(trip.speeds) - 1) * 0.01 == pytest.approx(1.1, abs=0.011)  # 0.2 up, 0.7 along, 0.2 down
    assert max(trip.speeds) == 100.0


@pytest.mark.parametrize("length", [1e-12, 1e-9, 1e-7, 1e-5, 1e-3])
@pytest.mark.parametrize("unit", [1.0, None])
def test_the_shortest_path_is_completed_within_some_cycles(length, unit):
    size = length if unit is None else unit  # a line is one of length 1, however short it is
    way = build_path([Straight((0.0,), (length,), size)], [AxisLimits()], 5000.0 * size / length)
    travel = PathSpeed()
    travel.begin(way, 100.0 * size / length)
    for _ in range(5):
        travel.advance(0.01)
    assert travel.t == way.length


def test_a_held_motion_stops_on_its_path_and_continues():
    way = square(1.0)
    travel = PathSpeed()
    travel.begin(way, 30.0)
    for _ in range(100):
        travel.advance(0.01)
    travel.factor = 0.0
    for _ in range(20):
        travel.advance(0.01)
    held = travel.t
    assert (travel.speed, travel.stopped) == (0.0, False)
    travel.advance(0.01)
    assert travel.t == held
    travel.factor = 1.0
    travel.advance(0.01)
    assert travel.t > held


def test_braking_takes_the_distance_of_its_speed_and_is_not_scaled_by_an_override():
    way = build_path([Straight((0.0,), (900.0,), 900.0)], [AxisLimits()], 500.0)
    ends = []
    for factor in (1.0, 1.5, 0.5):
        travel = PathSpeed()
        travel.begin(way, 100.0)
        for _ in range(100):
            travel.advance(0.01)
        travel.brake()
        travel.factor, begun, cycles = factor, travel.t, 0
        while not travel.stopped:
            travel.advance(0.01)
            cycles += 1
        ends.append((travel.t - begun, cycles))
    assert ends == [(pytest.approx(10.0), 20)] * 3


def test_a_path_can_be_continued_from_its_interruption():
    way, travel = square(1.0), PathSpeed()
    travel.begin(way, 30.0, 50.0)
    assert (travel.t, travel.speed) == (50.0, 0.0)
    travel.advance(0.01)
    assert 50.0 < travel.t < 50.03


@pytest.mark.parametrize("window", [2, 5, 40])
@pytest.mark.parametrize("length", [0.5, 30.0, 400.0])
def test_a_mean_of_some_cycles_limits_the_jerk_and_reaches_the_same_end(window, length):
    way = build_path([Straight((0.0,), (length,), length)], [AxisLimits()], 500.0)
    travel, places, chance = PathSpeed(), [0.0], random.Random(window)
    travel.begin(way, 100.0, 0.0, window)
    while travel.t < length:
        if chance.random() < 0.02:
            travel.factor = chance.choice((0.3, 1.0, 1.5))
        travel.advance(0.004)
        places.append(travel.t)
        assert len(places) < 20_000
    places = [0.0, 0.0, *places, length, length, length]
    speeds, bends, jerks = (differences(places, order, 0.004) for order in (1, 2, 3))
    assert places[-4] == length
    assert min(speeds) >= -1e-9
    assert max(speeds) <= 150.0 * (1 + 1e-9)
    assert max(map(abs, bends)) <= 500.0 * (1 + 1e-6)
    assert max(map(abs, jerks)) <= 2.0 * 500.0 / (window * 0.004) * (1 + 1e-6)


def differences(values: list[float], order: int, period: float) -> list[float]:
    for _ in range(order):
        values = [(b - a) / period for a, b in pairwise(values)]
    return values


@pytest.mark.parametrize(("left", "fits"), [(0.09, False), (0.12, True)])
def test_a_continuation_must_be_slow_enough_if_its_section_ends_within_the_cycle(left, fits):
    """Within a cycle it could stop, but the section ends before, with a corner that is slower."""
    travel, period, ramp = PathSpeed(), 0.01, 2200.0
    straight = build_path([Straight((0.0, 0.0), (10.0, 0.0), 10.0)], [AxisLimits()] * 2, ramp)
    travel.begin(straight, 20.8, 0.0)
    travel.speed, travel._ahead = 20.8, 10.0 - left
    slow = replace(straight, max_exit_speeds=(2.1,))
    assert travel.fits(slow, period) is fits


def test_a_halt_under_a_limit_of_jerk_ends_once_the_mean_has_reached_the_path():
    way = build_path([Straight((0.0,), (900.0,), 900.0)], [AxisLimits()], 500.0)
    travel = PathSpeed()
    travel.begin(way, 100.0, 0.0, 10)
    for _ in range(100):
        travel.advance(0.01)
    travel.brake()
    cycles = 0
    while not travel.stopped:
        travel.advance(0.01)
        cycles += 1
    assert cycles == 20 + 9
    travel.advance(0.01)
    again = PathSpeed()
    again.begin(way, 100.0, travel.t, 10)
    assert again.t == travel.t


def test_a_path_ends_for_any_given_end():
    way = replace(square(1.0), max_exit_speeds=(9.0,) * len(square(1.0).max_exit_speeds))
    travel = PathSpeed()
    travel.begin(way, 30.0)
    for _ in range(3000):
        travel.advance(0.01)
    assert (travel.t, travel.speed) == (way.length, 0.0)


# Shares.


def test_an_initial_deviation_of_the_axes_is_removed_along_the_path():
    way = square(1.0)
    along = PathPosition(way, 0.0, (0.01, -0.02))
    x, y = AxisPathShare(along, 0, 30.0), AxisPathShare(along, 1, 30.0)
    assert (x.position(0.0), y.position(0.0)) == (0.01, -0.02)
    assert x.position(20.0) == pytest.approx(20.0, abs=0.01)
    assert -0.02 < y.position(20.0) < 0.0
    assert (x.position(45.0), y.position(45.0)) == way.at(45.0)
    assert (x.span, x.top_speed, x.duration) == ((0.0, 40.0), 30.0, way.length)
    assert x.top_acceleration == pytest.approx(500.0)


def test_no_cycle_passes_more_stretches_than_the_limit():
    dense = [(30.0 * math.sin(k / 100), 0.003 * k) for k in range(3000)]
    pieces, stops = polyline(dense, 0.0005)
    way = build_path(pieces, [AxisLimits()] * 2, 5000.0, stops, CycleVelocity(500.0, 0.004))
    travel, most = PathSpeed(), 0
    travel.begin(way, 500.0)
    while travel.t < way.length:
        before = way.number(travel.t)
        travel.advance(0.004)
        most = max(most, way.number(travel.t) - before)
    assert 2 < most <= 16


def test_a_corner_has_no_more_sections_than_a_cycle_can_use():
    pieces, stops = polyline([(0.0, 0.0), (40.0, 0.0), (40.0, 40.0)], 1.0)
    counts = [
        len(build_path(pieces, [AxisLimits()] * 2, 500.0, stops, CycleVelocity(velocity, 0.004)).max_speeds)
        - 2
        for velocity in (1.0, 30.0, 1000.0)
    ]
    assert counts[0] == 12
    assert 12 >= counts[1] >= counts[2] > 1
    coarse = build_path(pieces, [AxisLimits()] * 2, 500.0, stops, CycleVelocity(1000.0, 0.5))
    assert len(coarse.max_speeds) == 3
