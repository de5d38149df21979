"""Findings about a drive with ip and without csp."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus.cell.problem import CellProblem
from axisbus.check.run import check
from axisbus.eds.model import Severity
from axisbus.errors import StateError
from axisbus.machine.machine import Machine
from kit.cell import cell_file, cell_text
from kit.sim.interpolated import CSP, HM, IP, PP, USUAL, write_eds

GROUP = '[groups.x1]\naxes = ["x"]\n'


def told(
    folder: Path, modes: int = USUAL, axis: str = "", more: str = "", **changes: str
) -> list[CellProblem]:
    """The findings about its modes."""
    name = write_eds(folder, modes)
    path = cell_file(folder, "x", eds=name, axis=axis, more=more, **changes)
    found = check(path)
    assert not [each for each in found if each.severity is Severity.ERROR and "60C1" not in each.message], (
        found
    )
    return [each for each in found if "ip" in each.message.replace(",", " ").split() or "csp" in each.message]


def test_the_use_of_ip_is_reported(tmp_path: Path) -> None:
    found = told(tmp_path, more=GROUP)
    assert any("has ip and no csp" in each.message for each in found)
    assert not any("refused" in each.message for each in found)  # a group goes along lines


@pytest.mark.parametrize(("modes", "axis"), [(USUAL | CSP, ""), (USUAL, 'modes = ["pp", "pv"]')])
def test_if_ip_is_not_used_it_is_not_reported(tmp_path: Path, modes: int, axis: str) -> None:
    assert not any("has ip and no csp" in each.message for each in told(tmp_path, modes, axis))


def test_csp_that_is_named_is_not_called_unclaimed(tmp_path: Path) -> None:
    found = told(tmp_path, axis='modes = ["pp", "csp"]')
    assert any("has ip and no csp" in each.message for each in found)
    assert not any("not listed" in each.message for each in found)


def test_a_mapping_that_stays_is_reported_as_without_ip_set_points(tmp_path: Path) -> None:
    name = write_eds(tmp_path)
    path = tmp_path / "cell.toml"
    text = cell_text("x", eds=name).replace("[nodes.1]\n", '[nodes.1]\nremap = "never"\n')
    path.write_text(text, encoding="utf-8")
    errors = [each for each in check(path) if each.severity is Severity.ERROR]
    assert ["60C1h:01" in each.message for each in errors] == [True]


def test_without_sync_ip_is_not_reported_as_missing(tmp_path: Path) -> None:
    assert not any("has ip" in each.message for each in told(tmp_path, bus="sync = false"))


def test_a_drive_with_ip_and_neither_pp_nor_csp_is_enabled_in_ip(tmp_path: Path) -> None:
    path = cell_file(tmp_path, "x", eds=write_eds(tmp_path, IP | HM), more=GROUP)
    with Machine.simulated(path) as machine:
        machine["x"].enable().wait()
        machine.group("x").move_linear((10.0,), velocity=20.0, acceleration=200.0).wait()
        assert machine["x"].position == pytest.approx(10.0, abs=0.05)
        with pytest.raises(StateError, match="does not have pp"):
            machine["x"].move_absolute(0.0).wait()


def test_a_line_is_refused_if_6502h_does_not_claim_csp(tmp_path: Path) -> None:
    path = cell_file(tmp_path, "x", eds=write_eds(tmp_path, PP | HM), more=GROUP)
    with Machine.simulated(path) as machine:
        machine["x"].enable().wait()
        with pytest.raises(StateError, match="does not have csp") as caught:
            machine.group("x").move_linear((10.0,), velocity=20.0, acceleration=200.0).wait()
        assert "6502h" in caught.value.observed
        machine["x"].move_absolute(10.0).wait()
    assert any("move_linear will be refused" in each.message for each in check(path))
