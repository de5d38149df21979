"""The curve through points, its demands on the axes, and the pace along it: pure, against independent sums."""

from __future__ import annotations

import math
import random
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.errors import LimitError
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.point_stream.commands import StreamSegment
from axisbus.motion.point_stream.curve_fit import (
    SHARE,
    CurveFit,
    Motion,
    StreamLimits,
    StreamPoint,
    at,
    coefficients,
    controls,
    derived,
    reach,
)
from axisbus.motion.point_stream.stream import StreamStartBarrier, StreamTimeline, StreamTravel

VALUES = st.floats(-100.0, 100.0)
MOTIONS = st.builds(Motion, VALUES, VALUES, VALUES)
HARDEST, FASTEST, BRAKING = 2000.0, 400.0, 500.0
MAY = StreamLimits("deg", (-200.0, 200.0), FASTEST, HARDEST, "max_acceleration", BRAKING)
PERIOD = 0.004


def changes(curve, t: float, h: float) -> tuple[float, float, float]:
    """Place, speed and acceleration by differences."""
    before, here, after = at(curve, t - h), at(curve, t), at(curve, t + h)
    return here, (after - before) / (2 * h), (after - 2 * here + before) / (h * h)


@given(MOTIONS, MOTIONS, st.floats(0.5, 2.0))
def test_a_curve_has_the_motions_of_both_ends(begin, end, seconds):
    curve = coefficients(begin, end, seconds)
    for motion, t in ((begin, 0.0), (end, seconds)):
        assert changes(curve, t, 1e-4) == pytest.approx(motion, abs=2e-2)


@given(MOTIONS, MOTIONS, st.floats(0.5, 2.0))
def test_the_reach_of_a_span_is_the_range_of_its_curve(begin, end, seconds):
    curve, points = coefficients(begin, end, seconds), controls(begin, end, seconds)
    values = [at(curve, seconds * n / 500) for n in range(501)]
    low, high = reach(points)
    size = max(points) - min(points) + 1e-9
    assert low - 1e-9 <= min(values) <= low + 0.01 * size
    assert high - 0.01 * size <= max(values) <= high + 1e-9
    speeds = derived(points, seconds)
    found = [changes(curve, seconds * n / 100, 1e-5)[1] for n in range(1, 100)]
    assert min(speeds) - 1e-2 <= min(found) <= max(found) <= max(speeds) + 1e-2


def joined(points) -> list[StreamSegment]:
    joining = CurveFit({"x": MAY}, "x.stream")
    segments = [joining.take(StreamPoint(t, (x,))) for t, x in points]
    return [segment for segment in [*segments, joining.end()] if segment is not None]


def test_a_joined_stream_meets_its_points_without_a_jump_in_position_velocity_or_acceleration():
    times = [0.02 * n + (0.004 if n % 2 else 0.0) for n in range(60)]
    segments = joined((t, 30.0 * math.sin(4.0 * t)) for t in times)
    assert [segment.seconds for segment in segments] == pytest.approx([b - a for a, b in pairwise(times)])
    for one, other in pairwise(segments):
        ends = changes(one.curves[0], one.seconds, 1e-4), changes(other.curves[0], 0.0, 1e-4)
        assert ends[0] == pytest.approx(ends[1], rel=1e-3, abs=0.05)
    for t, segment in zip(times, segments, strict=False):
        assert at(segment.curves[0], 0.0) == pytest.approx(30.0 * math.sin(4.0 * t))
        for n in range(5):
            there = at(segment.curves[0], segment.seconds * n / 4)
            assert there == pytest.approx(30.0 * math.sin(4.0 * (t + segment.seconds * n / 4)), abs=0.005)


@pytest.mark.parametrize("path", [lambda t: 7.0 - 50.0 * t, lambda t: 100.0 * t * t])
def test_straight_lines_and_constant_accelerations_are_unchanged(path):
    for number, segment in enumerate(joined((0.01 * n, path(0.01 * n)) for n in range(9))):
        assert at(segment.curves[0], 0.004) == pytest.approx(path(0.01 * number + 0.004))


def test_a_rejected_point_changes_nothing():
    points = [(0.01 * n, 10.0 * math.sin(3.0 * 0.01 * n)) for n in range(20)]
    joining, other = CurveFit({"x": MAY}, "x.stream"), CurveFit({"x": MAY}, "x.stream")
    for t, x in points:
        for wrong in (x + 9.0, x - 1.0, 500.0):
            if t > 0.015:  # the first two make a straight line, which an axis takes up at its own pace
                with pytest.raises(LimitError, match=f"point {joining.count + 1} takes x beyond its"):
                    joining.take(StreamPoint(t, (wrong,)))
        assert joining.take(StreamPoint(t, (x,))) == other.take(StreamPoint(t, (x,)))
    assert joining.end() == other.end()


def test_accepted_points_can_be_ended_anywhere():
    rnd = random.Random(5)
    joining, x = CurveFit({"x": MAY}, "x.stream"), 0.0
    taken = 0
    for number in range(400):
        wanted = x + rnd.uniform(-0.25, 0.25)
        try:
            joining.take(StreamPoint(0.02 * number, (wanted,)))
        except LimitError:
            continue
        x, taken = wanted, taken + 1
        joining.end()
    assert taken > 40


def test_a_point_from_which_the_axis_could_not_brake_in_time_is_refused():
    lame = MAY._replace(braking=10.0)
    joining = CurveFit({"x": lame}, "x.stream")
    with pytest.raises(LimitError, match="could not brake in time"):
        for number in range(9):
            joining.take(StreamPoint(0.01 * number, (3.0 * 0.01 * number * 50.0,)))


def random_spans(rnd: random.Random) -> list[StreamSegment]:
    """The spans of accepted points, some of them near the limits."""
    joining, segments, t = CurveFit({"x": MAY}, "x.stream"), [], 0.0
    size, pulse = rnd.uniform(1.0, 60.0), rnd.uniform(0.5, 12.0)
    for _ in range(rnd.randint(2, 120)):
        grown = min(t / 0.5, 1.0) ** 3 * (10.0 - 15.0 * min(t / 0.5, 1.0) + 6.0 * min(t / 0.5, 1.0) ** 2)
        try:
            segments.append(joining.take(StreamPoint(t, (size * grown * math.sin(pulse * t),))))
        except LimitError:
            break
        t += PERIOD * rnd.choice([0.13, 0.5, 1.0, 1.0, 2.7, 9.0])
    return [segment for segment in [*segments, joining.end()] if segment is not None]


@settings(max_examples=150, deadline=None, derandomize=True)
@given(st.integers(0, 100_000))
def test_late_points_halts_and_overrides_never_exceed_the_limits_of_an_axis(seed):
    """Spans come in bursts, late and not at all; it is halted, and slowed by an override. The last place is the end."""
    rnd = random.Random(seed)
    segments, course, travel = random_spans(rnd), StreamTimeline(), StreamTravel()
    if not segments:
        return
    course.add(segments.pop(0))
    travel.begin(course, 1.0)
    places, cycles = [course.coordinates(0.0)[0]] * 3, 0
    while segments or travel.t < course.length:
        for _ in range(rnd.choice([0, 0, 1, 1, 2, 40])):
            if segments:
                course.add(segments.pop(0))
        if rnd.random() < 0.01:
            travel.factor = rnd.choice([0.0, 0.3, 1.0, 1.5])
        if rnd.random() < 0.003:
            travel.brake()
        elif travel.stopped or rnd.random() < 0.1:
            travel.braking, travel.factor = False, max(travel.factor, 0.3)
        before = travel.t
        travel.advance(PERIOD)
        course.forget(course.number(travel.t) - 2)
        assert before <= travel.t <= course.length + 1e-9
        assert travel.t - before <= PERIOD + 1e-9
        assert course.waiting <= len(segments) + 500
        places.append(course.coordinates(travel.t)[0])
        cycles += 1
        assert cycles < 100_000
    places += [places[-1]] * 3
    speeds = [(b - a) / PERIOD for a, b in pairwise(places)]
    rates = [(b - a) / PERIOD for a, b in pairwise(speeds)]
    assert max(map(abs, speeds)) <= FASTEST * 1.0001
    assert max(map(abs, rates)) <= HARDEST * 1.0001 + 1e-3
    assert places[-1] == pytest.approx(course.coordinates(course.length)[0])


def test_a_pace_stays_that_of_the_points_while_enough_is_known():
    """Also over spans whose ramps differ by powers of ten, and that are shorter than a cycle."""
    course, travel = StreamTimeline(), StreamTravel()
    for number in range(400):
        course.add(StreamSegment(0.0011, 10.0 ** (number % 5), ((float(number), 0.0, 0.0, 0.0, 0.0, 0.0),)))
    travel.begin(course, 1.0)
    before = 0.0
    while travel.t < 0.25:
        travel.advance(PERIOD)
        assert travel.speed >= before
        before = travel.speed
    assert travel.speed == 1.0


@pytest.mark.parametrize("period", [0.001, 0.004, 0.01, 0.02])
@pytest.mark.parametrize("seconds", [0.1, 1.0, 0.7, 1 / 3, 12.345])
def test_a_stream_at_rest_reaches_its_end_exactly_for_any_ramp(period, seconds):
    course, travel, still = StreamTimeline(), StreamTravel(), ((0.0,) * 6,)
    for segment in (
        StreamSegment(period, 1e4, still),
        StreamSegment(seconds, 25.0, still),
        StreamSegment(period, 1e4, still),
    ):
        course.add(segment)
    travel.begin(course, 1.0)
    for _ in range(round(seconds / period) + 4):
        travel.advance(period)
    assert travel.t == course.length
    assert travel.speed == 0.0


def test_the_axes_may_use_four_fifths_of_their_acceleration():
    def hard(share: float) -> list[tuple[float, float]]:
        return [(0.01 * n, 0.5 * share * SHARE * HARDEST * (0.01 * n) ** 2) for n in range(9)]

    assert len(joined(hard(0.99))) == 8
    with pytest.raises(LimitError, match="80% of max_acceleration"):
        joined(hard(1.01))


def test_a_start_barrier_with_a_condition_opens_when_all_are_there_and_it_holds():
    for gate, opens in ((StartBarrier(), True), (StreamStartBarrier(), False)):
        for waiting in ("x", "y"):
            gate.pass_through(waiting)
        gate.update(2)
        assert gate.is_open is opens
    gate.may_open = True
    gate.pass_through("x")
    gate.update(2)
    assert not gate.is_open
    for waiting in ("x", "y"):
        gate.pass_through(waiting)
    gate.update(2)
    assert gate.is_open
