"""The manual's procedure for a gain: the order of its trials, on machines whose limit only the test knows."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.drives.gim6010.tuning import MOST_TRIALS, GainSearch, Loop
from axisbus.errors import ArgumentError
from axisbus.step_response import Response

SMOOTH = Response(0.0, 0.1, 0.01, 0.0, 100)
OVER = Response(0.2, 0.3, 0.02, 0.0, 100)
WILD = Response(0.4, None, 0.5, 0.0, 100)


def played(loop, first, most, limit):
    """Search on a machine that is smooth up to ``limit``; return the search and the gains that were tried."""
    search, tried = GainSearch(loop, first, most), []
    while search.next is not None:
        tried.append(search.next)
        bad = OVER if loop is Loop.POSITION else WILD
        search.take(bad if search.next > limit else SMOOTH)
    return search, tried


def test_a_velocity_gain_is_raised_until_it_oscillates_and_halved_once():
    search, tried = played(Loop.VELOCITY, 0.1, 1.0, 0.2)
    assert tried == pytest.approx([0.1, 0.13, 0.169, 0.2197, 0.10985])
    assert search.best == pytest.approx(0.10985)
    assert "lowered from a gain with which it was not" in search.ends


def test_a_position_gain_is_lowered_little_by_little():
    search, tried = played(Loop.POSITION, 20.0, 100.0, 25.0)
    assert tried == pytest.approx([20.0, 26.0, 22.1])
    assert search.best == pytest.approx(22.1)


def test_a_gain_too_high_at_the_start_is_lowered_first_and_then_raised_as_in_the_manual():
    search, tried = played(Loop.VELOCITY, 1.0, 1.0, 0.3)
    assert tried == pytest.approx([1.0, 0.5, 0.25, 0.325, 0.1625])
    assert search.best == pytest.approx(0.1625)


def test_no_gain_above_the_maximum_is_tried():
    search, tried = played(Loop.POSITION, 20.0, 30.0, 1000.0)
    assert tried == [20.0, 26.0]
    assert "may not be raised beyond 30" in search.ends


def test_a_machine_on_which_nothing_is_smooth_is_given_up():
    search, tried = played(Loop.POSITION, 20.0, 30.0, 0.0)
    assert len(tried) == MOST_TRIALS
    assert search.best is None
    assert "given up" in search.ends


@pytest.mark.parametrize(
    ("first", "most"), [(0.0, 1.0), (-1.0, 1.0), (2.0, 1.0), (1.0, float("inf")), (float("nan"), 1.0)]
)
def test_invalid_bounds_are_refused(first, most):
    with pytest.raises(ArgumentError, match="are not a range"):
        GainSearch(Loop.POSITION, first, most)


@given(
    st.sampled_from(Loop),
    st.floats(1e-3, 1e3),
    st.floats(1.0, 50.0),
    st.floats(1e-4, 1e5),
)
def test_for_any_machine_the_search_ends_within_the_bounds_with_a_smooth_gain_or_without_a_gain(
    loop, first, room, limit
):
    search, tried = played(loop, first, first * room, limit)
    assert len(tried) <= MOST_TRIALS
    assert max(tried) <= first * room * (1 + 1e-12)
    assert search.best is None or search.best <= limit
    assert search.best in (None, tried[-1])
