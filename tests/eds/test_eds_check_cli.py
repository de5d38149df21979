"""``axisbus eds check``: its output as text, JSON and SARIF, and its exit codes."""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from functools import partial
from pathlib import Path
from typing import Any

import click
import pytest
from click.testing import CliRunner

from axisbus import eds
from axisbus.cli.main import cli
from axisbus.eds.io import reader
from axisbus.eds.rules import engine
from axisbus.eds.rules.table import rules
from axisbus.errors import ArgumentError, EdsError
from kit.command_line import Run
from kit.eds.rule_base import BASE, edited


@pytest.fixture
def check(axisbus: Run, monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Run:
    """Run the command in a folder of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("COLUMNS", raising=False)
    return partial(axisbus, "eds", "check")


def write(name: str, *edits: str) -> str:
    """Write an edited base under this name; its FileName is the same, so that nothing is found about that."""
    Path(name).parent.mkdir(parents=True, exist_ok=True)
    Path(name).write_text(edited(*edits, f"FileInfo:FileName={Path(name).name}"))
    return name


BEYOND = "2000:DefaultValue=10"  # HighLimit is 9: V003, a warning
TWICE = "2005>AccessType=rw"  # S004, an error
SHARED = "2001:ParameterName=Gain"  # O027, a note


def test_a_clean_file_is_reported_with_the_next_command(check: Run) -> None:
    code, out, err = check(write("a.eds"))
    assert (code, err) == (0, "")
    assert out.splitlines() == ["a.eds: 0 errors, 0 warnings, 0 notes", "next: axisbus eds show a.eds"]


def line_of(text: str) -> int:
    """Return the number of the line of a.eds that is this text."""
    return Path("a.eds").read_text().splitlines().index(text) + 1


def test_findings_are_printed_below_their_file_and_their_rule_with_the_remedy(check: Run) -> None:
    write("a.eds", BEYOND)
    code, out, _ = check("a.eds")
    assert code == 0  # a warning alone
    assert out.splitlines() == [
        "a.eds",
        "  warning V003: A value lies outside its limits. To do: correct the value or the limits.",
        f"      {line_of('DefaultValue=10')}:14 [2000] DefaultValue=10 is above HighLimit=9",
        "",
        "in all: 0 errors, 1 warning, 0 notes",
        "next: axisbus eds check --explain V003",
    ]


def test_lines_gives_each_finding_a_line_that_editors_understand(check: Run) -> None:
    write("a.eds", BEYOND, TWICE)
    out = check("a.eds", "--lines")[1].splitlines()
    assert out[0] == (
        f"a.eds:{line_of('DefaultValue=10')}:14: warning V003 [2000] DefaultValue=10 is above HighLimit=9; "
        "correct the value or the limits"
    )
    assert out[1].startswith("a.eds:")
    assert [line.split()[1:3] for line in out[:2]] == [["warning", "V003"], ["error", "S004"]]


def many(count: int) -> str:
    """Write a file with ``count`` objects without PDOMapping (O020)."""
    names = "".join(
        f"[{0x3000 + number:04X}]\nParameterName=P{number}\nObjectType=0x7\nDataType=0x0007\nAccessType=rw\n"
        for number in range(count)
    )
    Path("many.eds").write_text(names)
    return "many.eds"


def test_a_rule_that_is_broken_often_shows_its_first_findings_and_the_count_of_the_others(
    check: Run,
) -> None:
    told = check(many(5000), "--select", "O020")[1].splitlines()
    assert told[0] == "many.eds"
    assert told[1].startswith("  note O020 5000 times: ")
    assert [line.split()[0] for line in told[2:5]] == ["1:1", "6:1", "11:1"]
    assert told[5] == "      and 4997 more (--all shows them)"
    assert told[6:] == [
        "",
        "in all: 0 errors, 0 warnings, 5000 notes",
        "next: axisbus eds check --explain O020",
    ]
    each = check("many.eds", "--select", "O020", "--all")[1].splitlines()
    assert len([line for line in each if "has no PDOMapping" in line]) == 5000
    assert not [line for line in each if "more" in line]


def test_a_single_further_finding_is_shown_instead_of_counted(check: Run) -> None:
    assert "more" not in check(many(4), "--select", "O020")[1]
    assert "and 2 more" in check(many(5), "--select", "O020")[1]


def test_json_and_sarif_have_every_finding(check: Run) -> None:
    json_text = check(many(5000), "--json", "--select", "O020", "--severity", "error")[1]
    assert len(json.loads(json_text)["findings"]) == 5000
    assert len(sarif_of(check, "many.eds", "--select", "O020")["runs"][0]["results"]) == 5000


def test_json_lists_all_findings_of_the_reader(check: Run) -> None:
    text = "".join(
        f"[{index:04X}]\nParameterName=P\nDataType=0x0007 ; text\n" for index in range(0x2000, 0x2800)
    )
    Path("many.eds").write_text(text)
    found = json.loads(check("many.eds", "--json", "--select", "S")[1])["findings"]
    assert [each["rule"] for each in found].count("S011") == 0x800


def test_errors_are_printed_last_in_a_file_and_in_the_table_of_several_files(check: Run) -> None:
    names = [write("a.eds", BEYOND, TWICE, SHARED), write("b.eds", SHARED)]
    out = check(*names)[1]
    one = check("a.eds")[1].splitlines()
    assert [line.split()[0] for line in one if line.startswith("  ") and line[2] != " "] == [
        "note",
        "warning",
        "error",
    ]
    table = out.split("\n\n")[-1].splitlines()
    assert [line.split()[:3] for line in table[:-2]] == [
        ["2", "note", "O027"],
        ["1", "warning", "V003"],
        ["1", "error", "S004"],
    ]
    assert table[0].endswith("(2 files)")
    assert table[1].endswith("(1 file)")


def test_a_path_is_printed_once_for_its_file(check: Run) -> None:
    names = [write("drives/a.eds", BEYOND, TWICE, SHARED), write("drives/b.eds", SHARED, BEYOND)]
    assert [check(*names)[1].count(name) for name in names] == [1, 1]
    assert check(*names, "--all")[1].count("drives/a.eds") == 1
    assert check(names[0])[1].count("drives/a.eds") == 1


def test_severity_filters_the_findings_and_counts_the_others(check: Run) -> None:
    write("a.eds", BEYOND, TWICE, SHARED)

    def shown(*options: str) -> list[str]:
        lines = check("a.eds", "--lines", *options)[1].splitlines()
        return [line.split()[1] for line in lines if re.match(r"a\.eds:\d", line)]

    assert shown("--severity", "error") == ["error"]
    assert sorted(shown("--severity", "error,note")) == ["error", "note"]
    assert sorted(shown("--severity", "Warning", "--severity", "note")) == ["note", "warning"]
    code, out, _ = check("a.eds", "--severity", "note")
    assert code == 1  # findings that are not shown count all the same
    assert "1 error (not shown), 1 warning (not shown), 1 note" in out
    code, out, _ = check(write("b.eds", SHARED), "--severity", "error,warning")
    assert out.splitlines()[0] == "b.eds: 0 errors, 0 warnings, 1 note (not shown)"
    assert len(json.loads(check("a.eds", "--json", "--severity", "note")[1])["findings"]) == 3


def test_an_invalid_severity_is_wrong_use(check: Run) -> None:
    code, out, err = check(write("a.eds"), "--severity", "fatal")
    assert (code, out) == (2, "")
    assert "error, warning, note" in err


def test_long_texts_are_folded_below_their_rule_if_the_width_is_known(
    check: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "50")
    out = check(write("a.eds", BEYOND, TWICE, SHARED))[1].split("\n\n")[0].splitlines()
    assert max(map(len, out)) <= 50
    assert all(line.startswith("  ") for line in out[1:])


@pytest.mark.parametrize(
    ("edit", "codes"),
    [(TWICE, (1, 1, 1)), (BEYOND, (0, 1, 1)), (SHARED, (0, 0, 1)), ("2000:PDOMapping=1", (0, 0, 0))],
)
def test_fail_on_sets_the_severity_that_fails(check: Run, edit: str, codes: tuple[int, ...]) -> None:
    name = write("a.eds", edit)
    assert tuple(check(name, "--fail-on", level)[0] for level in ("error", "warning", "note")) == codes
    assert check(name)[0] == codes[0]


def test_select_and_ignore_take_ids_and_beginnings_and_the_longer_wins(check: Run) -> None:
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


def test_a_whole_id_means_that_rule_alone(check: Run) -> None:
    listed = check("--list", "--select", "M001")[1]
    assert "M001 " in listed
    assert "M001c" not in listed


@pytest.mark.parametrize(
    "options", [("--select", "Q"), ("--ignore", "V999"), ("--select", "V003,"), ("--explain", "V9")]
)
def test_an_unknown_id_is_misuse(check: Run, options: tuple[str, str]) -> None:
    code, out, err = check(write("a.eds"), *options)
    assert (code, out) == (2, "")
    assert (
        "is not the id of a rule" in err if options[0] == "--explain" else "no rule's id begins with" in err
    )


@pytest.mark.parametrize(
    "arguments", [(), ("--json", "--sarif", "a.eds"), ("--fail-on", "fatal", "a.eds"), ("--no-such-option",)]
)
def test_wrong_use_is_2_and_a_sentence(check: Run, arguments: tuple[str, ...]) -> None:
    code, out, err = check(*arguments)
    assert (code, out) == (2, "")
    assert err.strip()


def test_json_has_every_field(check: Run) -> None:
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
            "remedy": "write the DataType that CiA 301 defines",
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


def test_json_of_a_clean_file_is_an_empty_list(check: Run) -> None:
    assert json.loads(check(write("a.eds"), "--json")[1]) == {"findings": []}


def test_findings_about_the_whole_file_are_in_line_1(check: Run) -> None:
    name = write("a.eds")
    Path(name).write_text(BASE[BASE.index("[DeviceInfo]") :])
    found = json.loads(check(name, "--json")[1])["findings"]
    assert [(each["rule"], each["line"], each["column"]) for each in found] == [("F001", 1, 1)]
    assert check(name, "--lines")[1].startswith("a.eds:1:1: warning F001 ")


def sarif_of(check: Run, *files: str) -> dict[str, Any]:
    log: dict[str, Any] = json.loads(check("--sarif", *files)[1])
    return log


def test_sarif_has_the_properties_that_code_hosts_require(check: Run) -> None:
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
    check: Run, tmp_path_factory: pytest.TempPathFactory
) -> None:
    elsewhere = str(tmp_path_factory.mktemp("elsewhere") / "a.eds")
    (one_run,) = sarif_of(check, write(elsewhere, BEYOND))["runs"]
    location = one_run["results"][0]["locations"][0]["physicalLocation"]["artifactLocation"]
    assert location == {"uri": Path(elsewhere).as_uri()}


def test_each_of_several_files_and_patterns_is_checked_once(check: Run) -> None:
    for name in ("a.eds", "b.eds", "sub/c.eds"):
        write(name, SHARED)
    found = json.loads(check("--json", "*.eds", "a.eds", "**/c.eds")[1])["findings"]
    assert [Path(each["file"]).name for each in found] == ["a.eds", "b.eds", "c.eds"]


def test_a_file_may_be_named_like_a_pattern(check: Run) -> None:
    assert check(write("a[1].eds"))[0] == 0


def test_builtin_files_are_checked_by_name(check: Run) -> None:
    code, out, _ = check("builtin:gim6010-8", "--fail-on", "warning")
    assert code == 0
    assert "builtin:gim6010-8\n" in out


@pytest.mark.parametrize(
    ("data", "said"),
    [
        (b"\x89PNG\r\n\x1a\n" + bytes(100), "PNG"),
        (b"", "empty"),
        (b"just a text\n", "not an EDS"),
        (b"[FileInfo]\nFileName=a.eds\n", "no object"),
        (None, "does not exist"),
    ],
)
def test_an_unreadable_file_is_a_finding_next_to_those_of_the_other_files(
    check: Run, data: bytes | None, said: str
) -> None:
    if data is not None:
        Path("odd.eds").write_bytes(data)
    code, out, err = check("odd.eds", write("good.eds", SHARED), "--select", "O")
    assert (code, err) == (1, "")
    file, rule, first = out.splitlines()[:3]
    assert file == "odd.eds"
    assert rule.startswith("  error S000: ")
    assert said in first
    assert out.count("odd.eds") == 1
    assert "good.eds\n" in out


def test_a_folder_and_a_pattern_without_a_match_are_findings(check: Run) -> None:
    Path("folder").mkdir()
    found = json.loads(check("folder", "nothing*.eds", "builtin:nothing", "--json")[1])["findings"]
    assert [each["rule"] for each in found] == ["S000"] * 3


def test_explain_reports_clause_reason_and_remedy(check: Run) -> None:
    code, out, _ = check("--explain", "v003")
    assert code == 0
    assert out.splitlines()[0] == "V003 warning: A value lies outside its limits."
    assert "CiA DS 306 4.6.3.2" in out
    assert "To do: correct the value or the limits." in out
    assert check("--explain", "M001")[1].startswith("M001 error")


def test_list_shows_all_rules_also_as_json(check: Run) -> None:
    code, out, _ = check("--list")
    assert code == 0
    assert [line.split()[0] for line in out.splitlines()[:-1]] == list(rules())
    listed = json.loads(check("--list", "--json", "--select", "P0")[1])["rules"]
    assert {rule["id"][0] for rule in listed} == {"P"}
    assert set(listed[0]) == {"id", "severity", "clause", "title", "remedy", "explanation"}


def test_colours_are_for_terminals_only(check: Run, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("NO_COLOR", raising=False)
    name = write("a.eds", TWICE)
    assert "\x1b" not in check(name)[1]
    on_a_terminal = CliRunner().invoke(cli, ["eds", "check", name], color=True).output
    assert "\x1b[31m" in on_a_terminal  # red, for the error
    assert click.unstyle(on_a_terminal) == check(name)[1]
    monkeypatch.setenv("NO_COLOR", "1")
    assert "\x1b" not in CliRunner().invoke(cli, ["eds", "check", name], color=True).output


def test_output_in_ascii_does_not_stumble_over_letters(check: Run, tmp_path: Path) -> None:
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
    assert eds.check(reader.read(path.read_bytes(), "test.eds")) == by_path
    assert eds.check(path, select="V", ignore=["V003"]) == ()
    with pytest.raises(EdsError, match="does not exist"):
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
    found = eds.check(reader.read(names.encode(), "test.eds"), select=["O027", "S099"])
    assert [each.rule for each in found].count("O027") == engine.MAX_OF_A_RULE
    (more,) = [each for each in found if each.rule == "S099"]
    assert more.message == "10 more findings of O027 are not listed"
