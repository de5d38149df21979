"""The plug-in of the GIM6010-8 is in one folder, and is imported only for a cell that needs it."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from axisbus.drives import registry
from axisbus.drives.descriptions import descriptions
from axisbus.drives.gim6010 import make
from kit.can_simple import mixed_cell
from kit.cell import cell_file
from kit.pages import ROOT

SOURCE = ROOT / "src" / "axisbus"
FOLDER = SOURCE / "drives" / "gim6010"
WORDS = re.compile(r"gim6010|can_simple|\bMit[A-Z]|modbus", re.IGNORECASE)
EDS_OF_THE_PRODUCT = "builtin:gim6010-8"  # the file stays with the other EDS files


def test_only_its_folder_names_a_make_and_its_protocols() -> None:
    found = {
        path.relative_to(SOURCE).as_posix()
        for path in SOURCE.rglob("*.py")
        if FOLDER not in path.parents
        and WORDS.search(path.read_text(encoding="utf-8").replace(EDS_OF_THE_PRODUCT, ""))
    }
    assert found == set()


OPENING = """
import sys
import axisbus.core.process.rescue, axisbus.core.process.server, axisbus.core.process.session
import axisbus.core.process.simulated_drives
from axisbus import Machine
with Machine.simulated(sys.argv[1]) as machine:
    machine["x"].enable().wait()
print(*sorted(name for name in sys.modules if name.startswith("axisbus.drives.")))
"""


def modules_of_opening(path: Path) -> set[str]:
    """Return the modules of drive plug-ins that are loaded once a cell was opened and an axis was enabled."""
    done = subprocess.run(
        [sys.executable, "-c", OPENING, str(path)], capture_output=True, text=True, check=True
    )
    return {name for name in done.stdout.split() if name.startswith("axisbus.drives.gim6010")}


def test_opening_a_cell_of_canopen_drives_imports_no_plug_in_with_code(tmp_path: Path) -> None:
    path = cell_file(tmp_path, "xy")
    assert modules_of_opening(path) == set()


def test_opening_a_cell_with_a_drive_of_the_make_imports_its_facts_only() -> None:
    assert modules_of_opening(ROOT / "examples" / "cell.toml") == {
        "axisbus.drives.gim6010",
        "axisbus.drives.gim6010.faults",
        "axisbus.drives.gim6010.make",
    }


RESCUING = """
import sys, tempfile
from types import SimpleNamespace
from axisbus.core.process.rescue import CrashStop
memory = tempfile.TemporaryFile()
memory.truncate(1 << 16)
before = set(sys.modules)
CrashStop(SimpleNamespace(memory=memory.fileno(), axes=3, cell=sys.argv[1]))
print(*sorted(set(sys.modules) - before))
"""


@pytest.mark.skipif(
    sys.platform != "linux", reason="a core in a process of its own, which has a watchdog, is for Linux"
)
def test_a_watchdog_process_imports_what_stops_other_protocols_before_it_is_needed(tmp_path: Path) -> None:
    path = mixed_cell.write(tmp_path, 'interface = "sim"', 'quick_stop = "ramp"')
    done = subprocess.run(
        [sys.executable, "-c", RESCUING, str(path)], capture_output=True, text=True, check=True
    )
    assert "axisbus.drives.gim6010.core.part" in done.stdout.split()


def test_the_description_agrees_with_the_plug_in() -> None:
    (about,) = descriptions()
    assert about.vendor_id == make.GIM6010.vendor_id
    assert registry.load(f"{about.module}:PLUGIN") is make.GIM6010
    codes = [f"{module}:command" for module, _ in about.commands.values()]
    for code in (*codes, *about.extension.interfaces.values(), *about.extension.parts.values()):
        assert registry.load(code) is not None
