"""What a drive plug-in adds beside facts: other protocols, found by their words, and imported only for a cell that names one."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from axisbus.cell import other_protocols, reader
from axisbus.check.run import check
from axisbus.drives import registry
from kit.cell import cell_text

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
    assert 'expected one of "canopen", "paint"' in found.observed
    assert found.remedy.startswith('did you mean "paint"?')
