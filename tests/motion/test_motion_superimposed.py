"""A distance on ramps, as a function: its end is met, and no rate or ramp exceeds the given values."""

from __future__ import annotations

from itertools import pairwise

from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.motion.commands import MoveSuperimposed
from axisbus.motion.superimposed import Addition, Shift

SAME = settings(deadline=None, derandomize=True, max_examples=60)
PERIOD = 0.01
ENDS = st.floats(-50.0, 50.0)
FAST, HARD = st.floats(5.0, 200.0), st.floats(20.0, 2000.0)


def gone(shift: Shift, most: int = 20000) -> int:
    """Go on to rest; return the cycles that it took."""
    for number in range(most):
        if shift.at_rest:
            return number
        shift.go(shift.wanted())
    raise AssertionError("it does not come to rest")


@SAME
@given(ENDS, FAST, HARD, HARD)
def test_an_end_is_reached_from_standstill_and_never_exceeded(end, velocity, up, down):
    shift, rates, places = Shift(PERIOD), [0.0], []
    shift.aim(end, velocity, up, down)
    while not shift.at_rest:
        shift.go(shift.wanted())
        rates.append(shift.rate)
        places.append(shift.value)
        assert len(rates) < 20000
    assert shift.value == end
    assert max(map(abs, rates)) <= velocity * (1.0 + 1e-9)
    assert all(abs(place) <= abs(end) * (1.0 + 1e-9) for place in places)
    for before, after in pairwise(rates):
        ramp = up if abs(after) > abs(before) else down
        assert abs(after - before) <= ramp * PERIOD * (1.0 + 1e-9) + 1e-9


@SAME
@given(ENDS, ENDS, st.integers(0, 60), FAST, HARD)
def test_a_new_end_of_the_shift_is_reached_from_any_rate(first, second, cycles, velocity, ramp):
    shift = Shift(PERIOD)
    shift.aim(first, velocity, ramp, ramp)
    for _ in range(cycles):
        shift.go(shift.wanted())
    before = shift.rate
    shift.aim(second, velocity, ramp, ramp)
    assert abs(shift.wanted() - before) <= ramp * PERIOD * (1.0 + 1e-9)
    gone(shift)
    assert shift.value == second


@SAME
@given(ENDS, HARD, st.lists(st.floats(-1.0, 1.0), min_size=20, max_size=400))
def test_a_sum_never_exceeds_the_limits_beside_a_path_within_them(distance, ramp, changes):
    """The path changes its speed at will, as hard and as fast as the axis itself may be."""
    fastest, hardest = 100.0, 1000.0
    addition = Addition(MoveSuperimposed(distance, fastest, ramp, ramp), PERIOD)
    below = total = 0.0
    for change in changes:
        below = min(max(below + change * hardest * PERIOD, -fastest), fastest)
        low, high = max(-fastest, total - hardest * PERIOD), min(fastest, total + hardest * PERIOD)
        now = below + addition.step(below, low, high)
        assert abs(now) <= fastest + 1e-6
        assert abs(now - total) <= hardest * PERIOD + 1e-6
        total = now
    for _ in range(20000):  # the path continues at standstill
        below -= min(max(below, -0.9 * hardest * PERIOD), 0.9 * hardest * PERIOD)
        low, high = max(-fastest, total - hardest * PERIOD), min(fastest, total + hardest * PERIOD)
        total = below + addition.step(below, low, high)
        if addition.over:
            break
    assert addition.value == distance
