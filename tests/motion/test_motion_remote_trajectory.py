"""A trajectory in samples: in each cycle exactly the sample, smooth between them, asked for in time, and soon forgotten."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.core.process.trajectory_feeder import Sampler
from axisbus.errors import ArgumentError, CommandError
from axisbus.motion.moves.remote_trajectory import Curve, Streamed, StreamHead, following
from axisbus.motion.path_limit_check import Ramped
from axisbus.motion.pathclock import PathClock
from axisbus.motion.position_limits import LookaheadTrajectory
from axisbus.motion.trajectory import SampledTrajectory, TrapezoidalTrajectory

STEP = 0.004


def curve(positions, step: float = 1.0, last: float = 1.0) -> Curve:
    """Samples ``step`` apart, the last interval ``last`` of a step long."""
    times = [number * step for number in range(len(positions))]
    times[-1] = times[-2] + last * step
    return Curve(step, 0, tuple(times), tuple(map(float, positions)))


def between(line: Curve, parts: int = 50) -> list[float]:
    """Points of a curve from its first to its last time."""
    begin, end = line.times[0], line.times[-1]
    return [line.at(begin + (end - begin) * part / parts) for part in range(parts)]


# The curve.


@settings(max_examples=200, deadline=None, derandomize=True)
@given(st.lists(st.floats(-1e3, 1e3), min_size=2, max_size=12), st.floats(1e-4, 1.0), st.floats(1e-3, 1.0))
def test_at_the_time_of_a_sample_the_curve_has_its_value_and_never_jumps(positions, step, last):
    line = curve(positions, step, last)
    for t, position in zip(line.times, line.positions, strict=True):
        assert line.at(t) == position
    reach = max(positions) - min(positions)
    for t, position in zip(line.times[1:-1], line.positions[1:-1], strict=True):
        assert line.at(math.nextafter(t, 0.0)) == pytest.approx(position, abs=1e-6 * reach + 1e-9)


@given(st.floats(-1e3, 1e3), st.floats(-1e3, 1e3), st.floats(0.01, 0.99), st.integers(2, 6))
def test_a_straight_line_is_one(start, slope, share, index):
    line = curve([start + slope * number for number in range(10)])
    assert line.at(index + share) == pytest.approx(start + slope * (index + share), rel=1e-12, abs=1e-9)


@given(st.floats(-10.0, 10.0), st.floats(0.01, 0.99), st.integers(2, 6), st.floats(0.01, 1.0))
def test_a_constant_acceleration_is_one_up_to_a_short_last_interval(half, share, index, last):
    line = curve([half * number**2 for number in range(8)], last=last)
    line = replace(line, positions=(*line.positions[:-1], half * line.times[-1] ** 2))
    assert line.at(index - 1 + share) == pytest.approx(half * (index - 1 + share) ** 2, abs=1e-9)


@pytest.mark.parametrize("turned", [1.0, -1.0])
@pytest.mark.parametrize("last", [1.0, 0.3, 1e-9])
@pytest.mark.parametrize("ways", [[5, 4, 3, 2, 1], [5, 5, 5, 5, 5], [9, 9, 0.01], [3, 2, 1, 0, 0, 0, 0]])
def test_a_constant_position_is_not_overshot(ways, last, turned):
    positions = [turned * sum(ways[:number]) for number in range(len(ways) + 1)]
    seen = between(curve(positions, last=last), 400)
    low, high = sorted((positions[0], positions[-1]))
    assert low <= min(seen) <= max(seen) <= high
    assert all((b - a) * turned >= -1e-12 for a, b in pairwise(seen))
    back = between(curve(positions[::-1], last=last), 400)
    assert low <= min(back) <= max(back) <= high


def test_a_time_that_was_computed_twice_makes_no_slope_of_a_rounding():
    curve = Curve(1.0, 0, (0.0, 1.0, 1.0 + 1e-9, 2.0, 3.0), (0.0, 1.0, 1.0 + 1e-7, 2.0, 3.0))
    for begin in (0.0, 1.0, 2.0):
        way = [curve.at(begin + share / 20) for share in range(21)]
        assert way == sorted(way)
        assert (way[0], way[-1]) == pytest.approx((begin, begin + 1.0), abs=1e-6)


def test_between_equal_samples_the_curve_is_constant():
    line = curve([0, 1, 2, 2, 2, 2, 5, 9])
    assert {line.at(2 + part / 20) for part in range(61)} == {2.0}


def test_a_corner_is_not_rounded_beyond_the_span_of_the_path():
    line = curve([0, 4, 8, 12, 11.5, 11, 10.5, 10, 10, 10])
    assert max(between(line)) > 12.01
    assert max(between(replace(line, span=(0.0, 12.0)))) == 12.0
    assert max(between(replace(line, span=(0.0, 12.0)).joined([10.0], [10.0]).without(3.0, 2))) == 12.0


def test_the_speed_does_not_jump_at_a_corner():
    line = curve([0, 0, 0, 0, 1, 2, 3, 4, 4, 4, 4, 3, 2, 1, 1, 1])
    tiny = 1e-6
    speeds = [(line.at(t * 0.01 + tiny) - line.at(t * 0.01)) / tiny for t in range(1490)]
    assert max(abs(b - a) for a, b in pairwise(speeds)) < 0.06


def test_a_time_that_was_computed_twice_bends_nothing():
    """The last sample of the grid a rounding error before the end."""
    line = curve([0.0, 3.0, 5.0, 6.0, 6.0 + 1e-9], last=1e-9)
    plain = curve([0.0, 3.0, 5.0, 6.0])
    assert between(line) == pytest.approx(between(plain), abs=1e-6)


# The same at the times of cycles.


def streamed(trajectory, step: float = STEP, first: float = 0.1) -> tuple[Streamed, Sampler]:
    sampler = Sampler(trajectory, step, "x")
    return Streamed(sampler.head(first)), sampler


def fill(stream: Streamed, sampler: Sampler) -> int:
    """Answer all that is asked for now; return how many times it was asked."""
    times = 0
    while (asked := stream.wanted(stream.reached)) is not None:
        stream.feed(asked[0], sampler.take(asked[1]))
        times += 1
    return times


@settings(max_examples=60, deadline=None, derandomize=True)
@given(
    st.one_of(
        st.builds(
            TrapezoidalTrajectory,
            st.floats(-9, 9),
            st.floats(-99, 99),
            st.floats(1.0, 50.0),
            st.floats(10.0, 500.0),
        ),
        st.builds(
            SampledTrajectory, st.lists(st.floats(-99, 99), min_size=2, max_size=30), st.floats(0.001, 0.3)
        ),
    ),
    st.sampled_from([0.001, 0.002, 0.004, 0.01, 1 / 300]),
)
def test_in_every_cycle_it_is_exactly_the_trajectory(path, step):
    stream, sampler = streamed(path, step)
    stream.brakes_with(500.0, step)
    clock = PathClock()
    while clock.t < path.duration:
        stream.reached = clock.t
        fill(stream, sampler)
        assert stream.position(clock.t) == path.position(clock.t)
        clock.advance(step)
    assert stream.position(clock.t) == stream.position(1e9) == path.position(path.duration)
    assert sampler.over


def test_a_long_stream_stays_exact_and_keeps_a_bounded_number_of_spans():
    class Long:
        duration = 900.0

        def position(self, t: float) -> float:
            return t * 1.1

    stream, sampler = streamed(Long(), 0.01)
    stream.brakes_with(500.0, 0.01)
    clock, most = PathClock(), 0
    while clock.t < Long.duration:
        stream.reached = clock.t
        fill(stream, sampler)
        most = max(most, len(stream._curve.times))
        assert stream.position(clock.t) == Long().position(clock.t)
        before = max(clock.t - 0.05, 0.0)
        assert abs(stream.position(before) - before * 1.1) < 1e-9
        clock.advance(0.01)
    assert most < 300


def test_the_last_sample_lies_at_its_end():
    for duration in (0.0, 0.001, STEP, 0.01, 1.1):
        path = (
            SampledTrajectory([0.0, 1.0], duration) if duration else TrapezoidalTrajectory(1.0, 1.0, 1.0, 1.0)
        )
        stream, _ = streamed(path, first=5.0)
        assert stream.known_until == path.duration
        assert stream.position(duration) == 1.0
        assert stream.wanted(0.0) is None
    assert following(0.008, STEP, 0.01) == 0.01


# Properties in advance.


class Plain:
    """It has no properties in advance."""

    duration = 1.0

    def position(self, t: float) -> float:
        return t


@pytest.mark.parametrize(
    "path", [TrapezoidalTrajectory(0.0, 9.0, 5.0, 50.0), SampledTrajectory([0.0, 3.0, -1.0], 0.1), Plain()]
)
def test_a_stream_has_the_properties_of_its_trajectory(path):
    stream, _ = streamed(path)
    assert isinstance(stream, LookaheadTrajectory) is isinstance(path, LookaheadTrajectory)
    assert isinstance(stream, Ramped) is isinstance(path, Ramped)
    for fact in ("duration", "span", "top_speed", "top_acceleration"):
        assert getattr(stream, fact, None) == getattr(path, fact, None)


# Received and missing samples.


def test_missing_or_repeated_samples_are_refused_as_a_whole():
    stream, sampler = streamed(TrapezoidalTrajectory(0.0, 500.0, 50.0, 500.0))
    first, count = stream.wanted(0.0)
    chunk = sampler.take(count)
    for wrong in (first - 1, first + 1, 0):
        with pytest.raises(ArgumentError, match="not requested") as caught:
            stream.feed(wrong, chunk)
        assert f"numbers {wrong} to {wrong + count - 1}; expected were {first} to {first + count - 1}" in str(
            caught.value
        )
    for wrong in ((*chunk, 1.0), (*chunk[1:], math.nan), (*chunk[1:], "1")):
        with pytest.raises(ArgumentError):
            stream.feed(first, wrong)
    before = stream.known_until
    stream.feed(first, chunk[:10])  # in parts, as they come
    stream.feed(first + 10, chunk[10:])
    assert stream.known_until == pytest.approx(before + count * STEP)
    with pytest.raises(ArgumentError, match="not requested"):
        stream.feed(first + count, sampler.take(1))


def test_samples_that_are_not_known_are_not_invented():
    stream, sampler = streamed(TrapezoidalTrajectory(0.0, 500.0, 50.0, 500.0))
    with pytest.raises(CommandError, match="is not known"):
        stream.position(stream.known_until + 0.001)
    for cycle in range(1000):
        stream.reached = cycle * STEP
        fill(stream, sampler)
    with pytest.raises(CommandError, match="is not known"):
        stream.position(1.0)
    assert stream.position(stream.reached - 0.05) > 0.0


@pytest.mark.parametrize(
    "change",
    [
        {"duration": math.nan},
        {"step": 0.0},
        {"step": math.inf},
        {"positions": ()},
        {"positions": (0.0, math.inf)},
        {"positions": (0.0,) * 9},
        {"span": (0.0, math.nan), "top_speed": 1.0},
        {"top_acceleration": math.nan},
    ],
)
def test_a_head_that_makes_no_trajectory_is_refused(change):
    head = StreamHead(0.01, STEP, (0.0, 1.0))
    Streamed(head)
    with pytest.raises(ArgumentError):
        Streamed(replace(head, **change))


def test_an_incomplete_set_of_properties_in_the_head_is_ignored():
    head = StreamHead(0.01, STEP, (0.0, 1.0))
    assert isinstance(Streamed(replace(head, span=(0.0, 1.0), top_speed=5.0)), LookaheadTrajectory)
    assert not isinstance(Streamed(replace(head, span=(0.0, 1.0))), LookaheadTrajectory)
    assert not isinstance(Streamed(replace(head, top_speed=5.0)), LookaheadTrajectory)


# Requests.


def test_a_stream_is_filled_two_seconds_ahead_and_as_far_as_braking_takes():
    stream, sampler = streamed(TrapezoidalTrajectory(0.0, 5000.0, 50.0, 500.0))
    fill(stream, sampler)
    assert 2.0 <= stream.known_until <= 2.5
    stream.brakes_with(10.0, STEP)  # five seconds from 50
    fill(stream, sampler)
    assert 7.0 <= stream.known_until <= 7.5


@pytest.mark.parametrize(("step", "size"), [(0.0005, 256), (0.001, 250), (0.004, 62), (0.01, 25), (0.05, 16)])
def test_chunks_are_neither_tiny_nor_huge(step, size):
    stream, sampler = streamed(TrapezoidalTrajectory(0.0, 1000.0, 50.0, 500.0), step, 0.0)
    sizes = []
    for cycle in range(int(20.2 / step)):
        stream.reached = cycle * step
        while (asked := stream.wanted(stream.reached)) is not None:
            assert asked[0] == sampler.next
            sizes.append(asked[1])
            stream.feed(asked[0], sampler.take(asked[1]))
    assert set(sizes[:-1]) == {size}
    assert size / 2 <= sizes[-1] <= size * 1.5
    assert sampler.over


def test_after_a_failure_a_stream_requests_nothing():
    stream, _ = streamed(TrapezoidalTrajectory(0.0, 500.0, 50.0, 500.0))
    stream.fail(ArgumentError("no position"))
    assert stream.wanted(0.0) is None
