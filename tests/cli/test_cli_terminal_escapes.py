"""Text from outside that reaches a terminal: names of devices, files and recordings only print, whatever they hold."""

from __future__ import annotations

import logging
import re

import pytest

from axisbus.wording import PrintableFormatter, printable
from kit import command_line

EVIL = "\x1b]0;PWNED\x07\x1b[31m\x9b31m\u202e"
ACTED_UPON = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e]")
CELL = """[bus]
interface = "sim"
bitrate = 1000000
scan_period = "10ms"
[nodes.1]
eds = "evil.eds"
[axes.x]
node = 1
unit = "deg"
scale = "131072/360"
max_velocity = 360.0
max_acceleration = 3600.0
"""


@pytest.fixture
def evil(tmp_path, monkeypatch):
    """A folder with an EDS whose names, and whose device's own name, would write a title and colours."""
    text = (command_line.ROOT / "eds" / "generic-cia402.eds").read_text("utf-8")
    for section, key in (("1008", "DefaultValue"), ("1008", "ParameterName"), ("6064", "ParameterName")):
        text = re.sub(rf"(\[{section}\][^\[]*?{key}=)[^\r\n]*", lambda found: found[1] + EVIL, text, count=1)
    text = re.sub(r"(ProductName=)[^\r\n]*", lambda found: found[1] + EVIL, text)
    (tmp_path / "evil.eds").write_text(text, "utf-8")
    (tmp_path / "cell.toml").write_text(CELL, "utf-8")
    (tmp_path / "run.log").write_text(
        "(1.0) can0 601#4064600000000000\n(1.1) can0\x1b[31m 701#05\nno\x1b]0;x\x07\n"
    )
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.mark.parametrize(
    "line",
    [
        "eds show evil.eds",
        "eds show evil.eds 6064",
        "eds check evil.eds",
        "eds check evil.eds --lines",
        "eds fix evil.eds",
        "eds diff evil.eds builtin:generic-cia402",
        "check cell.toml",
        "plan cell.toml",
        "scan cell.toml",
        "boot cell.toml",
        "od dump 1 --cell cell.toml",
        "od read 1 1008 --cell cell.toml",
        "trace run.log --eds 1=evil.eds",
        "eds show evil\x1b[31m.eds",
        "eds export evil.eds",
    ],
)
def test_no_control_character_of_a_name_reaches_the_terminal(axisbus, evil, line):
    _, out, err = axisbus(*line.split(" "))
    assert out + err
    assert ACTED_UPON.search(out + err) is None


def test_the_text_of_a_name_is_still_seen(axisbus, evil):
    assert "\\u001b]0;PWNED\\u0007" in axisbus("eds", "show", "evil.eds").out


def test_printable_text_is_unchanged_and_control_characters_are_json_escapes():
    assert printable("Größe 5 µm\t\n速度") == "Größe 5 µm\t\n速度"
    assert printable(EVIL) == r"\u001b]0;PWNED\u0007\u001b[31m\u009b31m\u202e"


def test_a_log_line_only_prints():
    record = logging.LogRecord("axisbus", logging.WARNING, "", 0, "node %s", (EVIL,), None)
    assert ACTED_UPON.search(PrintableFormatter().format(record)) is None
