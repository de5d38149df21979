"""The notebooks of examples/ are kept without their outputs, and close their machines."""

from __future__ import annotations

import sys

import nbformat
import pytest

from kit.pages import ROOT

pytestmark = [
    pytest.mark.skipif(sys.platform != "linux", reason="signals, and a core that others can join"),
    pytest.mark.timeout(120),
]
NOTEBOOKS = sorted((ROOT / "examples").glob("*.ipynb"))


def read(path):
    return nbformat.read(path, as_version=4)


def test_there_are_notebooks():
    assert [path.stem for path in NOTEBOOKS] == ["eds_inspection", "first_steps", "tuning_by_capture"]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_without_outputs(path):
    cells = [cell for cell in read(path).cells if cell.cell_type == "code"]
    assert all(cell.outputs == [] and cell.execution_count is None for cell in cells)


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_closes_its_machine(path):
    code = "\n".join(cell.source for cell in read(path).cells if cell.cell_type == "code")
    assert ("Machine" in code) == ("cell.close()" in code)
