"""``axisbus eds show``, ``diff``, ``doc``, ``export`` and ``code`` as their user types them: output, files and exit codes."""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest

from axisbus.eds.builtin import resolve
from kit.command_line import Run

DRIVE = "builtin:gim6010-8"


@pytest.fixture
def eds(axisbus: Run) -> Run:
    return partial(axisbus, "eds")


def edited(folder: Path, old: str, new: str) -> Path:
    """Return a copy of the built-in drive with one line changed."""
    text = resolve(DRIVE, Path()).read_text()
    assert text.count(old) >= 1
    path = folder / "edited.eds"
    path.write_text(text.replace(old, new, 1))
    return path


def test_show_prints_the_tree(eds: Run) -> None:
    code, out, _ = eds("show", DRIVE, "--node", 5)
    assert code == 0
    assert "TPDO1  185h ($NODEID+0x180), on change (type 255)" in out
    assert "Device profile CiA 402: " in out


def test_show_of_one_object_several_and_a_pdo(eds: Run) -> None:
    assert "operation enabled" in eds("show", DRIVE, "6041").out
    several = eds("show", DRIVE, "torque").out
    assert {"6071", "6077", "6087"} <= {line.split()[0] for line in several.splitlines()}
    assert eds("show", DRIVE, "rpdo2").out.startswith("RPDO2  $NODEID+0x300")


def test_show_as_json(eds: Run) -> None:
    whole = json.loads(eds("show", DRIVE, "--json", "--node", 3).out)
    assert whole["node_id"] == 3
    assert whole["device"]["vendor_id"] == 0xC0B00
    assert [pdo["cob_id"] for pdo in whole["pdos"]][4:6] == [0x183, 0x283]
    (entry,) = json.loads(eds("show", DRIVE, "1018:1", "--json").out)["entries"]
    assert (entry["index"], entry["subindex"], entry["default"]) == (0x1018, 1, 0xC0B00)
    assert [pdo["name"] for pdo in json.loads(eds("show", DRIVE, "tpdo1", "--json").out)["pdos"]] == ["TPDO1"]


@pytest.mark.parametrize("wanted", ["nonsense", "5FFF", "tpdo9", "1018:9"])
def test_show_of_a_missing_object_ends_with_1(eds: Run, wanted: str) -> None:
    code, out, err = eds("show", DRIVE, wanted)
    assert (code, out) == (1, "")
    assert "there is no" in err
    assert "remedy" in err


def test_show_fits_the_columns_it_is_given(eds: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("COLUMNS", "70")
    rows = [
        line for line in eds("show", DRIVE).out.splitlines() if line.startswith(("  ├", "  └", "  ┌", "  │"))
    ]
    assert max(map(len, rows)) <= 70


def test_a_terminal_without_boxes_gets_ascii() -> None:
    command = [sys.executable, "-m", "axisbus", "eds", "show", DRIVE, "tpdo1"]
    env = {"PYTHONIOENCODING": "ascii", "PYTHONPATH": ":".join(sys.path), "PATH": ""}
    ran = subprocess.run(command, capture_output=True, check=True, env=env)
    assert b"|6041" in ran.stdout
    assert ran.stdout.isascii()


def test_diff_of_equal_files_ends_with_0(eds: Run) -> None:
    code, out, _ = eds("diff", DRIVE, DRIVE)
    assert code == 0
    assert "no difference in meaning" in out


def test_diff_of_two_versions_ends_with_1_and_lists_important_changes(eds: Run, tmp_path: Path) -> None:
    other = edited(tmp_path, "DefaultValue=0x00000761", "DefaultValue=0x00000760")
    code, out, _ = eds("diff", DRIVE, other)
    assert code == 1
    assert "Important for a master: 2" in out
    assert "modes no longer claimed (6502h): pp -> -" in out
    report = json.loads(eds("diff", DRIVE, other, "--json").out)
    assert report["different"] is True
    assert report["counts"]["identity"] == 2
    assert {each["index"] for each in report["differences"]} == {None, 0x6502}


def test_diff_of_a_file_that_is_not_there_ends_with_2(eds: Run, tmp_path: Path) -> None:
    code, out, err = eds("diff", DRIVE, tmp_path / "none.eds")
    assert (code, out) == (2, "")
    assert "does not exist" in err


@pytest.mark.parametrize(
    ("name", "start"), [("x.html", "<!doctype html>"), ("x.md", "# GIM6010-8 by CyberBeast")]
)
def test_doc_writes_a_reference(eds: Run, tmp_path: Path, name: str, start: str) -> None:
    code, out, _ = eds("doc", DRIVE, "-o", tmp_path / "new" / name)
    assert code == 0
    assert "89 objects, 236 entries" in out
    assert "next: " in out
    assert (tmp_path / "new" / name).read_text(encoding="utf-8").startswith(start)


def test_doc_without_a_name_takes_that_of_the_file(
    eds: Run, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    assert eds("doc", DRIVE).code == 0
    assert (tmp_path / "gim6010-8.html").is_file()


def test_doc_in_an_unknown_format_writes_nothing(eds: Run, tmp_path: Path) -> None:
    code, _, err = eds("doc", DRIVE, "-o", tmp_path / "x.pdf")
    assert code == 2
    assert ".html or .md" in err
    assert list(tmp_path.iterdir()) == []


def test_export_to_standard_output_is_nothing_but_the_file(eds: Run) -> None:
    assert eds("export", DRIVE, "--csv").out.startswith("index,subindex,name,")
    assert len(json.loads(eds("export", DRIVE, "--json").out)["entries"]) == 236
    code, out, err = eds("export", DRIVE, "--dbc", "--node", 5)
    assert code == 0
    assert out.startswith('VERSION ""')
    assert "left out: RPDO3: switched off" in err


def test_export_takes_the_format_from_the_name(eds: Run, tmp_path: Path) -> None:
    for name, start in (("x.csv", "index,"), ("x.json", "{"), ("x.dbc", "VERSION")):
        assert eds("export", DRIVE, "-o", tmp_path / name, "--node", 5).code == 0
        assert (tmp_path / name).read_text(encoding="utf-8").startswith(start)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ((), "no format is given"),
        (("--dbc",), "depend on the node ID"),
        (("-o", "x.xlsx"), "no format is given"),
    ],
)
def test_export_that_is_not_clear_ends_with_2(eds: Run, arguments: tuple[str, ...], text: str) -> None:
    code, out, err = eds("export", DRIVE, *arguments)
    assert (code, out) == (2, "")
    assert text in err


def test_code_writes_a_module(eds: Run, tmp_path: Path) -> None:
    code, out, _ = eds("code", DRIVE, "-o", tmp_path / "drive.py")
    assert code == 0
    assert "next: in Python: from drive import" in out
    ast.parse((tmp_path / "drive.py").read_text())
    assert (tmp_path / "drive.py").read_text() == eds("code", DRIVE).out


@pytest.mark.parametrize("name", ["my-drive.py", "class.py", "drive.txt"])
def test_code_refuses_a_name_that_cannot_be_imported(eds: Run, tmp_path: Path, name: str) -> None:
    code, _, err = eds("code", DRIVE, "-o", tmp_path / name)
    assert code == 2
    assert "not the name of a Python module" in err


@pytest.mark.parametrize("command", ["show", "doc", "code"])
def test_a_file_that_is_no_eds_is_one_clear_error(eds: Run, tmp_path: Path, command: str) -> None:
    picture = tmp_path / "x.eds"
    picture.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    code, out, err = eds(command, picture)
    assert (code, out) == (1, "")
    assert "a PNG picture" in err


def test_an_output_that_cannot_be_written_leaves_nothing_behind(eds: Run, tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    code, _, err = eds("doc", DRIVE, "-o", tmp_path / "file" / "x.html")
    assert code == 1
    assert "cannot be written" in err
    assert [path.name for path in tmp_path.iterdir()] == ["file"]


def test_show_and_diff_of_a_large_drive_start_and_end_within_half_a_second(tmp_path: Path) -> None:
    """A file of 130 kB made of one object's section many times; the processor time of the best of several runs."""
    resource = pytest.importorskip("resource", reason="Windows counts no processor time of children")
    text = resolve(DRIVE, Path()).read_text()
    section = "[{0:04X}]\nParameterName=Thing {0}\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nDefaultValue={0}\n\n"
    large = tmp_path / "large.eds"
    large.write_text(text + "".join(section.format(index) for index in range(0x3000, 0x3400)))
    assert large.stat().st_size > 130_000

    def seconds(*arguments: str) -> float:
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run([sys.executable, *arguments], check=True, capture_output=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime

    for words in (["show", str(large)], ["diff", str(large), str(large)]):
        assert min(seconds("-m", "axisbus", "eds", *words) for _ in range(5)) < 0.5
