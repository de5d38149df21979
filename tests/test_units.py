"""Scales, wrap-around and modulo."""

import math
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.errors import ArgumentError
from axisbus.units import Scale, modulo_target, unwrap, wrap


def test_scale_from_a_ratio_is_exact():
    scale = Scale.of("131072/360", "deg")
    assert scale.exact == Fraction(131072, 360)
    assert scale.to_increments(360) == 131072
    assert scale.to_units(65536) == pytest.approx(180)


@pytest.mark.parametrize("wrong", [0, "x", "1/0", float("nan"), float("inf")])
def test_an_invalid_scale_is_refused(wrong):
    with pytest.raises(ArgumentError):
        Scale.of(wrong, "deg")


@pytest.mark.parametrize("wrong", [math.nan, math.inf, -math.inf])
def test_a_value_that_is_not_finite_has_no_increments(wrong):
    with pytest.raises(ArgumentError):
        Scale.of(100, "mm").to_increments(wrong)


@given(st.integers(-(1 << 40), 1 << 40), st.integers(-(1 << 31) + 1, (1 << 31) - 1))
def test_unwrapping_follows_any_step_below_half_the_range(start, step):
    assert unwrap(start, wrap(start + step)) == start + step


@pytest.mark.parametrize(
    ("value", "raw"), [(0x7FFFFFFF, 0x7FFFFFFF), (0x80000000, -0x80000000), (-0x80000001, 0x7FFFFFFF)]
)
def test_wrap_is_two_s_complement(value, raw):
    assert wrap(value) == raw


@pytest.mark.parametrize(
    ("here", "target", "direction", "expected"),
    [
        (350, 10, 0, 370),
        (10, 350, 0, -10),
        (350, 10, -1, 10),
        (10, 350, 1, 350),
        (10, 10, 1, 10),
        (720, 90, 0, 810),
    ],
)
def test_modulo_uses_the_requested_direction(here, target, direction, expected):
    assert modulo_target(here, target, 360, direction) == pytest.approx(expected)
