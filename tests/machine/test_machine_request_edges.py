"""Every argument of a command at the edges of its range: the resulting increments, or the refusal."""

from __future__ import annotations

import math
import sys
from dataclasses import replace
from types import SimpleNamespace

import pytest

from axisbus.errors import ArgumentError, LimitError
from axisbus.machine.request import AxisCall
from axisbus.motion.parameters import AxisLimits, Defaults, HomingParameters
from axisbus.motion.trajectory import SampledTrajectory, TrapezoidalTrajectory
from kit.motion.rig import GENERIC, dictionary_of, parameters


def request(**changes) -> AxisCall:
    """A call to an axis of 1000 increments per degree and 10 N·m."""
    return AxisCall(parameters("x", dictionary_of(GENERIC), **changes), "call()")


def outcome(ask, **changes):
    """Return the result; of a refusal the name of the error and its message."""
    try:
        return ask(request(**changes))
    except (ArgumentError, LimitError) as error:
        return type(error).__name__, error.message.removeprefix("x.call(): ")


BOUNDS = {"limits": AxisLimits(position=(-10.0, 20.0), velocity=400.0, acceleration=800.0, torque=5.0)}
REFUSED = "LimitError"


@pytest.mark.parametrize(
    ("changes", "position", "expected"),
    [
        ({}, 1.5, 1500),
        ({}, -2_147_483.648, -(2**31)),
        ({}, -2_147_483.649, REFUSED),
        ({}, 2_147_483.647, 2**31 - 1),
        ({}, 2_147_483.648, REFUSED),
        ({}, 1e300, REFUSED),
        (BOUNDS, 20.0, 20_000),
        (BOUNDS, 20.0001, REFUSED),
        (BOUNDS, -10.0, -10_000),
        (BOUNDS, -10.0001, REFUSED),
        # the nearest increment would lie beyond the limit
        ({"limits": AxisLimits(position=(-0.0016, 0.0016))}, 0.0016, 1),
        ({"limits": AxisLimits(position=(-0.0016, 0.0016))}, -0.0016, -1),
        ({}, 0.0016, 2),
    ],
)
def test_a_target_is_an_increment_within_the_limits_and_the_object(changes, position, expected):
    found = outcome(lambda r: r.target(position), **changes)
    assert (found[0] if isinstance(found, tuple) else found) == expected


@pytest.mark.parametrize("method", ["checked_position", "distance"])
@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (1.5, 1500),
        (-0.0006, -1),
        (2_147_483.647, 2**31 - 1),
        (2_147_483.648, REFUSED),
        (1e300, REFUSED),
        (math.nan, "ArgumentError"),
    ],
)
def test_a_distance_and_a_position_are_limited_to_the_range_of_the_object(method, value, expected):
    found = outcome(lambda r: getattr(r, method)(value))
    assert (found[0] if isinstance(found, tuple) else found) == expected


@pytest.mark.parametrize(
    ("changes", "torque", "expected"),
    [
        ({}, 2.5, 250),
        ({}, -2.5, -250),
        ({}, 0.0199, 1),
        ({}, -0.0199, -1),
        ({}, 327.67, 32767),
        ({}, 327.68, REFUSED),
        ({}, 1e300, REFUSED),
        (BOUNDS, 5.0, 500),
        (BOUNDS, -5.0, -500),
        (BOUNDS, 5.001, REFUSED),
        (BOUNDS, -5.001, REFUSED),
        ({}, True, "ArgumentError"),
    ],
)
def test_a_torque_exceeds_neither_the_requested_nor_the_permitted_one(changes, torque, expected):
    found = outcome(lambda r: r.torque(torque), **changes)
    assert (found[0] if isinstance(found, tuple) else found) == expected


def test_a_torque_limit_is_reported_by_its_own_name():
    with pytest.raises(LimitError) as caught:
        request(limits=AxisLimits(torque=5.0, torque_key="6072h")).torque(6.0)
    assert caught.value.message == "x.call(): torque 6 N·m is beyond the limit"
    assert caught.value.observed == "6072h is 5 N·m"
    base = parameters("x", dictionary_of(GENERIC))
    without = AxisCall(replace(base, units=replace(base.units, rated_torque=None)), "call()")
    with pytest.raises(ArgumentError, match="rated_torque is missing") as caught:
        without.torque(1.0)
    assert caught.value.observed == "[axes.x] in cell.toml does not give it"


@pytest.mark.parametrize(
    ("defaults", "slope", "expected"),
    [
        (None, None, None),
        (None, 5.0, 500),
        (2.0, None, 200),
        (2.0, 5.0, 500),
        (None, 0.0, "ArgumentError"),
        (None, -1.0, "ArgumentError"),
        (None, 1e300, REFUSED),
        (None, 42_949_672.95, 2**32 - 1),
        (None, 42_949_672.96, REFUSED),
    ],
)
def test_a_torque_slope_is_a_magnitude(defaults, slope, expected):
    found = outcome(lambda r: r.torque_slope(slope), defaults=Defaults(torque_slope=defaults))
    assert (found[0] if isinstance(found, tuple) else found) == expected


@pytest.mark.parametrize(
    ("configured", "asked", "expected"),
    [
        (37, None, 37),
        (37, 17, 17),
        (None, -128, -128),
        (None, 127, 127),
        (None, 128, REFUSED),
        (None, 1.5, "ArgumentError"),
        (None, None, "ArgumentError"),
        (None, 3.0, 3),
    ],
)
def test_a_homing_method_is_a_whole_number_of_one_byte(configured, asked, expected):
    found = outcome(lambda r: r.homing_method(asked), homing=HomingParameters(method=configured))
    assert (found[0] if isinstance(found, tuple) else found) == expected


def test_homing_speeds_are_required_if_the_method_needs_them():
    r = request()
    assert [r.homing_speed("speed_zero", value, False) for value in (None, 2.5)] == [None, 2500]
    assert [r.homing_acceleration(value) for value in (None, 2.5)] == [None, 2500]
    with pytest.raises(ArgumentError, match="speed_zero is missing") as caught:
        r.homing_speed("speed_zero", None, True)
    assert "[axes.x.homing]" in caught.value.observed
    with pytest.raises(LimitError, match="6099h"):
        r.homing_speed("speed_zero", 0.0001, True)
    with pytest.raises(LimitError, match="609Ah"):
        r.homing_acceleration(0.0001)


@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, True, "5", None])
def test_a_magnitude_is_a_finite_number_above_0(value):
    r = request(defaults=Defaults())
    for ask in (lambda: r.profile(value, 1.0), lambda: r.profile(1.0, value), lambda: r.positive("w", value)):
        with pytest.raises(ArgumentError):
            ask()
    assert r.timeout(None) is None
    assert r.timeout(0.5) == 0.5
    if value is not None:
        for ask in (
            lambda: r.timeout(value),
            lambda: r.profile(1.0, 1.0, value),
            lambda: r.profile(1.0, 1.0, 1.0, value),
        ):
            with pytest.raises(ArgumentError):
                ask()


@pytest.mark.parametrize(
    ("arguments", "expected"),
    [
        # velocity, up, down; speed, the weaker ramp; time-out; ramps
        ((2.0,), (2000, 500_000, 500_000, 2000.0, 500_000.0, None, 500_000.0, 500_000.0)),
        ((2.0, 10.0), (2000, 10_000, 10_000, 2000.0, 10_000.0, None, 10_000.0, 10_000.0)),
        ((2.0, 10.0, 5.0), (2000, 10_000, 5000, 2000.0, 5000.0, None, 10_000.0, 5000.0)),
        ((2.0, 5.0, 10.0, 7.0), (2000, 5000, 10_000, 2000.0, 5000.0, 7.0, 5000.0, 10_000.0)),
        ((None, None, 5.0), (100_000, 500_000, 5000, 100_000.0, 5000.0, None, 500_000.0, 5000.0)),
    ],
)
def test_values_missing_in_a_profile_are_the_defaults(arguments, expected):
    expected = (*expected, None, None)  # and no jerk
    assert tuple(request().profile(*arguments)) == expected
    if arguments[0] is not None:
        assert tuple(request().turning(*arguments)) == expected
        assert tuple(request().turning(-arguments[0], *arguments[1:])) == (-expected[0], *expected[1:])


def test_a_default_deceleration_takes_precedence_over_the_acceleration():
    defaults = Defaults(velocity=1.0, acceleration=2.0, deceleration=3.0)
    assert request(defaults=defaults).profile(None)[:3] == (1000, 2000, 3000)
    assert request(defaults=defaults).profile(None, 9.0)[:3] == (1000, 9000, 3000)
    assert request(defaults=defaults).profile(None, 9.0, 4.0)[:3] == (1000, 9000, 4000)
    with pytest.raises(ArgumentError, match="velocity is missing") as caught:
        request(defaults=Defaults()).profile(None)
    assert (
        caught.value.observed
        == "the call does not give it, and [axes.x.defaults] in cell.toml does not either"
    )
    with pytest.raises(ArgumentError, match="acceleration is missing"):
        request(defaults=Defaults()).profile(1.0)


def test_with_an_unknown_ratio_of_the_units_no_speed_is_compared():
    base = parameters("x", dictionary_of(GENERIC))
    unknown = AxisCall(replace(base, units=replace(base.units, ratio_known=False)), "call()")
    assert tuple(unknown.profile(2.0, 10.0, timeout=3.0)) == (
        2000,
        10_000,
        10_000,
        None,
        None,
        3.0,
        None,
        None,
        None,
        None,
    )


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (lambda r: r.profile(400.0, 800.0, 800.0), None),
        (lambda r: r.profile(400.001), "velocity 400.001 deg/s is beyond the limit"),
        (lambda r: r.turning(-400.0, 800.0), None),
        (lambda r: r.turning(-400.001), "velocity -400.001 deg/s is beyond the limit"),
        (lambda r: r.profile(1.0, 800.001), "acceleration 800.001 deg/s² is beyond the limit"),
        (lambda r: r.profile(1.0, 1.0, 800.001), "acceleration 800.001 deg/s² is beyond the limit"),
        (lambda r: r.turning(0.0), None),
    ],
)
def test_the_limits_of_velocity_and_acceleration_apply_in_both_directions(ask, message):
    found = outcome(ask, **BOUNDS)
    assert (found[1] if isinstance(found[1], str) else None) == message


def test_a_value_beyond_a_limit_only_by_rounding_is_the_limit():
    above = 1.0 + 4 * sys.float_info.epsilon
    assert outcome(lambda r: r.profile(400.0 * above, 800.0 * above), **BOUNDS) == outcome(
        lambda r: r.profile(400.0, 800.0), **BOUNDS
    )
    assert outcome(lambda r: r.turning(-400.0 * above, 800.0), **BOUNDS) == outcome(
        lambda r: r.turning(-400.0, 800.0), **BOUNDS
    )
    assert outcome(lambda r: r.torque(-5.0 * above), **BOUNDS) == outcome(lambda r: r.torque(-5.0), **BOUNDS)
    assert outcome(lambda r: r.acceleration(800.0 * above), **BOUNDS) == outcome(
        lambda r: r.acceleration(800.0), **BOUNDS
    )


@pytest.mark.parametrize(
    ("velocity", "fits"),
    [(2_147_483.647, True), (2_147_483.649, False), (-2_147_483.648, True), (1e300, False)],
)
def test_a_signed_velocity_fits_its_object(velocity, fits):
    found = outcome(lambda r: r.turning(velocity), limits=AxisLimits())
    assert (found[0] != REFUSED) is fits


@pytest.mark.parametrize(("velocity", "fits"), [(4_294_967.295, True), (4_294_967.297, False)])
def test_a_profile_velocity_fits_its_object(velocity, fits):
    found = outcome(lambda r: r.profile(velocity), limits=AxisLimits())
    assert (found[0] != REFUSED) is fits


def jumping(**told) -> SimpleNamespace:
    """A trajectory whose only properties in advance are given here."""
    return SimpleNamespace(duration=1.0, position=lambda _: 0.0, **told)


NO_LIMIT = {"limits": AxisLimits()}
NOTHING = {"limits": AxisLimits(), "defaults": Defaults()}


@pytest.mark.parametrize(
    ("trajectory", "changes", "message"),
    [
        (TrapezoidalTrajectory(0.0, 20.0, 400.0, 800.0), BOUNDS, None),
        (TrapezoidalTrajectory(0.0, 20.001, 10.0, 800.0), BOUNDS, None),  # an increment of arithmetic
        (
            TrapezoidalTrajectory(0.0, 20.002, 10.0, 800.0),
            BOUNDS,
            "the trajectory leaves the position limits",
        ),
        (
            TrapezoidalTrajectory(0.0, -10.002, 10.0, 800.0),
            BOUNDS,
            "the trajectory leaves the position limits",
        ),
        (TrapezoidalTrajectory(30.0, 0.0, 10.0, 800.0), BOUNDS, None),  # back from outside
        (TrapezoidalTrajectory(30.0, 31.0, 10.0, 800.0), BOUNDS, "the trajectory leaves the position limits"),
        (
            TrapezoidalTrajectory(0.0, 9.0, 10.0, 800.01),
            BOUNDS,
            "acceleration 800.01 deg/s² is beyond the limit",
        ),
        (
            TrapezoidalTrajectory(0.0, 900.0, 400.1, 800.0),
            {"limits": AxisLimits(velocity=400.0)},
            "velocity 400.1 deg/s is beyond the limit",
        ),
        (TrapezoidalTrajectory(0.0, 900.0, 400.0000001, 800.0), {"limits": AxisLimits(velocity=400.0)}, None),
        (TrapezoidalTrajectory(0.0, 900.0, 900.0, 900.0), NO_LIMIT, None),
        (TrapezoidalTrajectory(0.0, 900.0, 900.0, 900.0), NOTHING, None),
        (SampledTrajectory([0.0, 1.0], 0.01), NO_LIMIT, None),
        (SampledTrajectory([0.0, 1.0], 0.01), NOTHING, "max_velocity is missing"),
        (jumping(), BOUNDS, None),
        (
            jumping(),
            {"limits": AxisLimits(position=(0.0, 1.0), velocity=1.0), "defaults": Defaults()},
            "acceleration is missing",
        ),
        (jumping(), {"limits": AxisLimits(velocity=1.0), "defaults": Defaults()}, None),
        (
            SimpleNamespace(duration=math.inf, position=lambda _: 0.0),
            BOUNDS,
            "the trajectory's duration inf is not a finite number",
        ),
    ],
)
def test_a_trajectory_is_checked_against_the_limits_before_it_starts(trajectory, changes, message):
    found = outcome(lambda r: r.trajectory(trajectory), **changes)
    assert (None if found is None else found[1]) == message
