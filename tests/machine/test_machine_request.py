"""From units to increments: the sent values never exceed the requested or allowed velocity, acceleration, torque or distance."""

from __future__ import annotations

from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.errors import LimitError
from axisbus.machine.request import AxisCall
from axisbus.motion.parameters import AxisLimits, AxisParameters, Defaults, Units
from axisbus.units import Scale

DEGREES = Scale.of("131072/360", "deg")
RPM = Scale.of(Fraction(1, 6), "deg/s")  # one increment is 6 deg/s
COARSE = Scale.of(Fraction(1, 50), "deg/s²")


def request(velocity=RPM, acceleration=COARSE, limit=None) -> AxisCall:
    """A call to an axis whose drive counts in coarse units."""
    units = Units(DEGREES, velocity, acceleration, ratio_known=True, rated_torque=3.0)
    parameters = AxisParameters(
        "x",
        units,
        limits=AxisLimits(velocity=limit),
        defaults=Defaults(acceleration=100.0),
        scan_period=0.004,
    )
    return AxisCall(parameters, "move")


def test_a_velocity_below_one_increment_is_refused_and_not_raised_to_one():
    with pytest.raises(LimitError, match="less than one increment of the drive") as caught:
        request(limit=2.0).profile(1.0)
    assert "6 deg/s" in caught.value.observed
    with pytest.raises(LimitError, match="6083h"):
        request().profile(12.0, 49.0)
    with pytest.raises(LimitError, match="6084h"):
        request().profile(12.0, 50.0, 49.0)


def test_a_velocity_between_two_increments_is_sent_as_the_lower_one():
    r = request(limit=17.0)
    assert r.profile(17.0).velocity == 2
    assert r.turning(17.0).velocity == 2
    assert r.turning(-17.0).velocity == -2
    assert r.homing_speed("speed_switch", 17.0, needed=True) == 2


def test_whole_increments_stay_whole_after_scaling():
    third = Scale.of("131072/360", "deg/s")
    for whole in (1, 7, 131072, 40_000_001):
        assert request(velocity=third).profile(whole * 360 / 131072, 100.0).velocity == whole


@given(
    st.floats(0.001, 5000.0), st.fractions(Fraction(1, 1000), 5000), st.floats(0.01, 9000.0), st.booleans()
)
def test_no_profile_exceeds_the_requested_velocity_or_acceleration(velocity, factor, acceleration, turned):
    scale = Scale.of(-factor if turned else factor, "deg/s")
    r = request(velocity=scale, acceleration=Scale.of(factor, "deg/s²"))
    try:
        profile = r.profile(velocity, acceleration)
    except LimitError:
        assert min(velocity, acceleration) * factor < 1.0
        return
    assert profile.velocity / float(factor) <= velocity * (1 + 1e-9)
    assert profile.acceleration / float(factor) <= acceleration * (1 + 1e-9)
    assert profile.down is not None
    assert profile.down / DEGREES.factor <= acceleration * (1 + 1e-9)
    assert abs(r.turning(-velocity, acceleration).velocity / float(factor)) <= velocity * (1 + 1e-9)


@given(st.floats(-9.0, 9.0))
def test_no_torque_exceeds_the_requested_one(torque):
    assert abs(request().torque(torque)) * 3.0 / 1000 <= abs(torque) * (1 + 1e-9)


@pytest.mark.parametrize("turned", [1, -1])
@pytest.mark.parametrize("edge", [90.0, -90.0, 17.3, 0.0])
def test_a_target_at_a_limit_is_rounded_to_the_increment_within(edge, turned):
    scale = Scale.of(Fraction(turned * 1003, 300), "deg")
    for low, high in ((edge, edge + 50.0), (edge - 50.0, edge)):
        raw = _limited(scale, (low, high)).target(edge)
        assert low - 1e-9 <= scale.to_units(raw) <= high + 1e-9
        assert abs(scale.to_units(raw) - edge) <= 300 / 1003


def _limited(scale: Scale, limits: tuple[float, float]) -> AxisCall:
    units = Units(scale, RPM, COARSE, ratio_known=True)
    return AxisCall(AxisParameters("x", units, limits=AxisLimits(position=limits)), "move")
