"""A virtual axis in a cell file: its keys are read, and keys of a node or drive are refused with their line."""

from __future__ import annotations

import tomllib
from fractions import Fraction

import jsonschema
import pytest

from axisbus.cell import reader, virtual_keys
from axisbus.cell.json_schema import schema_of_cells
from axisbus.cell.model import AxisConfig
from axisbus.cell.parameters import homing_required
from axisbus.cell.virtual import all_virtual, virtual_parameters
from axisbus.check.run import check
from axisbus.eds.model import Severity
from kit.cells.mistakes import MINIMAL

VIRTUAL = """\
[axes.v]
virtual = true
unit = "mm"
[axes.v.defaults]
acceleration = 100.0
"""
WHOLE = """\
[axes.v]
virtual = true
unit = "deg"
scale = "131072/360"
position_limits = [-10.0, 400.0]
max_velocity = 500.0
max_acceleration = 3000.0
[axes.v.defaults]
velocity = 100.0
acceleration = 1000.0
deceleration = 800.0
[axes.v.stop]
deceleration = 2500.0
halt_time = "3s"
quick_stop_time = "4s"
disable_time = "5s"
"""
VALIDATOR = jsonschema.Draft7Validator(schema_of_cells())
BUS = '[bus]\ninterface = "sim"\nscan_period = "4ms"\n'


def read(text: str) -> tuple[AxisConfig, list[tuple[int, str, str]]]:
    cell, problems = reader.loads(text)
    assert cell is not None, problems
    wrong = [each for each in problems if each.severity is Severity.ERROR]
    return cell.axes["v"], [(each.line, each.message, each.remedy) for each in wrong]


def refused_by_schema(text: str) -> bool:
    return not VALIDATOR.is_valid(tomllib.loads(text))


def test_all_keys_of_a_virtual_axis_are_read() -> None:
    cell, problems = reader.loads(MINIMAL + WHOLE)
    assert problems == []
    axis = cell.axes["v"]
    assert (axis.virtual, axis.node, axis.unit, axis.scale) == (True, 0, "deg", Fraction(131072, 360))
    known = virtual_parameters(cell, "v")
    assert (known.virtual, known.limits.position, known.limits.velocity) == (True, (-10.0, 400.0), 500.0)
    assert known.limits.acceleration == 3000.0
    assert (known.defaults.velocity, known.defaults.deceleration) == (100.0, 800.0)
    assert (known.stop_times.halt, known.stop_times.quick_stop, known.stop_times.disable) == (3.0, 4.0, 5.0)
    assert known.braking.quick == pytest.approx(2500.0 * 131072 / 360)
    assert known.units.ratio_known
    assert list(all_virtual(cell)) == ["v"]
    assert list(cell.driven) == ["x"]
    assert list(cell.axes_of(1)) == [cell.axes["x"]]
    assert not refused_by_schema(MINIMAL + WHOLE)


# Keys that a drive's axis may have and a virtual one cannot: line and message.
FOREIGN = [
    ("node = 1", "node"),
    ("drive_axis = 1", "drive_axis"),
    ("velocity_scale = 10.0", "velocity_scale"),
    ("acceleration_scale = 10.0", "acceleration_scale"),
    ('invert = "master"', "invert"),
    ("rated_torque = 5.0", "rated_torque"),
    ("max_torque = 5.0", "max_torque"),
    ("limits_in_drive = false", "limits_in_drive"),
    ("position_window = 1.0", "position_window"),
    ("standstill_velocity = 1.0", "standstill_velocity"),
    ("standstill_window = 1.0", "standstill_window"),
    ("following_error = 1.0", "following_error"),
    ('demand = "use"', "demand"),
    ('modes = ["pp"]', "modes"),
    ('ignored_objects = ["605Dh"]', "ignored_objects"),
    ("holds_load = false", "holds_load"),
    ('transition_time = "1s"', "transition_time"),
    ('mode_time = "1s"', "mode_time"),
    ('acknowledge_time = "1s"', "acknowledge_time"),
    ('handshake = "acknowledge"', "handshake"),
    ("homing_reached = false", "homing_reached"),
]


@pytest.mark.parametrize(("line", "key"), FOREIGN, ids=[key for _, key in FOREIGN])
def test_a_key_of_a_drive_is_refused_at_its_line(line: str, key: str) -> None:
    text = MINIMAL + VIRTUAL.replace("virtual = true\n", f"virtual = true\n{line}\n")
    axis, wrong = read(text)
    assert wrong == [(12, f"{key} cannot be in [axes.v], a virtual axis", f"leave {key} out")]
    assert axis.virtual
    assert refused_by_schema(text)


def test_each_key_of_an_axis_is_either_its_own_or_refused() -> None:
    from axisbus.cell import schema

    assert {key for _, key in FOREIGN} == set(schema.AXIS) - virtual_keys.KEYS - {virtual_keys.ENCODER}


@pytest.mark.parametrize(
    ("more", "what", "remedy"),
    [
        ("[axes.v.homing]\nmethod = 35\n", "homing", "set_position"),
        ('[axes.v.objects]\n"6065" = 1\n', "objects", "leave it out"),
        ('[axes.v.stop]\nhalt = "slow-ramp"\n', "stop.halt", "leave halt out"),
        ('[axes.v.stop]\nfault = "ramp"\n', "stop.fault", "leave fault out"),
        ('[axes.v.stop]\nconnection_loss = "fault"\n', "stop.connection_loss", "leave connection_loss out"),
    ],
)
def test_a_table_of_a_drive_is_refused(more: str, what: str, remedy: str) -> None:
    text = MINIMAL + VIRTUAL + more
    _, wrong = read(text)
    line = 15 if "." not in what else 16
    assert [(at, message) for at, message, _ in wrong] == [
        (line, f"{what} cannot be in [axes.v], a virtual axis")
    ]
    assert remedy in wrong[0][2]
    assert refused_by_schema(text)


def test_a_virtual_axis_takes_no_default_torques() -> None:
    text = MINIMAL + VIRTUAL + "torque_slope = 3.0\n"
    _, wrong = read(text)
    assert [(at, message) for at, message, _ in wrong] == [
        (15, "defaults.torque_slope cannot be in [axes.v], a virtual axis")
    ]
    assert refused_by_schema(text)


def test_everything_wrong_is_reported_at_once() -> None:
    text = MINIMAL + VIRTUAL.replace(
        "virtual = true", "virtual = true\nnode = 1\nmodes = 5\nspeed = 3\nscale = -1"
    )
    axis, wrong = read(text)
    assert [at for at, *_ in wrong] == [12, 13, 14, 15]
    assert axis.scale == 10_000


@pytest.mark.parametrize("value", ["1", '"yes"', "[]"])
def test_virtual_is_true_or_false(value: str) -> None:
    text = MINIMAL + VIRTUAL.replace("virtual = true", f"virtual = {value}\nnode = 1\nscale = 1")
    axis, wrong = read(text)
    assert [(at, message) for at, message, _ in wrong] == [(11, "virtual in [axes.v] cannot be used")]
    assert not axis.virtual


def test_an_axis_that_is_not_virtual_needs_a_node_and_a_scale() -> None:
    _, wrong = read(MINIMAL + VIRTUAL.replace("true", "false"))
    assert {message for _, message, _ in wrong} == {
        "node is missing in [axes.v]",
        "scale is missing in [axes.v]",
    }
    assert refused_by_schema(MINIMAL + VIRTUAL.replace("true", "false"))


def test_the_unit_of_a_virtual_axis_is_required() -> None:
    _, wrong = read(MINIMAL + VIRTUAL.replace('unit = "mm"\n', ""))
    assert [message for _, message, _ in wrong] == ["unit is missing in [axes.v]"]


@pytest.mark.parametrize(
    ("unit", "scale"),
    [("mm", 10_000), ("deg", 10_000), ("m", 1_000_000), ("rev", 1_000_000), ("increments", 1)],
)
def test_without_a_scale_it_counts_finely(unit: str, scale: int) -> None:
    text = MINIMAL + VIRTUAL.replace('"mm"', f'"{unit}"')
    axis, wrong = read(text)
    assert wrong == []
    assert axis.scale == scale
    cell, _ = reader.loads(text)
    units = virtual_parameters(cell, "v").units
    assert (units.position.factor, units.velocity.factor, units.acceleration.factor) == (scale, scale, scale)
    assert units.ratio_known


def test_no_deceleration_of_a_virtual_axis_is_guessed() -> None:
    bare = MINIMAL + '[axes.v]\nvirtual = true\nunit = "mm"\n'
    _, wrong = read(bare)
    assert [(at, message) for at, message, _ in wrong] == [(10, "no deceleration is given for [axes.v]")]
    for more, quick in (
        ("max_acceleration = 7.0\n", 7.0),
        ("[axes.v.defaults]\nacceleration = 5.0\n", 5.0),
        ("[axes.v.defaults]\nacceleration = 5.0\ndeceleration = 4.0\n", 4.0),
        ("[axes.v.stop]\ndeceleration = 9.0\n[axes.v.defaults]\nacceleration = 5.0\n", 9.0),
    ):
        cell, problems = reader.loads(bare + more)
        assert problems == []
        assert virtual_parameters(cell, "v").braking.quick == quick * 10_000


def test_the_limits_of_a_virtual_axis_hold_without_homing() -> None:
    cell, _ = reader.loads(MINIMAL + WHOLE)
    assert not homing_required(cell.axes["v"])
    assert not virtual_parameters(cell, "v").homing.required


def test_a_cell_may_have_virtual_axes_alone() -> None:
    cell, problems = reader.loads(BUS + WHOLE)
    assert problems == []
    assert dict(cell.nodes) == {}
    assert not refused_by_schema(BUS + WHOLE)
    _, problems = reader.loads(BUS + WHOLE.replace("true", "false"))
    assert any(each.message == "the cell has no node" for each in problems)


@pytest.mark.parametrize(
    "text", ["axes = 3\n" + BUS, BUS + "[axes]\nv = 3\n", BUS + "[[axes.v]]\nvirtual = true\n"]
)
def test_a_value_that_is_not_an_axis_table_is_reported_and_breaks_nothing(text: str) -> None:
    _, problems = reader.loads(text)
    assert any(each.severity is Severity.ERROR for each in problems)


# -- findings of check -------------------------------------------------------------------------------------------------


def checked(tmp_path, text: str) -> list[str]:
    path = tmp_path / "cell.toml"
    path.write_text(text, encoding="utf-8")
    return [f"{each.severity.value} {each.line}: {each.message}" for each in check(path)]


def test_check_of_a_valid_virtual_axis_reports_its_default_scale(tmp_path) -> None:
    found = checked(tmp_path, BUS + WHOLE)
    assert found == []
    found = checked(tmp_path, BUS + VIRTUAL + "velocity = 3.0\n")
    assert found == ["note 4: virtual axis v counts 10000 increments per mm, because scale is left out"]


def test_check_warns_if_a_virtual_axis_begins_outside_its_limits(tmp_path) -> None:
    found = checked(tmp_path, BUS + WHOLE.replace("-10.0", "10.0"))
    assert found == ["warning 8: virtual axis v begins outside its position limits"]


def test_check_compares_the_numbers_of_a_virtual_axis_with_each_other(tmp_path) -> None:
    found = checked(tmp_path, BUS + WHOLE.replace("velocity = 100.0", "velocity = 501.0"))
    assert any("beyond max_velocity" in each for each in found)
    found = checked(tmp_path, BUS + WHOLE.replace('unit = "deg"', 'unit = "deg"\nmodulo = 360.0'))
    assert any("an endless axis (modulo) has no position limits" in each for each in found)


def test_check_accepts_a_virtual_axis_in_a_group(tmp_path) -> None:
    group = '[groups.xv]\naxes = ["x", "v"]\n'
    assert not [each for each in checked(tmp_path, MINIMAL + WHOLE + group) if each.startswith("error")]
