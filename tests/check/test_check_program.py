"""The program table of a node in a cell file, and the findings about it before the first frame."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus.cell import reader
from axisbus.cell.program_file import wanted_program
from axisbus.errors import ConfigError
from kit import cells
from kit.eds.loader import with_loader

HEAD = "[nodes.2]\n"
DATE = "date_time = 2026-03-01T12:00:00\n"


def cell(folder: Path, lines: str, *without: int, data: bytes | None = b"12345678") -> Path:
    """The clean cell, whose drives have a boot loader, with a program for node 1."""
    if data is not None:
        (folder / "firmware.bin").write_bytes(data)
    changes = (HEAD, f"[nodes.1.program]\n{lines}{HEAD}")
    return cells.write(folder, changes, eds=lambda text: with_loader(text, *without))


def node(lines: str):
    text = (
        f"[bus]\ninterface = 'sim'\nscan_period = '4ms'\n[nodes.1]\neds = 'x.eds'\n[nodes.1.program]\n{lines}"
    )
    made, problems = reader.loads(text)
    return made, [each for each in problems if "no axis" not in each.message]


def test_all_keys_of_the_program_table_are_read():
    """By hand: 2026-03-01 is day 15400 after 1984-01-01, 12:00:00.250 is 43200250 ms after midnight."""
    made, problems = node(
        "date_time = 2026-03-01T12:00:00.250\nfile = 'a/b.bin'\ndownload = true\ndeadline = '2min'\n"
    )
    assert problems == []
    program = made.nodes[1].program
    assert program.date_time == (15_400, 43_200_250)
    assert (program.file, program.download, program.deadline) == ("a/b.bin", True, 120.0)


def test_only_the_date_is_needed_and_nothing_is_replaced_without_a_word():
    made, problems = node(DATE)
    assert problems == []
    program = made.nodes[1].program
    assert (program.file, program.download, program.deadline) == (None, False, None)
    wanted = wanted_program(made, made.nodes[1])
    assert (wanted.mark.version, wanted.data, wanted.allowed) == ((15_400, 43_200_000), None, False)


def test_a_program_may_be_identified_by_its_identification():
    made, problems = node("identification = 0xCAFE\n")
    assert problems == []
    assert wanted_program(made, made.nodes[1]).mark == (None, 0xCAFE)


def test_a_node_without_the_table_has_no_expected_program():
    made, _ = reader.loads("[bus]\ninterface = 'sim'\nscan_period = '4ms'\n[nodes.1]\neds = 'x.eds'\n")
    assert made.nodes[1].program is None
    assert wanted_program(made, made.nodes[1]) is None


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ("file = 'x.bin'\n", "add date_time = 2026-03-31T14:30:00"),
        ("date_time = '2026-03-01T12:00:00'\n", "a date with a time such as 2026-03-31T14:30:00"),
        ("date_time = 2026-03-01\n", "a date with a time such as"),
        ("date_time = 12:00:00\n", "a date with a time such as"),
        ("date_time = 2026-03-01T12:00:00Z\n", "without a time zone"),
        ("date_time = 2026-03-01T12:00:00+01:00\n", "leave Z or the offset out"),
        ("date_time = 1983-12-31T12:00:00\n", "from 1984-01-01 to 2163-06-06"),
        ("identification = '0x17'\n", "a whole number from 0 to 4294967295"),
        (DATE + "download = 'yes'\n", "true or false"),
        (DATE + "deadline = 60\n", 'add the unit: "60s"'),
        (DATE + "deadline = '10ms'\n", 'from "1s" to "60min"'),
        (DATE + "fiel = 'x.bin'\n", "did you mean file?"),
    ],
)
def test_invalid_values_are_errors(lines, words):
    _, problems = node(lines)
    assert len(problems) == 1
    assert words in str(problems[0])


def test_an_object_key_in_the_table_of_the_node_is_written_to_that_node():
    _, problems = reader.loads(
        "[bus]\ninterface = 'sim'\nscan_period = '4ms'\n[nodes.1]\neds = 'x.eds'\ndownload = true\n"
    )
    assert any("it belongs in [nodes.1.program]" in each.remedy for each in problems)


# -- the file --------------------------------------------------------------------------------------------------------------


def test_a_sound_program_is_noted_with_its_size_and_how_long_it_may_take(tmp_path):
    path = cell(tmp_path, DATE + "file = 'firmware.bin'\ndownload = true\n", data=bytes(900_000))
    assert cells.serious(path) == []
    noted = cells.note(path, "boot replaces its program")
    assert noted.line == cells.line_of(path, "download = true")
    assert noted.observed == "900000 bytes; each part of it may take 90 s (no deadline is given: by the size)"


def test_a_small_program_may_also_take_a_minute(tmp_path):
    path = cell(tmp_path, DATE + "file = 'firmware.bin'\ndownload = true\n")
    assert "may take 60 s (no deadline" in cells.note(path, "boot replaces its program").observed


def test_a_deadline_that_is_given_holds(tmp_path):
    path = cell(tmp_path, DATE + "file = 'firmware.bin'\ndownload = true\ndeadline = '5s'\n")
    assert cells.note(path, "boot replaces").observed == "8 bytes; each part of it may take 5 s"


@pytest.mark.parametrize("download", ["true", "false"])
def test_a_file_that_is_not_there(tmp_path, download):
    path = cell(tmp_path, DATE + f"file = 'firmware.bin'\ndownload = {download}\n", data=None)
    problem = cells.only(path, "error", "firmware.bin")
    assert problem.message == "node 1: the program 'firmware.bin' cannot be read"
    assert problem.observed == f"{tmp_path / 'firmware.bin'} does not exist"


def test_a_file_that_is_a_folder(tmp_path):
    (tmp_path / "firmware.bin").mkdir()
    path = cell(tmp_path, DATE + "file = 'firmware.bin'\ndownload = true\n", data=None)
    assert "is a folder" in cells.only(path, "error", "firmware.bin").observed


def test_a_file_that_is_empty(tmp_path):
    path = cell(tmp_path, DATE + "file = 'firmware.bin'\ndownload = true\n", data=b"")
    assert cells.only(path, "error", "firmware.bin").message == "node 1: the program 'firmware.bin' is empty"


def test_a_download_without_a_file(tmp_path):
    path = cell(tmp_path, DATE + "download = true\n")
    assert "no file is given" in cells.only(path, "error", "download = true").message


def test_a_file_that_is_never_used_is_noted(tmp_path):
    path = cell(tmp_path, DATE + "file = 'firmware.bin'\n")
    assert cells.serious(path) == []
    assert "never replaced" in cells.note(path, "the file of its program is not used").observed


def test_a_file_that_vanishes_between_check_and_boot_is_reported_with_its_line(tmp_path):
    path = cell(tmp_path, DATE + "file = 'firmware.bin'\ndownload = true\n")
    made = reader.load(path)
    (tmp_path / "firmware.bin").unlink()
    with pytest.raises(ConfigError) as caught:
        wanted_program(made, made.nodes[1])
    assert caught.value.line == cells.line_of(path, "firmware.bin")


# -- the device ------------------------------------------------------------------------------------------------------------


def test_a_drive_that_does_not_report_its_program(tmp_path):
    problem = cells.only(cell(tmp_path, DATE, 0x1F52), "warning", "[nodes.1.program]")
    assert "1F52h:01, 1F52h:02" in problem.observed
    assert "letter G" in problem.remedy


def test_a_drive_that_has_no_identification_of_its_program(tmp_path):
    problem = cells.only(cell(tmp_path, "identification = 17\n", 0x1F56), "warning", "[nodes.1.program]")
    assert "lacks 1F56h:01" in problem.observed
    assert cells.serious(cell(tmp_path, "identification = 17\n", 0x1F52)) == []


def test_a_download_to_a_drive_without_the_objects_is_a_warning(tmp_path):
    path = cell(tmp_path, DATE + "file = 'firmware.bin'\ndownload = true\n", 0x1F50)
    problem = cells.only(path, "warning", "download = true")
    assert "lacks 1F50h:01" in problem.observed


def test_a_drive_that_is_only_checked_needs_no_loader(tmp_path):
    assert cells.serious(cell(tmp_path, DATE, 0x1F50, 0x1F51, 0x1F56, 0x1F57)) == []
