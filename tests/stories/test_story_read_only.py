"""Drives whose EDS has an object read-only that a command sets: it is compared, and not written."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus.check.run import check
from axisbus.eds.builtin import resolve
from axisbus.eds.model import Severity
from axisbus.errors import DriveError
from axisbus.machine.machine import Machine
from kit.cell import cell_text

GROUP = '[groups.x1]\naxes = ["x"]\n'
PERIOD_VALUE, PERIOD_EXPONENT = "60C2sub1", "60C2sub2"


def cell(folder: Path, *fixed: tuple[str, int], period: str = "10ms") -> Path:
    """Write a cell whose drive has these sections of its EDS read-only, each with this value; return its path."""
    text = resolve("builtin:generic-cia402", folder).read_text(encoding="utf-8")
    for section, value in fixed:
        head, mark, tail = text.partition(f"[{section}]\n")
        entry, blank, rest = tail.partition("\n\n")
        lines = [line for line in entry.splitlines() if not line.startswith(("AccessType", "DefaultValue"))]
        entry = "\n".join([*lines, "AccessType=ro", f"DefaultValue={value}"])
        text = head + mark + entry + blank + rest
    (folder / "drive.eds").write_text(text, encoding="utf-8")
    path = folder / "cell.toml"
    path.write_text(cell_text("x", eds="drive.eds", period=period, more=GROUP), encoding="utf-8")
    return path


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
    """Return what ``check`` warns of, and fail for an error."""
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
def test_check_and_boot_say_what_will_be_refused(tmp_path, fixed, command, what, seen):
    path = cell(tmp_path, *fixed)
    (warning,) = warned(path)
    assert "will be refused" in warning
    with Machine.simulated(path) as machine:
        (warning,) = [each for each in machine.reports[0].warnings if "cannot be written" in each]
    assert "will be refused" in warning
