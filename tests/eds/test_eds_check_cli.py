"""``axisbus eds check`` as its user types it: what it prints, as text, JSON and SARIF, and its exit codes."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner
from rule_base import BASE, edited

from axisbus import eds
from axisbus.cli.common import run
from axisbus.cli.main import cli
from axisbus.eds.rules import engine
from axisbus.eds.rules.table import rules
from axisbus.errors import ArgumentError, EdsError

Call = Callable[..., tuple[int, str, str]]


@pytest.fixture
def check(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Call:
    """Run the command in a folder of its own; returns exit code, output and errors."""
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["axisbus", "eds", "check", *arguments])
        code = run(cli)
        output = capsys.readouterr()
        return code, output.out, output.err

    return call


def write(name: str, *edits: str) -> str:
    """Write an edited base under this name; its FileName is the same, so that nothing is found about that."""
    Path(name).parent.mkdir(parents=True, exist_ok=True)
    Path(name).write_text(edited(*edits, f"FileInfo:FileName={Path(name).name}"))
    return name


BEYOND = "2000:DefaultValue=10"  # HighLimit is 9: V003, a warning
TWICE = "2005>AccessType=rw"  # S004, an error
SHARED = "2001:ParameterName=Gain"  # O027, a note


def test_a_clean_file_says_so_and_what_to_do_next(check: Call) -> None:
    code, out, err = check(write("a.eds"))
    assert (code, err) == (0, "")
    assert out.splitlines() == ["a.eds: 0 errors, 0 warnings, 0 notes", "next: axisbus eds show a.eds"]


def test_a_finding_is_one_line_that_editors_understand_and_one_with_the_remedy(check: Call) -> None:
    write("a.eds", BEYOND)
    line = Path("a.eds").read_text().splitlines().index("DefaultValue=10") + 1
    code, out, _ = check("a.eds")
    assert code == 0  # a warning alone
    assert out.splitlines() == [
        f"a.eds:{line}:14: warning V003 [2000] DefaultValue=10 is above HighLimit=9",
        "    correct the value or the limits",
        "",
        "     1 warning  V003   A value lies outside its limits.",
        "a.eds: 0 errors, 1 warning, 0 notes",
        "next: axisbus eds check --explain V003",
    ]


@pytest.mark.parametrize(
    ("edit", "codes"),
    [(TWICE, (1, 1, 1)), (BEYOND, (0, 1, 1)), (SHARED, (0, 0, 1)), ("2000:PDOMapping=1", (0, 0, 0))],
)
def test_fail_on_says_from_where_on_it_fails(check: Call, edit: str, codes: tuple[int, ...]) -> None:
    name = write("a.eds", edit)
    assert tuple(check(name, "--fail-on", level)[0] for level in ("error", "warning", "note")) == codes
    assert check(name)[0] == codes[0]


def test_the_summary_counts_by_severity_and_rule_worst_first(check: Call) -> None:
    names = [write("a.eds", BEYOND, TWICE, SHARED), write("b.eds", SHARED)]
    code, out, _ = check(*names)
    assert code == 1
    summary = out.split("\n\n")[-1].splitlines()
    assert [line.split()[:3] for line in summary[:-2]] == [
        ["1", "error", "S004"],
        ["1", "warning", "V003"],
        ["2", "note", "O027"],
    ]
    assert summary[-2] == "2 files: 1 error, 1 warning, 2 notes"


def test_select_and_ignore_take_ids_and_beginnings_and_the_longer_wins(check: Call) -> None:
    name = write("a.eds", BEYOND, TWICE, SHARED)

    def ids(*options: str) -> list[str]:
        return sorted(each["rule"] for each in json.loads(check(name, "--json", *options)[1])["findings"])

    assert ids() == ["O027", "S004", "V003"]
    assert ids("--select", "V") == ["V003"]
    assert ids("--select", "v00,o027") == ["O027", "V003"]
    assert ids("--select", "S", "--select", "O") == ["O027", "S004"]
    assert ids("--ignore", "V003") == ["O027", "S004"]
    assert ids("--ignore", "V", "--ignore", "S,O") == []
    assert ids("--select", "V", "--ignore", "V003") == []
    assert ids("--ignore", "V", "--select", "V003,S") == ["S004", "V003"]


def test_a_whole_id_means_that_rule_alone(check: Call) -> None:
    listed = check("--list", "--select", "M001")[1]
    assert "M001 " in listed
    assert "M001c" not in listed


@pytest.mark.parametrize(
    "options", [("--select", "Q"), ("--ignore", "V999"), ("--select", "V003,"), ("--explain", "V9")]
)
def test_an_unknown_id_is_misuse(check: Call, options: tuple[str, str]) -> None:
    code, out, err = check(write("a.eds"), *options)
    assert (code, out) == (2, "")
    assert "no rule's id" in err


@pytest.mark.parametrize(
    "arguments", [(), ("--json", "--sarif", "a.eds"), ("--fail-on", "fatal", "a.eds"), ("--no-such-option",)]
)
def test_wrong_use_is_2_and_a_sentence(check: Call, arguments: tuple[str, ...]) -> None:
    code, out, err = check(*arguments)
    assert (code, out) == (2, "")
    assert err.strip()


def test_json_has_every_field(check: Call) -> None:
    write("a.eds", BEYOND, "1018sub1:DataType=0x0006")
    code, out, _ = check("a.eds", "--json")
    assert code == 0
    found = json.loads(out)["findings"]
    lines = Path("a.eds").read_text().splitlines()
    assert found == [
        {
            "file": "a.eds",
            "line": lines.index("[1018sub1]") + 4,
            "column": 10,
            "rule": "C003",
            "severity": "warning",
            "index": 0x1018,
            "subindex": 1,
            "message": "[1018sub1] is UNSIGNED16, CiA 301 has UNSIGNED32 (Vendor-ID)",
            "remedy": "write DataType as CiA 301 has it",
        },
        {
            "file": "a.eds",
            "line": lines.index("DefaultValue=10") + 1,
            "column": 14,
            "rule": "V003",
            "severity": "warning",
            "index": 0x2000,
            "subindex": 0,
            "message": "[2000] DefaultValue=10 is above HighLimit=9",
            "remedy": "correct the value or the limits",
        },
    ]


def test_json_of_a_clean_file_is_an_empty_list(check: Call) -> None:
    assert json.loads(check(write("a.eds"), "--json")[1]) == {"findings": []}


def test_what_concerns_the_whole_file_stands_in_line_1(check: Call) -> None:
    name = write("a.eds")
    Path(name).write_text(BASE[BASE.index("[DeviceInfo]") :])
    found = json.loads(check(name, "--json")[1])["findings"]
    assert [(each["rule"], each["line"], each["column"]) for each in found] == [("F001", 1, 1)]
    assert check(name)[1].startswith("a.eds:1:1: warning F001 ")


def sarif_of(check: Call, *files: str) -> dict[str, Any]:
    log: dict[str, Any] = json.loads(check("--sarif", *files)[1])
    return log


def test_sarif_has_what_code_hosts_ask_for(check: Call) -> None:
    log = sarif_of(check, write("drives/my drive.eds", BEYOND, TWICE, SHARED))
    assert log["version"] == "2.1.0"
    assert log["$schema"].endswith("sarif-2.1.0.json")
    (one_run,) = log["runs"]
    driver = one_run["tool"]["driver"]
    assert driver["name"]
    assert [rule["id"] for rule in driver["rules"]] == list(rules())
    for rule in driver["rules"]:
        assert rule["shortDescription"]["text"].endswith(".")
        assert len(rule["help"]["text"]) > 40
        assert rule["defaultConfiguration"]["level"] in ("error", "warning", "note")
    assert {result["ruleId"]: result["level"] for result in one_run["results"]} == {
        "S004": "error",
        "V003": "warning",
        "O027": "note",
    }
    for result in one_run["results"]:
        assert driver["rules"][result["ruleIndex"]]["id"] == result["ruleId"]
        (location,) = result["locations"]
        physical = location["physicalLocation"]
        assert physical["artifactLocation"]["uri"] == "drives/my%20drive.eds"
        assert physical["region"]["startLine"] >= 1
        assert physical["region"]["startColumn"] >= 1
        assert result["message"]["text"]
    assert one_run["columnKind"] == "unicodeCodePoints"


def test_sarif_of_a_file_elsewhere_has_an_absolute_uri(
    check: Call, tmp_path_factory: pytest.TempPathFactory
) -> None:
    elsewhere = str(tmp_path_factory.mktemp("elsewhere") / "a.eds")
    (one_run,) = sarif_of(check, write(elsewhere, BEYOND))["runs"]
    location = one_run["results"][0]["locations"][0]["physicalLocation"]["artifactLocation"]
    assert location == {"uri": Path(elsewhere).as_uri()}


def test_several_files_and_patterns_each_once(check: Call) -> None:
    for name in ("a.eds", "b.eds", "sub/c.eds"):
        write(name, SHARED)
    found = json.loads(check("--json", "*.eds", "a.eds", "**/c.eds")[1])["findings"]
    assert [Path(each["file"]).name for each in found] == ["a.eds", "b.eds", "c.eds"]


def test_a_file_may_be_named_like_a_pattern(check: Call) -> None:
    assert check(write("a[1].eds"))[0] == 0


def test_builtin_files_are_known_by_name(check: Call) -> None:
    code, out, _ = check("builtin:gim6010-8", "--fail-on", "warning")
    assert code == 0
    assert "builtin:gim6010-8:" in out


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"\x89PNG\r\n\x1a\n" + bytes(100), "PNG"),
        (b"", "empty"),
        (b"just a text\n", "no EDS"),
        (b"[FileInfo]\nFileName=a.eds\n", "no object"),
        (None, "no such file"),
    ],
)
def test_what_cannot_be_read_is_a_finding_beside_the_others(
    check: Call, data: bytes | None, said: str
) -> None:
    if data is not None:
        Path("odd.eds").write_bytes(data)
    code, out, err = check("odd.eds", write("good.eds", SHARED), "--select", "O")
    assert (code, err) == (1, "")
    first = out.splitlines()[0]
    assert first.startswith("odd.eds:1:1: error S000 ")
    assert said in first
    assert first.count("odd.eds") == 1
    assert "good.eds:" in out


def test_a_folder_and_a_pattern_without_a_match_are_findings(check: Call) -> None:
    Path("folder").mkdir()
    found = json.loads(check("folder", "nothing*.eds", "builtin:nothing", "--json")[1])["findings"]
    assert [each["rule"] for each in found] == ["S000"] * 3


def test_explain_tells_clause_reason_and_remedy(check: Call) -> None:
    code, out, _ = check("--explain", "v003")
    assert code == 0
    assert out.splitlines()[0] == "V003 warning: A value lies outside its limits."
    assert "CiA DS 306 4.6.3.2" in out
    assert "To do: correct the value or the limits." in out
    assert check("--explain", "M001")[1].startswith("M001 error")


def test_list_shows_all_rules_also_as_json(check: Call) -> None:
    code, out, _ = check("--list")
    assert code == 0
    assert [line.split()[0] for line in out.splitlines()[:-1]] == list(rules())
    listed = json.loads(check("--list", "--json", "--select", "P0")[1])["rules"]
    assert {rule["id"][0] for rule in listed} == {"P"}
    assert set(listed[0]) == {"id", "severity", "clause", "title", "remedy", "explanation"}


def test_colours_are_for_terminals_only(check: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    name = write("a.eds", TWICE)
    assert "\x1b" not in check(name)[1]
    on_a_terminal = CliRunner().invoke(cli, ["eds", "check", name], color=True).output
    assert "\x1b[31m" in on_a_terminal  # red, for the error
    assert click.unstyle(on_a_terminal) == check(name)[1]
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b" not in CliRunner().invoke(cli, ["eds", "check", name], color=True).output


def test_output_in_ascii_does_not_stumble_over_letters(check: Call, tmp_path: Path) -> None:
    Path("ü.eds").write_bytes(edited("2001:ParameterName=GAIN µ", "2001:DataType=ü").encode())
    done = subprocess.run(
        [sys.executable, "-m", "axisbus", "eds", "check", "ü.eds"],
        capture_output=True, env={**os.environ, "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0"}, check=False,
    )  # fmt: skip
    assert done.returncode == 1
    assert b"Traceback" not in done.stderr
    assert b"O002" in done.stdout


def test_every_rule_has_its_texts() -> None:
    clause = re.compile(r"CiA (DS 306|301|402-2|302-3)\b.*")
    for rule in rules().values():
        assert re.fullmatch("[A-Z][0-9]{3}c?", rule.id)
        assert rule.title.endswith(".")
        assert rule.remedy
        assert not rule.remedy.endswith(".")
        assert len(rule.explanation) > 20
        assert clause.fullmatch(rule.clause) or rule.id == "S099"


def test_the_library_takes_paths_readings_and_dictionaries(tmp_path: Path) -> None:
    path = tmp_path / "test.eds"
    path.write_text(edited(BEYOND))
    by_path = eds.check(path)
    assert [each.rule for each in by_path] == ["V003"]
    assert eds.check(str(path)) == by_path
    assert eds.check(eds.load(path)) == by_path
    assert eds.check(eds.reader.read(path.read_bytes(), "test.eds")) == by_path
    assert eds.check(path, select="V", ignore=["V003"]) == ()
    with pytest.raises(EdsError, match="no such file"):
        eds.check(tmp_path / "other.eds")
    with pytest.raises(ArgumentError, match="begins with 'W'"):
        eds.check(path, select="W")
    with pytest.raises(ArgumentError, match="no text"):
        eds.check(eds.Eds("made", {}, {}))


def test_a_flood_of_findings_of_one_rule_ends_with_a_count() -> None:
    names = "".join(
        f"[{index:04X}]\nParameterName=Same\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\nPDOMapping=0\n"
        for index in range(0x2000, 0x2000 + engine.MAX_OF_A_RULE + 11)
    )
    found = eds.check(eds.reader.read(names.encode(), "test.eds"), select=["O027", "S099"])
    assert [each.rule for each in found].count("O027") == engine.MAX_OF_A_RULE
    (more,) = [each for each in found if each.rule == "S099"]
    assert more.message == "10 more findings of O027 are not listed"
