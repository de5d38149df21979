"""The command line on a cell with a virtual axis: it is moved as any other; commands that need a drive skip or refuse it."""

from __future__ import annotations

import json

import pytest

from axisbus.cell import reader
from axisbus.cli.shared.completion import nodes_and_axes
from axisbus.errors import StateError
from axisbus.machine.dry_run import DryRun
from kit.cell import cell_text
from kit.virtual_axis import virtual


@pytest.fixture
def cell(tmp_path):
    path = tmp_path / "cell.toml"
    group = '[groups.xv]\naxes = ["x", "v"]\n'
    path.write_text(cell_text("x", bus="bitrate = 1_000_000", more=virtual() + group))
    return path


@pytest.fixture
def alone(tmp_path):
    path = tmp_path / "alone.toml"
    path.write_text(cell_text("", bus="bitrate = 1_000_000", more=virtual()))
    return path


def test_a_virtual_axis_is_moved_with_the_others_and_needs_no_homing(axisbus, cell):
    code, out, _ = axisbus("move", cell, "x=5", "v=12.5", "--home")
    assert code == 0
    assert "v: at 12.5000 deg" in out
    assert "v: homed" not in out
    code, out, _ = axisbus("home", cell)
    assert code == 0
    assert "x: homed" in out
    code, out, _ = axisbus("home", cell, "xv")
    assert code == 0


def test_commands_that_need_a_drive_are_refused_before_the_bus_is_opened(axisbus, cell):
    for arguments, words in (
        (("home", cell, "v"), "no drive that could be homed"),
        (("torque", cell, "v=1"), "no torque"),
        (("move", cell, "v=300000"), "does not fit"),
        (("od", "read", "--cell", cell, "v:6064"), "no node"),
        (("nmt", "stop", "v", "--cell", cell), "no node"),
    ):
        code, _, err = axisbus(*arguments)
        assert code != 0, arguments
        assert words in err, arguments


def test_a_cell_of_it_alone_is_booted_planned_and_shown(axisbus, alone):
    code, out, _ = axisbus("boot", alone)
    assert code == 0
    assert "axis v is virtual: only the core moves it, without a node" in out
    assert axisbus("load", alone).code == 0
    assert axisbus("plan", alone).code == 0
    code, out, _ = axisbus("velocity", alone, "v=50", "--for", "0.2s")
    assert code == 0
    code, _, err = axisbus("home", alone)
    assert code != 0
    assert "virtual" in err


def test_monitor_shows_a_virtual_axis_without_a_node(axisbus, cell):
    code, out, _ = axisbus("monitor", cell, "--count", "1", "--json")
    assert code == 0
    seen = {each["axis"]: each for each in json.loads(out)}
    assert (seen["v"]["node"], seen["v"]["position"], seen["v"]["incidents"]) == (None, 0.0, [])
    assert seen["x"]["node"] == 1


def test_a_virtual_axis_is_recorded(axisbus, cell, tmp_path):
    assert axisbus("record", cell, "-o", tmp_path / "a.mcap", "--for", "0.3").code == 0
    code, _, err = axisbus("record", cell, "-o", tmp_path / "b.mcap", "--for", "0.3", "--objects", "v:6074")
    assert code != 0
    assert "virtual" in err


def test_the_demo_refuses_it(axisbus, cell, tmp_path):
    code, _, err = axisbus("demo", cell, "-o", tmp_path)
    assert code != 0
    assert "virtual" in err


def test_a_virtual_axis_is_not_a_node_that_the_shell_completes(cell):
    assert [name for name, _ in nodes_and_axes(reader.load(cell))] == ["1", "x"]


def test_a_rehearsal_knows_it(cell):
    rehearsal = DryRun(reader.load(cell))
    assert rehearsal["v"].move_absolute(3.0).done
    with pytest.raises(StateError):
        rehearsal["w"]
