"""``axisbus report``: the contents of the archive, the replaced names and numbers, and refused files."""

from __future__ import annotations

import getpass
import json
import socket
import zipfile
from pathlib import Path

import pytest

from axisbus.core.process.launch import path_of
from axisbus.core.process.persistence import journal
from axisbus.version import __version__
from kit import command_line

CELL = """
[bus]
interface = "sim"
scan_period = "4ms"
[nodes.1]
eds = "own.eds"
serial = 4711     # of the machine in hall 3
[nodes.2]
eds = "builtin:generic-cia402"
[axes.x]
node = 1
unit = "deg"
scale = "131072/360"
"""


@pytest.fixture
def cell(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    monkeypatch.setattr(getpass, "getuser", lambda: "wanda")
    monkeypatch.setattr(socket, "gethostname", lambda: "press-7.works.example")
    monkeypatch.setattr(Path, "home", lambda: Path("/home/wanda"))
    (tmp_path / "own.eds").write_bytes((command_line.ROOT / "eds" / "generic-cia402.eds").read_bytes())
    file = tmp_path / "cell.toml"
    file.write_text(CELL)
    return file


def contents(archive: Path) -> dict[str, bytes]:
    with zipfile.ZipFile(archive) as packed:
        return {name: packed.read(name) for name in packed.namelist()}


def test_the_archive_has_the_cell_its_findings_and_files_the_stored_faults_and_the_given_files(
    axisbus, cell, tmp_path
):
    log = journal.path_of(path_of_cell(cell))
    faults = log.with_suffix(".faults")
    faults.mkdir(parents=True)
    log.write_text("2026-01-01 INFO opened by wanda\n")
    for number in range(5):
        (faults / f"{number}.fault").write_bytes(b"\0recording" + bytes([number]))
    (tmp_path / "candump.log").write_text("(1.0) can0 701#05\n")
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "candump.log").write_text("(2.0) can0 701#05\n")
    given = (tmp_path / "candump.log", tmp_path / "other" / "candump.log")
    ran = axisbus("report", cell, *given, "-o", tmp_path / "report.zip", "--yes")
    assert ran.code == 0, ran.err
    found = contents(tmp_path / "report.zip")
    assert set(found) == {
        *("versions.json", "cell.toml", "check.txt", "journal.log", "eds/own.eds"),
        *(f"faults/{number}.fault" for number in (2, 3, 4)),
        *("files/candump.log", "files/candump-2.log"),
    }
    assert all(name in ran.out for name in found)
    versions = json.loads(found["versions.json"])
    assert versions["axisbus"] == __version__
    assert versions["packages"]["canopen"]
    assert found["faults/4.fault"] == b"\0recording\4"
    assert b"deg" in found["check.txt"] or b"note" in found["check.txt"]


def path_of_cell(cell: Path) -> str:
    from axisbus.cell import reader

    return path_of(reader.load(cell))


def test_names_and_serial_numbers_are_replaced_and_the_texts_stay_readable(axisbus, cell, tmp_path):
    notes = tmp_path / "notes.txt"
    notes.write_text(
        "Wanda at press-7.works.example and PRESS-7: /home/wanda/cells/press.toml; wandaring stays\n"
        "[1018sub4]\nParameterName=Serial number\nDefaultValue=0x1267\n[1018sub3]\nDefaultValue=7\n"
        "[DeviceComissioning]\nLSS_SerialNumber=4711\n"
    )
    assert axisbus("report", cell, notes, "-o", tmp_path / "r.zip", "--yes").code == 0
    found = contents(tmp_path / "r.zip")
    assert found["files/notes.txt"].decode() == (
        "USER at HOST and HOST: ~/cells/press.toml; wandaring stays\n"
        "[1018sub4]\nParameterName=Serial number\nDefaultValue=0\n[1018sub3]\nDefaultValue=7\n"
        "[DeviceComissioning]\nLSS_SerialNumber=0\n"
    )
    text = found["cell.toml"].decode()
    assert "4711" not in text
    assert "serial = 0" in text
    assert "# of the machine in hall 3" in text
    assert b"wanda" not in found["check.txt"].lower()


def test_nothing_is_written_before_the_contents_were_shown_and_confirmed(axisbus, cell, tmp_path):
    ran = axisbus("report", cell, "-o", tmp_path / "r.zip", stdin="n\n")
    assert ran.code == 0
    assert "cell.toml" in ran.out
    assert "nothing was written" in ran.out
    assert not (tmp_path / "r.zip").exists()
    assert axisbus("report", cell, "-o", tmp_path / "r.zip", stdin="y\n").code == 0
    ran = axisbus("report", cell, "-o", tmp_path / "r.zip", "--yes")
    assert ran.code != 0
    assert "already exists" in ran.err


def test_a_faulty_cell_is_reported_as_far_as_it_is_known_and_makers_files_may_be_left_out(
    axisbus, cell, tmp_path
):
    assert axisbus("report", cell, "-o", tmp_path / "a.zip", "--yes", "--without-eds").code == 0
    assert "eds/own.eds" not in contents(tmp_path / "a.zip")
    cell.write_text("[bus\n")
    assert axisbus("report", cell, "-o", tmp_path / "b.zip", "--yes").code == 0
    found = contents(tmp_path / "b.zip")
    assert set(found) == {"versions.json", "cell.toml", "check.txt"}
    assert b"error" in found["check.txt"]


def test_a_file_that_cannot_be_read_or_is_too_large_is_named_and_nothing_is_written(axisbus, cell, tmp_path):
    large = tmp_path / "large.mcap"
    with large.open("wb") as file:
        file.truncate(17 * 1024 * 1024)
    for path, text in ((tmp_path / "no.log", "cannot be read"), (large, "larger than 16 MB")):
        ran = axisbus("report", cell, path, "-o", tmp_path / "r.zip", "--yes")
        assert ran.code != 0
        assert f"{path} " in ran.err
        assert text in ran.err
        assert not (tmp_path / "r.zip").exists()
