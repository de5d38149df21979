"""The output of ``axisbus check``, its order, and its form on a terminal."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from axisbus.cell.json_schema import schema_of_cells
from axisbus.units import AXIS_UNITS
from kit import command_line

if sys.platform != "win32":
    import pty

CLEAN = Path(command_line.CELL).read_text(encoding="utf-8")


def cell(folder: Path, *changes: tuple[str, str]) -> Path:
    text = CLEAN
    for old, new in changes:
        assert old in text
        text = text.replace(old, new, 1)
    path = folder / "cell.toml"
    path.write_text(text, encoding="utf-8")
    return path


def findings(out: str, path: Path) -> list[str]:
    """The severities of the findings, in their order."""
    return [
        line.split(": ")[1]
        for line in out.splitlines()
        if line.startswith(f"{path}:") and line.count(": ") > 1
    ]


FAULTY = (("scan_period", "scan_perod"), ('unit = "deg"', 'unit = "banana"'), ('quick_stop = "ramp"\n', ""))


def test_errors_are_printed_last(axisbus, tmp_path):
    path = cell(tmp_path, *FAULTY)
    code, out, _ = axisbus("check", path)
    shown = [each for each in findings(out, path) if each in ("note", "warning", "error")]
    assert code == 1
    assert set(shown) == {"note", "warning", "error"}
    assert shown == sorted(shown, key=["note", "warning", "error"].index)
    assert "\x1b" not in out


def test_errors_only_shows_nothing_else_and_counts_all(axisbus, tmp_path):
    path = cell(tmp_path, *FAULTY)
    code, out, _ = axisbus("check", path, "--errors-only")
    assert code == 1
    assert ": warning: " not in out
    assert ": note: " not in out
    assert out.count(": error: ") == 3
    assert f"{path}: 3 errors, " in out
    as_json = json.loads(axisbus("check", path, "--errors-only", "--json").out)
    assert {each["severity"] for each in as_json["findings"]} == {"error"}
    assert as_json["ok"] is False


def test_the_pages_of_errors_are_named_once_each(axisbus, tmp_path):
    gone = ('"builtin:gim6010-8"', '"gone.eds"')
    path = cell(tmp_path, gone, ('unit = "deg"', 'unit = "furlong"'), ("heartbeat =", "hartbeat ="))
    out = axisbus("check", path).out
    assert out.endswith(
        f"  more:     axisbus explain cell-file\n  more:     axisbus explain eds\n"
        f"next: fix the errors and check again: axisbus check {path}\n"
    )
    found = json.loads(axisbus("check", path, "--json").out)["findings"]
    assert {each["page"] for each in found if each["severity"] == "error"} == {"cell-file", "eds"}
    assert "more:" not in axisbus("check", command_line.CELL).out


def test_errors_only_of_a_sound_cell_is_quiet(axisbus):
    code, out, _ = axisbus("check", command_line.CELL, "--errors-only")
    assert code == 0
    assert out.splitlines()[0].startswith(f"{command_line.CELL}: 0 errors")


def test_an_unknown_unit_is_refused_with_the_list(axisbus, tmp_path):
    code, out, _ = axisbus("check", cell(tmp_path, ('unit = "deg"', 'unit = "banana"')))
    assert code == 1
    assert "unit in [axes.x] cannot be used" in out
    assert f"expected one of {', '.join(AXIS_UNITS)}" in out
    _, near, _ = axisbus("check", cell(tmp_path, ('unit = "deg"', 'unit = "Degs"')))
    assert 'did you mean "deg"?' in near


@pytest.mark.parametrize("unit", AXIS_UNITS)
def test_each_unit_of_the_list_is_taken(axisbus, tmp_path, unit):
    code, _, _ = axisbus("check", cell(tmp_path, ('unit = "deg"', f'unit = "{unit}"')))
    assert code == 0


ENCODER = '[nodes.1.objects]\n"608F:01" = 16384\n"608F:02" = 1\n"6091:01" = 8\n"6091:02" = 1\n[nodes.2]'


@pytest.mark.parametrize(
    ("scale", "warned"),
    [
        ('"131072/360"', False),
        ('"16384/360"', False),
        ('"8192/360"', True),
        ("1000", True),
        ("364.0889", False),
    ],
)
def test_a_scale_that_disagrees_with_the_drives_objects_is_reported(axisbus, tmp_path, scale, warned):
    path = cell(tmp_path, ('scale = "131072/360"', f"scale = {scale}"), ("[nodes.2]", ENCODER))
    code, out, _ = axisbus("check", path)
    assert code == 0
    assert ("warning: the scale of axis x differs from the objects of its drive" in out) is warned
    if warned:
        assert "the drive's objects suggest 364.089 (at the gear's output), 45.5111 (at the motor)" in out


def test_an_encoder_of_one_increment_gives_no_warning(axisbus, tmp_path):
    path = cell(tmp_path, ("[nodes.2]", ENCODER.replace("16384", "1")))
    assert "objects suggest" not in axisbus("check", path).out


def test_the_schema_is_printed_without_a_cell(axisbus):
    code, out, _ = axisbus("check", "--schema")
    assert code == 0
    assert json.loads(out) == schema_of_cells()


def test_neither_cell_nor_schema_is_misuse(axisbus):
    code, _, err = axisbus("check")
    assert code == 2
    assert "give a cell file, or --schema" in err


# -- on a terminal --------------------------------------------------------------------------------------------------------------


def on_terminal(*arguments: object, **environment: str) -> str:
    """Run the command line with a terminal as its output, and return its output."""
    ours, theirs = pty.openpty()
    base = {key: value for key, value in os.environ.items() if key not in ("NO_COLOR", "FORCE_COLOR")}
    with subprocess.Popen(
        [sys.executable, "-m", "axisbus", *map(str, arguments)],
        stdin=subprocess.DEVNULL,
        stdout=theirs,
        stderr=subprocess.DEVNULL,
        env={**base, "TERM": "xterm-256color", "COLUMNS": "80", **environment},
    ) as process:
        os.close(theirs)
        found = b""
        while True:
            try:
                part = os.read(ours, 65536)
            except OSError:  # Linux raises it when the other side is closed
                break
            if not part:
                break
            found += part
        process.wait(30)
    os.close(ours)
    return found.decode().replace("\r\n", "\n")


terminal = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no pseudo-terminals of this kind")


@terminal
def test_on_a_terminal_severities_have_their_colours(tmp_path):
    out = on_terminal("check", cell(tmp_path, *FAULTY))
    assert "\x1b[1;31merror:\x1b[0m" in out
    assert "\x1b[33mwarning:\x1b[0m" in out


@terminal
@pytest.mark.parametrize("environment", [{"NO_COLOR": "1"}, {"TERM": "dumb"}])
def test_colours_can_be_refused(axisbus, tmp_path, environment):
    path = cell(tmp_path, *FAULTY)
    out = on_terminal("check", path, **environment)
    assert "\x1b" not in out
    assert out == axisbus("check", path).out


@terminal
def test_no_color_holds_for_trace_too(tmp_path):
    path = tmp_path / "run.log"
    path.write_text("(100.0) can0 081#1186210102000000\n")
    assert "\x1b[31m" in on_terminal("trace", path)
    assert "\x1b" not in on_terminal("trace", path, NO_COLOR="1")


@terminal
def test_scan_draws_a_table_on_a_terminal(axisbus):
    drawn, plain = (
        on_terminal("scan", command_line.CELL, COLUMNS="140"),
        axisbus("scan", command_line.CELL).out,
    )
    assert "vendor" in drawn.splitlines()[0]
    assert drawn.count("servo drive (CiA 402)") == plain.count("servo drive (CiA 402)") == 3
    assert "\x1b" not in plain
    assert on_terminal("scan", command_line.CELL, NO_COLOR="1") == plain


@terminal
def test_monitor_keeps_one_table_on_a_terminal():
    out = on_terminal("monitor", command_line.CELL, "--every", "0.05", "--count", "3", COLUMNS="140")
    assert "\x1b[1A" in out  # the table is drawn over the one before
    last = out[out.rindex("position") :]
    assert last.count("switch on disabled") == 3
    assert last.index("switch on disabled") < last.index("cycle of 4 ms: ") < last.index("next: axisbus home")
    assert "next: axisbus home" in last
    plain = on_terminal("monitor", command_line.CELL, "--every", "0.05", "--count", "2", NO_COLOR="1")
    assert "\x1b" not in plain
    assert plain.count("switch on disabled") == 6


# -- ids ------------------------------------------------------------------------------------------------------------------


def test_each_finding_of_a_clean_cell_is_printed_once(axisbus):
    """A finding of all three axes is one finding that names them."""
    code, out, _ = axisbus("check", command_line.CELL)
    assert code == 0
    said = [
        re.sub(r"^\S+: ", "", line) for line in out.splitlines() if line.startswith(f"{command_line.CELL}:")
    ]
    without = [
        re.sub(r"\b(axis|axes) [xyz](, [xyz])*( and [xyz])?\b( \(lines [^)]*\))?", "", each) for each in said
    ]
    assert len(set(without)) == len(without)
    assert "axes x, y and z (lines 19, 40 and 61): each can run " in out
    found = json.loads(axisbus("check", command_line.CELL, "--json").out)["findings"]
    (modes,) = (each for each in found if " can run " in each["message"])
    assert (modes["subjects"], modes["lines"]) == (["x", "y", "z"], [19, 40, 61])


def test_an_id_is_explained_and_listed(axisbus):
    code, out, _ = axisbus("check", "--explain", "c017")
    assert code == 0
    assert out.startswith("C017 error: ")
    assert "To do: " in out
    assert f"\n{out.splitlines()[0].split()[0]}   error " in axisbus("check", "--list").out
    rules = json.loads(axisbus("check", "--list", "--json").out)["rules"]
    assert len({each["id"] for each in rules}) == len(rules) > 100
    code, _, err = axisbus("check", "--explain", "Q1")
    assert code == 2
    assert "not the id of a rule" in err


def test_warnings_and_notes_can_be_ignored_and_errors_not(axisbus, tmp_path):
    path = cell(tmp_path, *FAULTY)
    every = json.loads(axisbus("check", path, "--json").out)["findings"]
    ids = ",".join(sorted({each["rule"] for each in every}))
    code, out, _ = axisbus("check", path, "--ignore", ids)
    assert code == 1
    assert set(findings(out, path)) == {"error"}
    errors = [each for each in every if each["severity"] == "error"]
    assert f", 0 warnings, 0 notes, {len(every) - len(errors)} ignored" in out
    (one,) = {each["rule"] for each in every if " can run " in each["message"]}
    less = json.loads(axisbus("check", path, "--json", "--ignore", one).out)
    assert [each for each in every if each["rule"] != one] == less["findings"]
    assert less["ignored"] == 1
    code, _, err = axisbus("check", path, "--ignore", "C999")
    assert code == 2
    assert "axisbus check --list" in err


def test_sarif_has_each_finding_at_its_own_line(axisbus):
    log = json.loads(axisbus("check", command_line.CELL, "--sarif").out)
    (run,) = log["runs"]
    assert run["tool"]["driver"]["name"] == "axisbus check"
    rules = [each["id"] for each in run["tool"]["driver"]["rules"]]
    assert all(rules[each["ruleIndex"]] == each["ruleId"] for each in run["results"])
    lines = [
        each["locations"][0]["physicalLocation"]["region"]["startLine"]
        for each in run["results"]
        if " can run " in each["message"]["text"]
    ]
    assert lines == [19, 40, 61]
