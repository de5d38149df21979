"""The nameplates of nodes: what is read from a node, the file beside the cell file, and what a comparison says."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import pytest

from axisbus.configuration.nameplate import Nameplate, as_json, as_markdown, changes, parse, read_nameplate
from axisbus.errors import ArgumentError
from axisbus.machine.machine_node import MachineNode
from axisbus.testing import simulate
from kit.cell import cell_text

X = Nameplate(1, "ACME", 0x123, 7, 0x10001, 4711, "servo", "A", "1.2", 15_430, 52_200_000, "x.eds", "ab" * 32)
Y = replace(X, node=2, serial=None, device_name="a | b")
WHEN = "2026-11-29 12:00:00+00:00"


def test_what_was_saved_is_read_again():
    assert parse(as_json([X, Y], "cell.toml", WHEN), "file") == (WHEN, [X, Y])


def test_the_table_for_people_has_the_known_values_only():
    text = as_markdown([X, Y], "cell.toml", WHEN)
    assert "| serial number (1018h:04) | 0x1267 (4711) |" in text
    assert text.count("serial number") == 1
    assert r"| device name (1008h) | a \| b |" in text


def test_a_comparison_names_each_changed_value_and_each_node_that_came_or_went():
    now = [replace(X, serial=4712, software_version=None), replace(Y, node=3)]
    assert [str(each) for each in changes([X, Y], now)] == [
        "node 1: serial number (1018h:04) was 0x1267 (4711), is 0x1268 (4712)",
        "node 1: software version (100Ah) was 1.2, is unknown",
        "node 2: it is missing",
        "node 3: it is new",
    ]
    assert changes([X, Y], [Y, X]) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("{", "file: not JSON"),
        ("[" * 100_000, "file: not JSON"),
        ("[]", "file: not a file of nameplates"),
        ('{"kind": "axisbus nameplates", "format": 2}', "file: its format 2 is not supported"),
        ('{"kind": "axisbus nameplates", "format": 1}', "file: it has no list of nodes"),
        (
            '{"kind": "axisbus nameplates", "format": 1, "nodes": [{}]}',
            "an entry of its nodes has no node-ID",
        ),
        (
            '{"kind": "axisbus nameplates", "format": 1, "nodes": [{"node": 1, "serial": "x"}]}',
            "file: serial of node 1 is 'x'",
        ),
    ],
)
def test_another_file_is_refused_with_the_reason(text: str, message: str):
    with pytest.raises(ArgumentError, match=message) as caught:
        parse(text, "file")
    assert "axisbus nameplate --save" in caught.value.remedy


def test_a_nameplate_is_read_from_a_node(tmp_path: Path):
    (tmp_path / "cell.toml").write_text(cell_text("x"), encoding="utf-8")
    with simulate(tmp_path / "cell.toml") as simulation:
        simulation.device("x").dictionary.set(0x1018 << 8 | 4, 4711)
        plate = read_nameplate(MachineNode(simulation.machine.node(1)), simulation.machine.cell)
    assert (plate.node, plate.serial, plate.file) == (1, 4711, "builtin:generic-cia402")
    assert plate.sha256 is not None
    assert len(bytes.fromhex(plate.sha256)) == 32
    assert json.loads(as_json([plate], "cell.toml", WHEN))["nodes"][0]["serial"] == 4711


def test_boot_reports_another_drive_and_another_firmware_as_changes_and_not_as_errors(tmp_path: Path):
    (tmp_path / "cell.toml").write_text(cell_text("xy"), encoding="utf-8")
    record = tmp_path / "cell.nameplate.json"
    with simulate(tmp_path / "cell.toml") as simulation:
        machine = simulation.machine
        assert [report.changed for report in machine.reports] == [(), ()]  # there is no record
        plates = [read_nameplate(MachineNode(machine.node(node)), machine.cell) for node in (1, 2)]
        record.write_text(as_json(plates, "cell.toml", WHEN), encoding="utf-8")
        assert machine.node(1).boot().changed == ()
        machine.simulated_node(1).swap(4712, software_version="2.0")
        machine.sleep(1.0)
        report = machine.node(1).boot()
        assert report.ok
        assert report.changed == (
            f"serial number (1018h:04) was 0x0 (0), is 0x1268 (4712) (nameplate saved {WHEN})",
            f"software version (100Ah) was unknown, is 2.0 (nameplate saved {WHEN})",
        )
        assert f"  changed       {report.changed[0]}\n" in report.text()
        assert report.as_json()["changed"] == list(report.changed)
        assert machine.node(2).boot().changed == ()
        record.write_text("{", encoding="utf-8")
        report = machine.node(1).boot()
        assert report.ok
        assert "it is not compared with its nameplate" in report.changed[0]
