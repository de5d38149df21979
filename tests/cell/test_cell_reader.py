"""Cell files become frozen values, and all errors of a file are reported together, each with its line."""

from __future__ import annotations

from dataclasses import FrozenInstanceError
from fractions import Fraction
from pathlib import Path

import pytest

from axisbus.cell import reader
from axisbus.cell.problem import CellProblem
from axisbus.errors import ConfigError
from kit import cells
from kit.cells.mistakes import MINIMAL, SLIPS


def read(text: str) -> tuple[reader.CellConfig, list[CellProblem]]:
    cell, problems = reader.loads(text)
    assert cell is not None, problems
    return cell, problems


def told(text: str) -> list[str]:
    return [f"{problem.line}: {problem.message}" for problem in read(text)[1]]


# -- valid keys ------------------------------------------------------------------------------------------------------


def test_the_whole_clean_cell_is_read_as_written() -> None:
    cell = reader.load(cells.HERE / "clean.toml")
    bus = cell.bus
    assert (bus.interface, bus.channel, bus.bitrate, bus.master_id) == (
        "pcan",
        "PCAN_USBBUS1",
        1_000_000,
        127,
    )
    assert (bus.scan_period, bus.sync, bus.heartbeat, dict(bus.options)) == (0.004, True, 0.1, {"fd": False})

    node = cell.nodes[1]
    assert (node.eds, node.dcf, node.remap, node.optional) == ("drive.eds", None, "auto", False)
    assert [(each.key, each.value, each.line) for each in node.objects] == [("6065", 4000, 16)]
    (pdo,) = node.pdos
    assert (pdo.name, pdo.map, pdo.transmission, pdo.cob_id) == ("TPDO2", ("606C", "6077:00"), 1, None)

    x, y = cell.axes["x"], cell.axes["y"]
    assert (x.node, x.drive_axis, x.unit, x.scale, x.velocity_scale) == (1, 1, "mm", Fraction(1000), None)
    assert (x.position_limits, x.max_velocity, x.max_acceleration, x.max_torque) == ((0, 500), 200, 2000, 4)
    assert (x.defaults.velocity, x.defaults.acceleration, x.defaults.deceleration) == (100, 1000, 1000)
    assert x.defaults.torque_slope == 10
    homing = x.homing
    assert (homing.method, homing.speed_switch, homing.speed_zero, homing.timeout) == (17, 20, 2, 30)
    assert (homing.offset, homing.required) == (-5, None)
    assert (x.stop.quick_stop, x.stop.halt, x.stop.fault) == ("ramp", "slow-ramp", None)
    assert (x.stop.deceleration, x.stop.halt_time) == (4000, 2.0)
    assert [(each.key, each.value) for each in x.objects] == [("609A", 500000)]
    assert (y.scale, y.invert, y.modulo) == (Fraction(131072, 360), "master", 360)
    assert y.modes == ("pp", "pv", "hm", "csp")
    assert y.holds_load is None
    assert cell.groups["xy"].axes == ("x", "y")
    assert cell.folder == cells.HERE


def test_the_order_of_a_groups_axes_is_kept() -> None:
    cell, _ = read(
        MINIMAL + '[axes.y]\nnode=1\ndrive_axis=2\nunit="deg"\nscale=1\n[groups.g]\naxes = ["y", "x"]\n'
    )
    assert cell.groups["g"].axes == ("y", "x")


def test_keys_that_are_left_out_have_the_documented_defaults() -> None:
    cell, problems = read(MINIMAL)
    assert problems == []
    assert (cell.bus.master_id, cell.bus.sync, cell.bus.heartbeat, cell.bus.bitrate) == (127, True, 0.1, None)
    axis = cell.axes["x"]
    assert axis.drive_axis == 1
    assert axis.invert is None
    assert axis.defaults.velocity is None
    assert axis.homing.method is None
    assert all(axis.stop.word(key) is None for key in ("quick_stop", "halt", "disable", "fault"))


def test_values_cannot_be_changed() -> None:
    cell, _ = read(MINIMAL)
    with pytest.raises(FrozenInstanceError):
        cell.bus.sync = False  # type: ignore[misc]


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("4ms", 0.004),
        ("2.5 ms", 0.0025),
        ("500us", 0.0005),
        ("500 µs", 0.0005),
        ("1s", 1.0),
        (" 0.02s ", 0.02),
    ],
)
def test_times_have_units(text: str, seconds: float) -> None:
    cell, problems = read(MINIMAL.replace('"4ms"', f'"{text}"'))
    assert problems == []
    assert cell.bus.scan_period == seconds


@pytest.mark.parametrize(
    ("written", "remedy"),
    [
        ("4", '"4ms"'),
        ("0.004", '"0.004s"'),
        ('"4"', "units are"),
        ('"4 m"', "units are"),
        ('"-4ms"', "units are"),
        ('"1e3ms"', "units are"),
        ('"2s"', '"1s" is the longest'),
        ('"10us"', '"100us" is the shortest'),
        ("true", "units are"),
        ('"' + "9" * 400 + 's"', "units are"),
    ],
)
def test_times_without_a_unit_or_out_of_range_are_refused(written: str, remedy: str) -> None:
    _, problems = read(MINIMAL.replace('"4ms"', written))
    assert [problem.line for problem in problems] == [3]
    assert "scan_period in [bus] cannot be used" in problems[0].message
    assert "a time with its unit" in problems[0].observed
    assert remedy in problems[0].remedy


def test_the_heartbeat_can_only_be_switched_off_by_the_word() -> None:
    heartbeat = '[bus]\nheartbeat = "off"\n'
    assert read(MINIMAL.replace("[bus]\n", heartbeat))[0].bus.heartbeat is None
    for wrong in ("0", "false", '"0ms"', '""'):
        _, problems = read(MINIMAL.replace("[bus]\n", heartbeat.replace('"off"', wrong)))
        assert [problem.line for problem in problems] == [2], wrong
        assert '"off"' in problems[0].observed


@pytest.mark.parametrize(
    ("written", "exact"),
    [
        ("1000", Fraction(1000)),
        ("0.5", Fraction(1, 2)),
        ('"131072/360"', Fraction(131072, 360)),
        ('"2.5 / 0.1"', Fraction(25)),
    ],
)
def test_scales_are_exact(written: str, exact: Fraction) -> None:
    cell, problems = read(MINIMAL.replace("364.0888888888889", written))
    assert problems == []
    assert cell.axes["x"].scale == exact


@pytest.mark.parametrize(
    "written",
    ["0", "0.0", "-5", "inf", "nan", '"1/0"', '"a/b"', '"1/2/3"', "true", "1e300", '"1e9999999"', "[1]"],
)
def test_scales_of_zero_or_without_meaning_are_refused(written: str) -> None:
    _, problems = read(MINIMAL.replace("364.0888888888889", written))
    assert [problem.line for problem in problems] == [9]
    assert "scale in [axes.x] cannot be used" in problems[0].message


def test_the_error_for_a_negative_scale_names_the_key_that_inverts_an_axis() -> None:
    _, problems = read(MINIMAL.replace("364.0888888888889", "-364"))
    assert 'invert = "master"' in problems[0].remedy


def test_a_scale_is_required_unless_the_axis_is_in_increments() -> None:
    without = MINIMAL.replace("scale = 364.0888888888889\n", "")
    assert told(without) == ["6: scale is missing in [axes.x]"]
    assert told(without.replace('"deg"', '"increments"')) == []


def test_load_false_means_that_nothing_holds_a_load() -> None:
    assert read(MINIMAL + "holds_load = false\n")[0].axes["x"].holds_load is None
    assert read(MINIMAL + 'holds_load = "brake"\n')[0].axes["x"].holds_load == "brake"
    (problem,) = read(MINIMAL + "holds_load = true\n")[1]
    assert problem.line == 10
    assert '"brake"' in problem.observed
    assert '"torque"' in problem.observed


def test_the_words_of_the_stop_table_are_named_when_one_is_wrong() -> None:
    (problem,) = read(MINIMAL + '[axes.x.stop]\nquick_stop = "rampe"\n')[1]
    assert problem.line == 11
    assert '"ramp-hold"' in problem.observed
    assert 'did you mean "ramp"?' in problem.remedy


# -- errors ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("old", "new", "line", "message", "remedy"),
    SLIPS,
)
def test_each_slip_is_reported_with_its_line_and_remedy(
    old: str, new: str, line: int, message: str, remedy: str
) -> None:
    problems = read(cells.changed(cells.CLEAN, (old, new)))[1]
    assert [problem.line for problem in problems][:1] == [line], list(map(str, problems))
    assert message in problems[0].message
    assert remedy in problems[0].remedy
    assert str(problems[0]).startswith(f"cell.toml:{line}: error: ")


def test_an_empty_node_names_no_file() -> None:
    assert told(MINIMAL.replace('eds = "builtin:gim6010-8"\n', "")) == [
        "4: [nodes.1] gives neither eds nor dcf"
    ]


def test_all_slips_are_reported_at_once_in_the_order_of_the_lines() -> None:
    text = cells.changed(
        cells.CLEAN,
        ("sync = true", "sync = 3"),
        ("method = 17", "method = 300"),
        ("[groups.xy]", "[groups.xy]\nlabel = 1"),
        ('interface = "pcan"\n', ""),
    )
    assert told(text) == [
        "2: interface is missing in [bus]",
        "7: sync in [bus] cannot be used",
        "37: method in [axes.x.homing] cannot be used",
        "66: unknown key 'label' in [groups.xy]",
    ]


def test_an_empty_file_misses_its_tables() -> None:
    assert told("") == [
        "1: [bus] is missing",
        "1: the cell has no node",
        "1: the cell has no axis",
    ]


@pytest.mark.parametrize("value", ["0", '"text"', "[]", "[1, 2]", "1979-05-27"])
@pytest.mark.parametrize("table", ["bus", "nodes", "axes", "groups"])
def test_a_value_instead_of_a_table_is_reported(table: str, value: str) -> None:
    (first, *_) = [each for each in read(f"{table} = {value}\n")[1] if "must be a table" in each.message]
    assert first.line == 1
    assert first.message == f"{table} must be a table"


def test_double_brackets_are_reported_as_such() -> None:
    (problem,) = read(MINIMAL + '[[groups]]\naxes = ["x"]\n')[1]
    assert (problem.line, problem.message) == (10, "groups must be a table")
    assert "single brackets" in problem.remedy


# -- load and read ---------------------------------------------------------------------------------------------------


def test_load_raises_the_first_error_and_lists_the_others(tmp_path: Path) -> None:
    path = cells.write(tmp_path, ("sync = true", "sync = 3"), ("method = 17", "method = 300"))
    with pytest.raises(ConfigError) as caught:
        reader.load(path)
    error = caught.value
    assert (error.file, error.line) == (str(path), 8)
    assert error.message == f"{path}:8: sync in [bus] cannot be used"
    assert "1 more error:" in error.observed
    assert f"{path}:38: method in [axes.x.homing] cannot be used" in error.observed
    assert error.remedy


def test_load_takes_a_cell_with_warnings_only(tmp_path: Path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text(MINIMAL.split("[axes.x]", maxsplit=1)[0])
    cell = reader.load(path)
    assert cell.axes == {}
    assert [problem.severity.value for problem in reader.read(path)[1]] == ["warning"]


def test_read_returns_the_error_that_load_would_raise(tmp_path: Path) -> None:
    cell, problems = reader.read(tmp_path / "missing.toml")
    assert cell is None
    (problem,) = problems
    assert (problem.file, problem.line) == (str(tmp_path / "missing.toml"), 0)
    assert problem.message == "the file does not exist"
    assert str(problem).startswith(
        f"{tmp_path / 'missing.toml'}: error: the file does not exist\n  remedy:   "
    )


def test_a_syntax_error_has_its_location_once() -> None:
    cell, (problem,) = reader.loads("[bus]\na = \n", "cell.toml")
    assert cell is None
    assert problem.line == 2
    assert problem.message.startswith("this is not TOML")


def test_a_missing_cell_file_is_not_confused_with_a_project_file(tmp_path):
    (tmp_path / "pyproject.toml").write_text("")
    with pytest.raises(ConfigError) as caught:
        reader.load(tmp_path / "cell.toml")
    assert "pyproject" not in str(caught.value)
    (tmp_path / "cells.toml").write_text("")
    with pytest.raises(ConfigError, match=r"there is: cells\.toml"):
        reader.load(tmp_path / "cell.toml")
