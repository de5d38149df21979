"""``-i sim -c CELL`` is a bus with a simulated drive for each node of a cell file, for every command that takes a bus."""

from __future__ import annotations

import json

import pytest

from axisbus.cell import reader
from kit import cells, command_line

SIM = ("-i", "sim", "-c", command_line.CELL)


def test_scan_finds_the_nodes_of_the_cell(axisbus):
    code, out, _ = axisbus("scan", *SIM)
    assert code == 0
    assert out.count("servo drive (CiA 402)") == 3
    assert f"next: a first cell file of them: axisbus init -i sim -c {command_line.CELL} -o cell.toml" in out


def test_scan_of_a_cell_file_names_the_next_command(axisbus):
    assert f"next: axisbus boot {command_line.CELL}" in axisbus("scan", command_line.CELL).out


def test_a_cell_that_names_an_adapter_is_simulated_too(axisbus, tmp_path):
    path = tmp_path / "cell.toml"
    text = cells.CLEAN
    path.write_text(text.replace('"drive.eds"', '"builtin:generic-cia402"'), encoding="utf-8")
    code, out, _ = axisbus("scan", "-i", "sim", "-c", path, "--json")
    assert code == 0
    assert [each["node_id"] for each in json.loads(out)] == [1, 2]


def test_the_cell_file_that_init_makes_of_it_can_be_booted(axisbus, tmp_path):
    made = tmp_path / "cell.toml"
    code, out, _ = axisbus("init", *SIM, "--output", made)
    assert code == 0
    assert "MISSING" not in out
    assert reader.load(made).bus.interface == "sim"
    code, out, _ = axisbus("boot", made)
    assert code == 0
    assert "3 of 3 nodes came up" in out


def test_objects_and_frames_of_it_are_read(axisbus):
    code, out, _ = axisbus("od", "read", *SIM, "2", "6041")
    assert code == 0
    assert "6041h" in out
    code, out, _ = axisbus("trace", *SIM, "--seconds", "0.2")
    assert code == 0
    assert out.count("boot-up") >= 3


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (("scan", "-i", "sim"), 2, "give it with -c"),
        (("trace", "-i", "sim", "--seconds", "1"), 2, "give it with -c"),
        (("scan", *SIM, "-O", "fd=true"), 2, "leave -O out"),
        (("scan", "-i", "sim", "-c", "nowhere.toml"), 1, "nowhere.toml: the file does not exist"),
    ],
)
def test_without_a_cell_it_is_refused(axisbus, arguments, code, words):
    result = axisbus(*arguments)
    assert result.code == code
    assert words in result.err
