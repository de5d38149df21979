"""Drives whose EDS has an object read-only that a command sets: it is compared, and not written."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus.check.run import check
from axisbus.eds.builtin import resolve
from axisbus.eds.model import Severity
from axisbus.errors import BootError, DriveError
from axisbus.machine.machine import Machine
from kit.cell import cell_file

GROUP = '[groups.x1]\naxes = ["x"]\n'
PERIOD_VALUE, PERIOD_EXPONENT = "60C2sub1", "60C2sub2"


def cell(folder: Path, *fixed: tuple[str, int | None], period: str = "10ms") -> Path:
    """Write a cell whose drive has these sections of its EDS read-only, each with this value, or none; return its path."""
    text = resolve("builtin:generic-cia402", folder).read_text(encoding="utf-8")
    for section, value in fixed:
        head, mark, tail = text.partition(f"[{section}]\n")
        entry, blank, rest = tail.partition("\n\n")
        lines = [line for line in entry.splitlines() if not line.startswith(("AccessType", "DefaultValue"))]
        lines += ["AccessType=ro"] if value is None else ["AccessType=ro", f"DefaultValue={value}"]
        entry = "\n".join(lines)
        text = head + mark + entry + blank + rest
    (folder / "drive.eds").write_text(text, encoding="utf-8")
    return cell_file(folder, "x", eds="drive.eds", period=period, more=GROUP)


def home(machine: Machine) -> None:
    machine["x"].home().wait()


def line(machine: Machine) -> None:
    machine.group("x").move_linear((10.0,), velocity=20.0, acceleration=200.0).wait()
    assert machine["x"].position == pytest.approx(10.0, abs=0.05)


def turn(machine: Machine) -> None:
    machine["x"].cyclic_velocity(10.0, acceleration=50.0).wait()
    machine["x"].halt().wait()


def move(machine: Machine) -> None:
    machine["x"].move_absolute(10.0).wait()
    assert machine["x"].position == pytest.approx(10.0, abs=0.05)


def failed(path: Path, command) -> DriveError:
    """Return the error of a command, after which the axis has not moved."""
    with Machine.simulated(path) as machine:
        machine["x"].enable().wait()
        before = machine["x"].position
        with pytest.raises(DriveError) as caught:
            command(machine)
        assert machine["x"].position == pytest.approx(before, abs=0.02)
    return caught.value


def warned(path: Path) -> list[str]:
    """Return the warnings of ``check``, and fail for an error."""
    found = check(path)
    assert not [each for each in found if each.severity is Severity.ERROR], found
    return [str(each) for each in found if "cannot be written" in f"{each.message} {each.observed}"]


RUNS = [
    (((PERIOD_EXPONENT, -3),), line),
    (((PERIOD_EXPONENT, -3),), turn),
    (((PERIOD_EXPONENT, -4),), line),  # 100 x 10^-4 s
    (((PERIOD_VALUE, 10),), line),
    (((PERIOD_VALUE, 10), (PERIOD_EXPONENT, -3)), line),
    ((("6098", 35),), home),
    ((("6082", 0),), move),
    ((("6081", 10000),), move),
]


@pytest.mark.parametrize(("fixed", "command"), RUNS)
def test_a_command_runs_if_the_value_is_there_already(tmp_path, fixed, command):
    path = cell(tmp_path, *fixed)
    assert warned(path) == []
    with Machine.simulated(path) as machine:
        machine["x"].enable().wait()
        command(machine)
        assert not any("cannot be written" in each for each in machine.reports[0].warnings)


FAILS = [
    (((PERIOD_EXPONENT, -6),), line, "interpolation time", "60C2h"),
    (((PERIOD_EXPONENT, 0),), turn, "interpolation time", "60C2h"),
    (((PERIOD_VALUE, 8),), line, "interpolation time", "60C2h"),
    (((PERIOD_VALUE, 10), (PERIOD_EXPONENT, -4)), line, "interpolation time", "60C2h"),
    ((("6098", 37),), home, "6098h homing method", "it is 37"),
    ((("6082", 500),), move, "6082h end velocity", "it is 500"),
    ((("6081", 777),), move, "6081h profile velocity", "it is 777"),
]


@pytest.mark.parametrize(("fixed", "command", "what", "seen"), FAILS)
def test_another_value_is_named_before_anything_moves(tmp_path, fixed, command, what, seen):
    path = cell(tmp_path, *fixed)
    error = failed(path, command)
    assert what in error.message
    assert seen in error.observed
    assert "EDS" in error.remedy or "scan_period" in error.remedy


@pytest.mark.parametrize(("fixed", "command", "what", "seen"), FAILS)
def test_check_and_boot_warn_of_commands_that_will_be_refused(tmp_path, fixed, command, what, seen):
    path = cell(tmp_path, *fixed)
    (warning,) = warned(path)
    assert "will be refused" in warning
    with Machine.simulated(path) as machine:
        (warning,) = [each for each in machine.reports[0].warnings if "cannot be written" in each]
    assert "will be refused" in warning


def about(path: Path, index: str) -> list[tuple[Severity, str]]:
    """Return the findings of ``check`` about an object that cannot be written."""
    return [
        (each.severity, each.message)
        for each in check(path)
        if index in each.message and "cannot be written" in each.message
    ]


@pytest.mark.parametrize("value", [2, None])
def test_an_option_code_that_a_setting_means_is_compared_at_boot(tmp_path, value):
    path = cell(tmp_path, ("605A", value))  # quick_stop = "ramp" means 2
    ((severity, message),) = about(path, "605Ah")
    assert severity is Severity.NOTE
    assert "boot compares it with 2" in message


def test_a_drive_with_the_value_of_a_setting_boots_and_is_not_written(tmp_path):
    path = cell(tmp_path, ("605A", 2))
    with Machine.simulated(path) as machine:
        assert machine.simulated_node(1).device.read(0x605A) == 2
        machine["x"].enable().wait()
        move(machine)


def test_check_refuses_a_setting_if_the_eds_has_another_value(tmp_path):
    path = cell(tmp_path, ("605A", 5))
    ((severity, message),) = about(path, "605Ah")
    assert severity is Severity.ERROR
    assert "quick_stop in [axes.x.stop]" in message
    (found,) = [each for each in check(path) if each.severity is Severity.ERROR]
    assert "it is 5; 2 is wanted" in found.observed
    assert "drive.eds" in found.observed
    assert found.remedy


def test_boot_refuses_a_setting_if_the_drive_has_another_value(tmp_path):
    path = cell(tmp_path, ("605A", None))  # the simulated drive then begins with 2
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace('quick_stop = "ramp"', 'quick_stop = "ramp-hold"'), encoding="utf-8")
    with pytest.raises(BootError) as caught, Machine.simulated(path):
        pass
    assert "quick_stop in [axes.x.stop]" in caught.value.message
    assert "read-only" in caught.value.message
    assert "expected 6, got 2" in caught.value.observed
    assert "manufacturer's tool" in caught.value.remedy
