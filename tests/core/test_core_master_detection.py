"""The expected devices on a cell's bus before its first frame, according to the cell file and the EDS files."""

from __future__ import annotations

from pathlib import Path

from axisbus.cell import reader
from axisbus.cell.model import CellConfig
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.master_detection import Sign, sign_of
from axisbus.core.files import load_dictionaries
from axisbus.core.master_detection import expected_masters_of
from kit.cell import cell_text


def cell_of(folder: Path, names: str = "xy", bus: str = "", more: str = "") -> CellConfig:
    cell, _ = reader.loads(cell_text(names, bus=bus, more=more), str(folder / "cell.toml"))
    assert cell is not None
    return cell


def test_masters_are_127_and_our_own_id(tmp_path: Path) -> None:
    cell = cell_of(tmp_path, bus="master_id = 9")
    assert expected_masters_of(cell, load_dictionaries(cell)).masters == {9, 127}


def test_a_configured_device_that_sends_with_the_cob_id_of_an_rpdo_is_no_master(tmp_path: Path) -> None:
    more = "[nodes.2.pdo.tpdo1]\ncob_id = 0x201\n"
    with_it, without = cell_of(tmp_path, more=more), cell_of(tmp_path)
    frame = CanFrame(0.0, 0x201, b"\x0f\0")
    assert sign_of(frame, expected_masters_of(without, load_dictionaries(without))) == (Sign.RPDO, 1)
    assert sign_of(frame, expected_masters_of(with_it, load_dictionaries(with_it))) is None


def test_sync_is_a_sign_at_the_usual_cob_id_and_at_the_cells(tmp_path: Path) -> None:
    found = {}
    for bus in (
        "",
        "sync_cob_id = 0x90",
        'sync_producer = "external"',
        'sync_cob_id = 0x90\nsync_producer = "external"',
    ):
        cell = cell_of(tmp_path, bus=bus)
        found[bus.replace("\n", ", ")] = set(expected_masters_of(cell, load_dictionaries(cell)).syncs)
    assert list(found.values()) == [{0x80}, {0x80, 0x90}, set(), {0x80}]
