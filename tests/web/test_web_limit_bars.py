"""The limits of an axis as bars: their sources, the position of a value, and when it is near or beyond."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.machine.machine import Machine
from axisbus.motion.parameters import AxisParameters, Units
from axisbus.units import Scale
from axisbus.web.view import Bar, all_axes, bars_of, decimals_for, mark, number
from kit.cell import cell_file, cell_text

LIMITED = "rated_torque = 10.0\nmax_torque = 5.0\nposition_limits = [-90.0, 180.0]\nfollowing_error = 2.0"
SPEED = Bar("velocity", "Velocity", "deg/s", (-400.0, 400.0))
PLACE = Bar("position", "Position", "mm", (10.0, 110.0), slack=0.1)


def cell(folder: Path, axis: str) -> Path:
    return cell_file(folder, "x", axis=axis)


@pytest.fixture
def machine(tmp_path: Path) -> Iterator[Machine]:
    with Machine.simulated(cell(tmp_path, LIMITED)) as machine:
        yield machine


def bars(machine: Machine) -> dict[str, dict[str, object]]:
    found = all_axes(machine, machine["x"].snapshot.now)["x"]["bars"]
    json.dumps(found, allow_nan=False)
    return found


# Computed by hand: "near" begins at 80 % of the distance from the middle of a span to its end.
@pytest.mark.parametrize(
    ("bar", "value", "at", "zero", "kind"),
    [
        (SPEED, 0.0, 0.5, 0.5, ""),
        (SPEED, 320.0, 0.9, 0.5, ""),
        (SPEED, -320.1, 0.1, 0.5, "near"),
        (SPEED, 400.0, 1.0, 0.5, "near"),
        (SPEED, -400.1, 0.0, 0.5, "beyond"),
        (SPEED, 1e300, 1.0, 0.5, "beyond"),
        (PLACE, 60.0, 0.5, 0.0, ""),
        (PLACE, 20.0, 0.1, 0.0, ""),
        (PLACE, 19.9, 0.1, 0.0, "near"),
        (PLACE, 10.0, 0.0, 0.0, "near"),
        (PLACE, 9.95, 0.0, 0.0, "near"),
        (PLACE, 9.8, 0.0, 0.0, "beyond"),
        (PLACE, 110.2, 1.0, 0.0, "beyond"),
    ],
)
def test_a_value_has_its_position_on_the_bar_and_near_and_beyond_are_words(bar, value, at, zero, kind):
    seen = mark(bar, value)
    assert (seen.at, seen.zero) == (pytest.approx(at, abs=0.002), zero)
    assert seen.kind == kind
    assert seen.told == {"": "", "near": "near its limit", "beyond": "beyond its limit"}[kind]
    assert seen.text == f"{value:.3f}"


@given(
    value=st.floats(allow_nan=False, allow_infinity=False),
    low=st.floats(-1e9, 1e9),
    wide=st.floats(1e-3, 1e9),
)
def test_any_value_is_drawn_within_the_bar(value, low, wide):
    seen = mark(Bar("x", "X", "", (low, low + wide)), value)
    assert 0.0 <= seen.at <= 1.0
    assert low <= seen.now <= low + wide
    assert not math.isnan(seen.zero)


@pytest.mark.parametrize(
    ("increment", "text"),
    [(0.01, "0.250"), (1.0, "0.250"), (1 / 131072, "0.250298"), (1e-12, "0.250298"), (0.0, "0.250")],
)
def test_a_value_has_the_decimals_that_its_scale_needs(increment, text):
    assert number(0.250298, decimals_for(increment)) == text
    assert not number(-1e-9, decimals_for(increment)).startswith("-")


def test_an_unknown_value_has_no_position_on_its_bar():
    seen = mark(SPEED, None)
    assert (seen.text, seen.at, seen.now, seen.told) == ("unknown", None, None, "")


def test_without_a_limit_there_is_no_bar_and_nothing_is_made_up(tmp_path):
    with Machine.simulated(cell(tmp_path, "")) as machine:
        spans = {bar.name: bar.bounds for bar in bars_of(machine.session.axes["x"].parameters)}
        assert spans["position"] is spans["torque"] is None
        assert spans["velocity"] == (-400.0, 400.0)
        assert "position" not in bars(machine)


def test_the_limits_are_those_of_the_cell_file_in_its_units(machine):
    found = {bar.name: (bar.bounds, bar.unit) for bar in bars_of(machine.session.axes["x"].parameters)}
    assert found == {
        "position": ((-90.0, 180.0), "deg"),
        "velocity": ((-400.0, 400.0), "deg/s"),
        "torque": ((-5.0, 5.0), "N·m"),
        "following_error": ((-2.0, 2.0), "deg"),
    }


@pytest.mark.parametrize(
    ("increments", "scale", "limit"),
    [
        (1820, "131072/360", 5.0),
        (1, "100", 0.01),
        (200, "100", 2.0),
        (7, "1", 7.0),
        (1, "131072/360", 360 / 131072),
    ],
)
def test_a_limit_in_increments_is_reported_no_finer_than_they_report(increments, scale, limit):
    units = Units(*[Scale.of(scale, "deg")] * 3, ratio_known=True)
    parameters = AxisParameters("x", units, drive_following_error=increments)
    assert bars_of(parameters)[-1].bounds == pytest.approx((-limit, limit), rel=1e-9)


def test_limits_that_do_not_apply_at_present_are_marked_so(tmp_path):
    text = cell_text("x", axis=LIMITED).replace("required = false", "required = true")
    path = tmp_path / "cell.toml"
    path.write_text(text, encoding="utf-8")
    with Machine.simulated(path) as machine:
        before = bars(machine)
        assert before["position"]["told"] == "applies after homing"
        assert before["following_error"]["told"] == "applies while it follows position set-points"
        machine["x"].enable().wait()
        machine["x"].home().wait()
        assert (bars(machine)["position"]["kind"], bars(machine)["following_error"]["kind"]) == ("", "")
        machine["x"].move_velocity(30.0).wait()
        assert bars(machine)["following_error"]["kind"] == "loose"


def test_a_turning_axis_is_near_its_velocity_and_one_that_is_not_seen_is_unknown(machine):
    machine["x"].enable().wait()
    machine["x"].move_velocity(-390.0, acceleration=5000.0)
    machine.sleep(0.2)
    velocity = bars(machine)["velocity"]
    assert velocity["told"] == "near its limit"
    assert velocity["at"] == pytest.approx(10 / 800, abs=0.005)
    late = all_axes(machine, machine["x"].snapshot.now + 2.0)["x"]["bars"]
    assert {name: (each["text"], each["at"]) for name, each in late.items()} == dict.fromkeys(
        late, ("unknown", None)
    )
