"""The mapping of pulses, the figures of a pulse and a brake resistor, and refused values, by the manual (4.4, 4.5, 3.1)."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.drives.gim6010.settings.parameter_settings import brake_resistor, endstops
from axisbus.drives.gim6010.settings.pulse_inputs import FOLLOWS, PulseMapping, Pulses
from axisbus.errors import ArgumentError, LimitError

NUMBERS = st.floats(-1000, 1000)


def test_the_manuals_example_of_a_mapping():
    mapping = PulseMapping(FOLLOWS["velocity"], -8.0, 8.0)
    assert [mapping.at(width) for width in (1.0, 1.25, 1.5, 2.0)] == [-8.0, -4.0, 0.0, 8.0]
    assert mapping.zero == 1.5
    assert list(mapping.table)[1] == "1.25 ms: -4 turns/s of the rotor, -0.5 turns/s of the output"
    assert (
        "odrv0.config.gpio1_pwm_mapping.endpoint = odrv0.axis0.controller._input_vel_property"
        in mapping.steps
    )
    assert "odrv0.config.gpio1_pwm_mapping.min = -8.0" in mapping.steps


@pytest.mark.parametrize(
    ("follows", "modes"), [("position", (3, 5)), ("velocity", (2, 2)), ("torque", (1, 6))]
)
def test_each_value_that_follows_has_the_manuals_modes(follows, modes):
    steps = PulseMapping(FOLLOWS[follows], 0.0, 1.0).steps
    assert steps[1:3] == (
        f"odrv0.axis0.controller.config.control_mode = {modes[0]}",
        f"odrv0.axis0.controller.config.input_mode = {modes[1]}",
    )
    assert "comm_intf_mux = 3" in steps[-2]  # last, before it is saved


@given(NUMBERS, NUMBERS, st.floats(1.0, 2.0))
def test_a_mapping_stays_between_its_ends_and_is_zero_at_its_stated_width(low, high, width):
    if low == high:
        return
    mapping = PulseMapping(FOLLOWS["torque"], low, high)
    assert min(low, high) - 1e-9 <= mapping.at(width) <= max(low, high) + 1e-9
    if mapping.zero is not None:
        assert mapping.at(mapping.zero) == pytest.approx(0.0, abs=1e-9 * (abs(low) + abs(high)))
    else:
        assert low * high > 0
        assert any("never means standstill" in note for note in mapping.notes)


@pytest.mark.parametrize("ends", [(1.0, 1.0), (math.nan, 1.0), (0.0, math.inf)])
def test_an_invalid_mapping_is_refused(ends):
    with pytest.raises(ArgumentError):
        PulseMapping(FOLLOWS["position"], *ends)


@pytest.mark.parametrize("width", [0.99, 2.01, math.nan])
def test_a_width_that_the_manual_does_not_map_is_refused(width):
    with pytest.raises(LimitError):
        PulseMapping(FOLLOWS["position"], 0.0, 1.0).at(width)


def test_the_manuals_example_of_pulses():
    pulses = Pulses(1024, 128, circular=True)
    assert pulses.in_all == 128 * 1024
    assert pulses.table == (
        "a pulse: 0.351562° of the rotor, 0.0439453° of the output",
        "a turn of the output: 8192 pulses",
        "50000 pulses/s: 48.8281 turns/s of the rotor, 6.10352 turns/s of the output",
    )
    assert "odrv0.axis0.controller.config.steps_per_circular_range = 131072" in pulses.steps
    assert "odrv0.axis0.controller.config.circular_setpoints = True" in pulses.steps
    assert not any("is not at its start position" in note for note in pulses.notes)
    assert any("is not at its start position" in note for note in Pulses(1024, 12, circular=True).notes)


@pytest.mark.parametrize("given_", [(0, 1), (1, 0), (-5, 3), (1 << 20, 1 << 12)])
def test_invalid_pulses_are_refused(given_):
    with pytest.raises(ArgumentError):
        Pulses(*given_, circular=False)


def test_a_brake_resistor_is_switched_on_last_and_its_power_is_reported():
    wanted = brake_resistor(2.0, 0.0, (26.0, 28.0))
    assert [path.removeprefix("config.") for path, _ in wanted.values] == [
        "brake_resistance",
        "max_regen_current",
        "dc_bus_overvoltage_ramp_start",
        "dc_bus_overvoltage_ramp_end",
        "enable_dc_bus_overvoltage_ramp",
        "enable_brake_resistor",
    ]
    assert wanted.notes == ("at 28 V it takes 14 A and 392 W: make sure that it can dissipate this",)


@pytest.mark.parametrize(
    "given_",
    [
        (2.0, None, None),
        (0.0, 1.0, None),
        (math.nan, 1.0, None),
        (2.0, -1.0, None),
        (2.0, None, (28.0, 28.0)),
        (2.0, None, (28.0, 26.0)),
        (2.0, None, (0.0, 26.0)),
        (2.0, None, (26.0, math.inf)),
        (2.0, None, (26.0, math.nan)),
    ],
)
def test_an_invalid_brake_resistor_is_refused(given_):
    with pytest.raises(ArgumentError):
        brake_resistor(*given_)


def test_a_switch_gets_its_pin_before_it_is_switched_on():
    assert endstops(True, False).values == (
        ("axis0.min_endstop.config.gpio_num", 1),
        ("axis0.min_endstop.config.enabled", True),
        ("axis0.max_endstop.config.enabled", False),
    )
    assert endstops(None, True).values[0] == ("axis0.max_endstop.config.gpio_num", 2)
    with pytest.raises(ArgumentError, match="no switch"):
        endstops(None, None)
