"""Pairs of axes that carry one beam, on the command line: by the name of the pair, and never one side alone."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

from axisbus.cell import reader
from axisbus.cli.shared.axes_and_pairs import as_pairs, sides_of
from axisbus.cli.shared.common import in_commands
from axisbus.errors import LimitError, SkewError, StateError
from axisbus.machine.dry_run import DryRun
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState
from kit.cell import cell_file
from kit.gantry.pair import HOMING
from kit.scenarios.core_process import OWN_PROCESS, own_cell

pytestmark = [pytest.mark.timeout(120)]
TABLE = '[groups.all]\naxes = ["z", "x", "y"]\n[gantries.b]\naxes = ["x", "y"]\nmax_skew = 8.0\n' + HOMING
LIMITS = "max_acceleration = 2000.0\nposition_limits = [-300.0, 300.0]"


@pytest.fixture
def cell(tmp_path) -> Path:
    return cell_file(tmp_path, "xyz", period="20ms", heartbeat="1s", axis=LIMITS, more=TABLE)


def test_a_pair_is_moved_by_its_name_with_an_axis_beside(axisbus, cell):
    code, out, err = axisbus("move", cell, "b=10", "z=5", "--velocity", "90")
    assert code == 0, err
    assert "enabled: b, z\nb: moving to 10 deg\nz: moving to 5 deg\n" in out
    where, skew = map(float, re.search(r"b: at (-?[\d.]+) deg, ([\d.]+) deg out of square", out).groups())
    assert where == pytest.approx(10.0, abs=0.1)
    assert skew < 0.1
    assert "all axes are at standstill and disabled" in out


def test_a_pair_moves_at_a_velocity_for_its_time(axisbus, cell):
    code, out, err = axisbus("velocity", cell, "b=-40", "--for", "0.5")
    assert code == 0, err
    assert "b: has -40 deg/s" in out
    assert -60.0 < float(re.search(r"b: stands at (-?[\d.]+) deg", out)[1]) < -15.0


def test_a_pair_that_finds_no_switch_is_reported_and_disabled_again(axisbus, cell):
    cell.write_text(cell.read_text("utf-8").replace("distance = -90.0", "distance = -5.0"), encoding="utf-8")
    code, out, err = axisbus("home", cell, "b")
    assert code == 3
    assert "enabled: b" in out
    assert "b.home(): a switch was not found within 5 deg" in err


@pytest.mark.parametrize(
    ("words", "code", "told"),
    [
        (("move", "x=1"), 1, "x: x and y carry one beam, and axisbus move applies to both"),
        (("move", "b=1", "y=1"), 1, "name the pair: b"),
        (("move", "b=1", "b=2"), 2, "axis b is named twice"),
        (("move", "w=1"), 1, "it has x, y, z; its pairs are b"),
        (("move", "b=1", "--timeout", "3"), 2, "--timeout does not apply to a gantry pair"),
        (("move", "b=301"), 2, "beyond the position limits"),
        (("move", "b=601", "--relative"), 2, "would end beyond the position limits"),
        (("move", "b=1", "--velocity", "500"), 2, "velocity 500 deg/s is beyond that of x"),
        (("home", "y"), 1, "axisbus home applies to both"),
        (("home", "w"), 1, "its groups are all; its pairs are b"),
        (("velocity", "y=1", "--for", "1"), 1, "axisbus velocity applies to both"),
        (("torque", "b=1", "--for", "1"), 1, "a pair cannot be moved by a torque"),
        (("torque", "x=1", "--for", "1"), 1, "axisbus torque applies to both"),
        (("jog", "b"), 1, "axisbus jog is for one axis, and x and y carry one beam"),
        (("jog", "x", "--velocity", "5"), 1, "b=... --for 1s"),
        (("reset", "b", "x"), 2, "axis x is named twice"),
    ],
)
def test_invalid_commands_of_a_pair_are_refused_before_the_bus_is_opened(
    axisbus, cell, monkeypatch, words, code, told
):
    def opened(*_, **__):
        raise AssertionError("the bus was opened")

    monkeypatch.setattr(Machine, "open", opened)
    result = axisbus(words[0], cell, *words[1:])
    assert result.code == code
    assert told in result.err


def test_all_axes_a_group_or_both_by_name_are_the_pair(cell):
    config = reader.load(cell)
    assert as_pairs(config, ["x", "y", "z"], "enable") == ["b", "z"]
    assert as_pairs(config, ["z", "y", "x"], "enable") == ["z", "b"]
    assert as_pairs(config, ["y"]) == ["y"]  # a halt of one axis is one of both
    with pytest.raises(StateError, match="axisbus enable applies to both"):
        as_pairs(config, ["z", "y"], "enable")
    assert sides_of(config, ["z", "b"], "move") == ["z", "x", "y"]


def test_a_dry_run_checks_a_pair_at_its_observed_position(cell):
    text = cell.read_text("utf-8").replace("required = false", "required = true")
    cell.write_text(text, encoding="utf-8")
    rehearsal = DryRun(reader.load(cell))
    beam = rehearsal.gantry("b")
    beam.move_relative(400.0)  # not homed: unknown
    with pytest.raises(Exception, match="not homed"):
        beam.move_absolute(10.0)
    beam.home()
    beam.move_absolute(10.0)
    beam.move_relative(400.0)
    with pytest.raises(LimitError):
        beam.move_relative(601.0)
    for name in "xy":
        rehearsal.see(name, rehearsal[name].snapshot._replace(position=25000, origin=0))
    with pytest.raises(LimitError):
        beam.move_relative(51.0)
    beam.move_relative(49.0)


@OWN_PROCESS
def test_in_a_machine_that_runs_a_pair_is_enabled_halted_and_disabled(axisbus, tmp_path, core_in_threads):
    file = own_cell(tmp_path, axis=LIMITS, more='[gantries.b]\naxes = ["x", "y"]\nmax_skew = 8.0\n')
    with Machine.open(file) as machine:
        code, out, err = axisbus("enable", file, "--take")
        assert code == 0, err
        assert "enabled: b" in out
        assert all(axis.state is AxisState.STANDSTILL for axis in machine)
        assert "axisbus enable applies to both" in axisbus("enable", file, "x", "--take").err
        code, out, err = axisbus("halt", file, "b")
        assert code == 0, err
        assert "b: stands at 0.0000 deg, 0.0000 deg out of square" in out
        code, out, err = axisbus("disable", file, "y", "--take")  # one of them: both
        assert code == 0, err
        assert all(axis.state is AxisState.DISABLED for axis in machine)
        assert "x: no fault\ny: no fault\n" in axisbus("reset", file, "b", "--take").out


@pytest.mark.parametrize(
    ("remedy", "said"),
    [
        ("see why; then b.reset()", "see why; then axisbus reset my.toml b"),
        (
            "make the beam square first: b.square(velocity=...), slowly",
            "square first, in a program: b.square(",
        ),
        (
            "then b.disable(), b.reset(), b.enable(skew=...) with a bound",
            "then, in a program, b.disable(), b.reset(), b.enable(",
        ),
        (
            "add [gantries.b.homing] to cell.toml; or give the position of the beam: b.set_position(...)",
            "to cell.toml",
        ),
    ],
)
def test_the_remedy_for_a_pair_is_a_command_or_a_program(monkeypatch, remedy, said):
    monkeypatch.setattr(sys, "argv", ["axisbus", "move", "my.toml"])
    told = in_commands(SkewError("b: no", remedy=remedy))
    assert said in told
    assert "set_position" not in told


def test_homing_a_pair_without_homing_in_the_cell_file_is_refused_before_the_bus_is_opened(axisbus, cell):
    text = cell.read_text("utf-8")
    cell.write_text(text[: text.index("[gantries.b.homing]")], encoding="utf-8")
    code, _, err = axisbus("home", cell, "b")
    assert code == 2
    assert "add [gantries.b.homing] to cell.toml" in err
    assert "set_position" not in err
