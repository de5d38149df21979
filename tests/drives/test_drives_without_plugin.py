"""A copy of the package without its only plug-in that contains code: the rest must run on a generic cell without it."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import urllib.request
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
CELL = """
[bus]
interface = "sim"
scan_period = "10ms"
[nodes.1]
eds = "builtin:generic-cia402"
[nodes.2]
eds = "builtin:generic-cia402"
"""
AXIS = """
[axes.{name}]
node = {node}
unit = "deg"
scale = 27.77
max_velocity = 180.0
max_acceleration = 720.0
[axes.{name}.homing]
method = 35
[axes.{name}.defaults]
velocity = 90.0
acceleration = 360.0
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a folder with the copy in ``src`` and a cell file."""
    made = tmp_path_factory.mktemp("without")

    def left_out(directory: str, names: list[str]) -> list[str]:
        return [name for name in names if name in ("__pycache__", "gim6010")]

    shutil.copytree(ROOT / "src", made / "src", ignore=left_out)
    shutil.copytree(ROOT / "eds", made / "eds")
    text = CELL + AXIS.format(name="x", node=1) + AXIS.format(name="y", node=2)
    (made / "cell.toml").write_text(text, encoding="utf-8")
    return made


def environment(folder: Path) -> dict[str, str]:
    """Return the environment in which the copy is imported."""
    return {**os.environ, "PYTHONPATH": str(folder / "src")}


def ran(folder: Path, *arguments: str) -> str:
    """Run ``python`` in the folder, and return what it printed."""
    command = [sys.executable, *arguments]
    done = subprocess.run(
        command, cwd=folder, env=environment(folder), capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_the_copy_is_what_runs_and_knows_the_other_makes(folder: Path) -> None:
    assert ran(folder, "-c", "import axisbus; print(axisbus.__file__)").startswith(str(folder))
    listed = ran(folder, "-m", "axisbus", "drives", "list")
    assert "maxon EPOS4" in listed
    assert "GIM6010" not in listed


def test_it_checks_scans_and_moves_a_generic_cell(folder: Path) -> None:
    assert "0 errors" in ran(folder, "-m", "axisbus", "check", "cell.toml")
    assert (
        ran(folder, "-m", "axisbus", "scan", "-i", "sim", "-c", "cell.toml").count("servo drive (CiA 402)")
        == 2
    )
    moved = ran(folder, "-m", "axisbus", "demo", "cell.toml", "-o", "demo", "--no-plot")
    assert re.search(r"straight line \(csp\) +y +45\.000 +4[45]\.\d+ deg", moved), moved


def test_it_serves_the_page_of_a_generic_cell(folder: Path) -> None:
    command = [sys.executable, "-u", "-m", "axisbus", "web", "cell.toml", "--port", "0"]
    with subprocess.Popen(
        command, cwd=folder, env=environment(folder), stdout=subprocess.PIPE, text=True
    ) as web:
        assert web.stdout is not None
        try:
            found = re.search(r"http\S+", web.stdout.readline())
            assert found
            with urllib.request.urlopen(found[0], timeout=20) as answer:
                assert answer.status == 200
        finally:
            web.kill()
