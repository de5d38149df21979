"""What a drive plug-in adds beside facts: other protocols, found by their words, and imported only for a cell that names one."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from axisbus.cell import other_protocols, reader
from axisbus.check.run import check
from axisbus.drives import registry
from axisbus.drives.descriptions import descriptions
from axisbus.drives.gim6010 import make
from kit.can_simple import mixed_cell
from kit.cell import cell_text
from kit.pages import ROOT

SOURCE = ROOT / "src" / "axisbus"
FOLDER = SOURCE / "drives" / "gim6010"
WORDS = re.compile(r"gim6010|can_simple|\bMit[A-Z]|modbus", re.IGNORECASE)
EDS_OF_THE_PRODUCT = "builtin:gim6010-8"  # the file stays with the other EDS files
STILL_NAMED = {
    "symptoms/bus.py",
    "symptoms/drive.py",
    "symptoms/motion.py",
}  # what remains to be moved; it may only become shorter


def test_only_its_folder_names_a_make_and_its_protocols() -> None:
    found = {
        path.relative_to(SOURCE).as_posix()
        for path in SOURCE.rglob("*.py")
        if FOLDER not in path.parents
        and WORDS.search(path.read_text(encoding="utf-8").replace(EDS_OF_THE_PRODUCT, ""))
    }
    assert found == STILL_NAMED


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
    path = tmp_path / "cell.toml"
    path.write_text(cell_text("xy"), encoding="utf-8")
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


# -- a protocol of somebody else ---------------------------------------------------------------------------------------

CODE = """\
from dataclasses import dataclass

from axisbus.cell.other_protocols import CellPart
from axisbus.drives import DrivePlugin, Extension
from axisbus.errors import StateError
from axisbus.toml import value_readers
from axisbus.toml.tables import CellKey, SourceLocation


@dataclass(frozen=True)
class Settings:
    protocol: str
    colour: str = ""
    at: SourceLocation = SourceLocation()


def painted(case):
    for node in case.cell.nodes.values():
        if node.module is not None:
            yield case.warning(node.at.line, f"node {node.node_id} is painted {node.module.colour}", "", "look")


PART = CellPart(
    keys={"colour": CellKey(value_readers.text, 'colour = "red"')},
    descriptions={"colour": "Its colour."},
    tables={"paint": "A painted node."},
    settings=lambda protocol, fields: Settings(protocol, **fields),
    dictionaries=lambda cell: {},
    parameters=lambda cell, name: None,
    frames=lambda cell: iter(()),
    sent_by=lambda node_id: frozenset(),
    commands_to=lambda node_id: frozenset(),
    adapter_options=lambda cell: {},
    no_objects=lambda node_id, why: StateError(f"node {node_id} is painted: {why}"),
    no_virtual_time=lambda cell: StateError("paint dries in real time"),
)
CHECKS = (painted,)


SERVO = DrivePlugin(
    name="Painted servo",
    extension=Extension(
        protocols={"paint": "Paint"},
        parts={"cell": "painted_drives:PART", "check": "painted_drives:CHECKS"},
    ),
)
"""
NODE = '[nodes.9]\nprotocol = "paint"\n[nodes.9.paint]\n'


@pytest.fixture
def cell(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    """Install a package with the plug-in, as pip would leave it, and return the path of a cell file with such a node."""
    site = tmp_path / "site-packages"
    info = site / "painted_drives-1.0.dist-info"
    info.mkdir(parents=True)
    (site / "painted_drives.py").write_text(CODE, encoding="utf-8")
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: painted_drives\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text("[axisbus.drives]\nservo = painted_drives:SERVO\n")
    monkeypatch.syspath_prepend(site)
    registry.installed.cache_clear()
    path = tmp_path / "cell.toml"
    path.write_text(f'{cell_text()}\n{NODE}colour = "red"\n', encoding="utf-8")
    yield path
    registry.installed.cache_clear()
    sys.modules.pop("painted_drives", None)


def test_a_package_adds_a_protocol_with_its_table_and_its_checks(cell: Path) -> None:
    found = reader.load(cell)
    settings = found.nodes[9].module
    assert settings is not None
    assert (settings.protocol, vars(settings)["colour"]) == ("paint", "red")
    assert (other_protocols.canopen_nodes(found), other_protocols.other_nodes(found)) == ([1], [9])
    assert "node 9 is painted red" in {each.message for each in check(cell)}


def test_the_key_of_a_protocol_of_a_package_is_read_with_its_line(cell: Path) -> None:
    text = cell.read_text(encoding="utf-8").replace('colour = "red"', "color = 5")
    cell.write_text(text, encoding="utf-8")
    found = {each.message: each.remedy for each in check(cell)}
    assert found["unknown key 'color' in [nodes.9.paint]"] == "did you mean colour?"
    assert found["colour is missing in [nodes.9.paint]"] == 'add colour = "red"'


def test_a_node_of_another_protocol_refuses_objects_by_its_own_words(cell: Path) -> None:
    found = reader.load(cell)
    assert other_protocols.objects_refused(found, 1) is None
    with pytest.raises(other_protocols.StateError, match="node 9 is painted: it has no object dictionary"):
        other_protocols.require_objects(found, 9)
    with pytest.raises(other_protocols.StateError, match="paint dries in real time"):
        other_protocols.require_virtual_time(found)


def test_an_unknown_protocol_names_those_of_all_plug_ins(cell: Path) -> None:
    text = cell.read_text(encoding="utf-8").replace('protocol = "paint"', 'protocol = "pain"')
    cell.write_text(text, encoding="utf-8")
    (found,) = [each for each in check(cell) if "protocol in [nodes.9]" in each.message]
    assert 'expected one of "canopen", "paint", "can_simple", "modbus"' in found.observed
    assert found.remedy.startswith('did you mean "paint"?')
