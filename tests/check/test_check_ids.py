"""Each check of a cell file has an id of its own that explains it, and findings that several axes share are put together."""

from __future__ import annotations

import importlib
import re
import sys
from pathlib import Path

import pytest

from axisbus.cell.problem import CellProblem, shared
from axisbus.check.ids.table import PART, READER, UNREADABLE, checks, id_of, ids
from axisbus.check.run import all_checks, check
from axisbus.drives import registry
from axisbus.eds.model import Severity
from axisbus.toml import tables
from kit import cells
from kit.pages import ROOT

TABLE = (ROOT / "src" / "axisbus" / "check" / "ids" / "checks.tsv").read_text(encoding="utf-8").splitlines()
CHECKS = all_checks(())
ROWS = [line.split("\t") for line in TABLE if line.startswith("C")]
OF_READING = {
    getattr(tables, name) for name in vars(tables) if re.fullmatch(r"C\d{3}", str(getattr(tables, name)))
}


def test_every_id_is_there_once_and_they_continue_without_a_gap_but_for_those_of_plug_ins() -> None:
    of_plugins = [row["rule"] for part in registry.parts(PART) for row in part()]
    numbers = [f"C{number:03d}" for number in range(1, len(ROWS) + 10) if not 20 <= number <= 28]
    assert [row[0] for row in ROWS] == numbers
    assert list(checks()) == sorted([*numbers, *of_plugins])
    assert len(checks()) == len(numbers) + len(of_plugins)


def test_every_check_has_an_id_and_every_id_a_check() -> None:
    of_checks = list(map(id_of, CHECKS))
    assert all(of_checks)
    assert len(set(of_checks)) == len(of_checks)
    assert set(of_checks) == set(ids().values())
    assert {row[0] for row in ROWS if row[1] == READER} == {*OF_READING, UNREADABLE}


def test_every_id_is_explained() -> None:
    for rule in checks().values():
        assert rule.title.endswith("."), rule.id
        assert rule.explanation.endswith("."), rule.id
        assert rule.remedy, rule.id
        assert not rule.remedy.endswith("."), rule.id


def test_every_id_is_documented(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.syspath_prepend(str(ROOT / "docs" / "site"))
    page = importlib.import_module("eds_rules").pages()["reference/cell-checks"]
    sys.modules.pop("eds_rules")
    assert re.findall(r"^### (\S+)$", page, re.MULTILINE) == list(checks())


@pytest.mark.parametrize(
    ("change", "rule"),
    [
        (("scan_period", "scan_perod"), "C002"),
        (('"4ms"', "4"), "C004"),
        (('"drive.eds"', '"gone.eds"'), "C010"),
        (("[bus]", "[bus"), "C001"),
    ],
)
def test_findings_of_the_reader_have_an_id_too(tmp_path: Path, change: tuple[str, str], rule: str) -> None:
    found = check(cells.write(tmp_path, change))
    assert rule in {each.rule for each in found if each.severity is Severity.ERROR}
    assert all(each.rule in checks() for each in found)


def test_every_finding_of_a_cell_has_the_id_of_its_check(tmp_path: Path) -> None:
    cell = cells.write(tmp_path)
    found = check(cell)
    assert found
    assert all(each.rule in checks() for each in found)
    assert all(each.with_rule.splitlines()[0].endswith(f" [{each.rule}]") for each in found)


def note(message: str, line: int, observed: str = "", remedy: str = "") -> CellProblem:
    return CellProblem(Severity.NOTE, "cell.toml", line, message, observed, remedy, rule="C001")


def texts(*problems: CellProblem) -> list[str]:
    return [each.problem.with_rule for each in shared(problems)]


def test_a_finding_of_several_axes_is_one_that_names_them() -> None:
    assert texts(
        note("axis x: its ramp is flat", 3, "6085h is 0", "deceleration = ... in [axes.x.stop]"),
        note("axis y: its ramp is flat", 7, "6085h is 0", "deceleration = ... in [axes.y.stop]"),
        note("axis z: its ramp is flat", 9, "6085h is 1", "deceleration = ... in [axes.z.stop]"),
    ) == [
        "cell.toml:3: note: axes x and y (lines 3 and 7): its ramp is flat [C001]\n"
        "  observed: 6085h is 0\n"
        "  remedy:   deceleration = ... in [axes.NAME.stop]",
        "cell.toml:9: note: axis z: its ramp is flat [C001]\n"
        "  observed: 6085h is 1\n"
        "  remedy:   deceleration = ... in [axes.z.stop]",
    ]


def test_so_is_one_of_several_nodes_and_inputs() -> None:
    assert texts(note("node 1 sends no heartbeat", 3), note("node 2 sends no heartbeat", 5)) == [
        "cell.toml:3: note: nodes 1 and 2 (lines 3 and 5): each sends no heartbeat [C001]"
    ]
    assert texts(note("[io.a]: it is late", 3), note("[io.b]: it is late", 5)) == [
        "cell.toml:3: note: io a and b (lines 3 and 5): it is late [C001]"
    ]


def test_a_number_equal_to_a_node_id_is_kept_if_it_has_another_meaning() -> None:
    assert texts(note("node 1: it has 1 axis", 3), note("node 2: it has 2 axes", 5)) == [
        "cell.toml:3: note: node 1: it has 1 axis [C001]",
        "cell.toml:5: note: node 2: it has 2 axes [C001]",
    ]


def test_findings_that_belong_to_no_axis_are_not_combined() -> None:
    assert len(texts(note("the bus is full", 3), note("the bus is full", 4))) == 2
