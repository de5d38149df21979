"""Bytes to lines to sections and back: encodings, line endings, duplicates, and where each finding points."""

from __future__ import annotations

import codecs

import pytest

from axisbus.eds import loads, writer
from axisbus.eds.io import reader
from axisbus.eds.io.findings import MAX_FINDINGS
from kit.eds.texts import HEAD, HEAD_LINES, only, read, rules, variable

UMLAUTS = "[DeviceInfo]\nVendorName=Müller\n\n[1000]\nParameterName=Gerätetyp\nDataType=7\nAccessType=ro\n"


@pytest.mark.parametrize(
    ("encoding", "bom", "expected_rules"),
    [
        ("utf-8", b"", ["S001"]),
        ("utf-8", codecs.BOM_UTF8, ["S002", "S001"]),
        ("cp1252", b"", ["S001"]),
        ("cp850", b"", ["S001"]),
        ("utf-16-le", codecs.BOM_UTF16_LE, ["S002", "S001"]),
        ("utf-16-be", codecs.BOM_UTF16_BE, ["S002", "S001"]),
        ("utf-16-le", b"", ["S002", "S001"]),
        ("utf-16-be", b"", ["S002", "S001"]),
    ],
)
def test_letters_are_read_in_every_encoding(encoding: str, bom: bytes, expected_rules: list[str]) -> None:
    data = bom + UMLAUTS.encode(encoding)
    reading = reader.read(data, "x.eds")
    assert reading.eds.objects[0x1000].name == "Gerätetyp"
    assert reading.eds.info["deviceinfo"]["vendorname"] == "Müller"
    assert rules(reading.eds) == expected_rules
    assert writer.dumps(reading.document) == data


def test_a_foreign_letter_is_named_by_its_line_and_column() -> None:
    finding = only(loads(UMLAUTS.encode("cp1252"), "x.eds"))
    assert (finding.rule, finding.line, finding.column) == ("S001", 2, 13)
    assert "CP1252" in finding.message


@pytest.mark.parametrize("newline", ["\n", "\r\n", "\r"])
def test_line_numbers_count_lines_with_any_line_end(newline: str) -> None:
    data = (HEAD + variable("2000", DefaultValue="4x0")).replace("\n", newline).encode()
    reading = reader.read(data, "x.eds")
    finding = only(reading.eds)
    assert (finding.rule, finding.line, finding.column) == ("V001", HEAD_LINES + 6, 14)
    assert reading.eds.objects[0x2000].line == HEAD_LINES + 1
    assert writer.dumps(reading.document) == data


def test_comments_odd_spacing_and_a_missing_last_line_end_are_kept_byte_for_byte() -> None:
    data = (
        b"; head\n\n[1000] \nParameterName = Device type\r\n  DataType=7\n; in between\nAccessType=ro\n;end"
    )
    reading = reader.read(data, "x.eds")
    assert reading.eds.objects[0x1000].name == "Device type"
    assert writer.dumps(reading.document) == data


def test_sections_and_keys_are_not_case_sensitive() -> None:
    eds = read(
        "[60fF]\nPARAMETERNAME=Target velocity\nobjecttype=0X7\ndatatype=0x0004\naccesstype=RW\npdomapping=1\n"
    )
    target = eds.get(0x60FF)
    assert target is not None
    assert (target.name, target.data_type, target.access, target.pdo_mapping) == (
        "Target velocity",
        4,
        "rw",
        True,
    )
    assert eds.findings == ()


def test_of_two_sections_with_one_name_the_first_counts() -> None:
    eds = read(variable("2000", ParameterName="First") + variable("2000", ParameterName="Second"))
    assert eds.objects[0x2000].name == "First"
    finding = only(eds)
    assert (finding.rule, finding.line) == ("S003", HEAD_LINES + 7)
    assert f"line {HEAD_LINES + 1}" in finding.message


def test_of_two_equal_keys_the_first_counts() -> None:
    eds = read("[2000]\nParameterName=First\nDataType=7\nAccessType=rw\nparametername=Second\n")
    assert eds.objects[0x2000].name == "First"
    finding = only(eds)
    assert (finding.rule, finding.line) == ("S004", HEAD_LINES + 5)


def test_text_before_the_first_section_is_reported_and_left_out() -> None:
    eds = loads(("ParameterName=lost\n" + HEAD).encode(), "x.eds")
    assert (only(eds).rule, only(eds).line) == ("S005", 1)


def test_a_line_without_equals_sign_is_reported_and_left_out() -> None:
    eds = read(variable("2000").rstrip("\n") + "\n<<<<<<< HEAD\n")
    assert (only(eds).rule, only(eds).line) == ("S006", HEAD_LINES + 6)
    assert eds.get(0x2000) is not None


def test_odd_section_headers_are_understood() -> None:
    eds = read(
        "  [2000]\nParameterName=A\nDataType=7\nAccessType=rw\n[2001\nParameterName=B\nDataType=7\nAccessType=rw\n"
    )
    assert [entry.name for entry in eds] == ["Device type", "A", "B"]
    assert [(found.rule, found.line, found.column) for found in eds.findings] == [
        ("S009", HEAD_LINES + 1, 3),
        ("S010", HEAD_LINES + 5, 1),
    ]


def test_text_behind_a_section_header_is_ignored() -> None:
    eds = read(variable("2000").replace("[2000]", "[2000] ; the speed"))
    assert eds.get(0x2000) is not None
    assert (only(eds).rule, only(eds).column) == ("S011", 7)


def test_an_unknown_section_is_kept_and_reported() -> None:
    eds = read("[ToolInfos]\nItems=3\n")
    assert eds.info["toolinfos"] == {"items": "3"}
    assert only(eds).rule == "S012"


@pytest.mark.parametrize(
    "name",
    [
        *("Comments", "DummyUsage", "SupportedModules", "M1ModuleInfo", "M2FixedObjects", "M1Fixed6000sub1", "M1SubExt6000"),
        *("DynamicChannels", "1000ObjectLinks", "StandardDataTypes", "ConnectedModules", "A0sub1"),
    ],
)  # fmt: skip
def test_the_sections_of_the_standard_are_known(name: str) -> None:
    assert "S012" not in rules(read(f"[{name}]\n"))


def test_too_many_findings_are_cut_and_counted() -> None:
    eds = read("[Comments]\n" + "nonsense\n" * (MAX_FINDINGS + 4000))
    assert len(eds.findings) == MAX_FINDINGS + 1
    assert eds.findings[-1].rule == "S099"
    assert "4000 more" in eds.findings[-1].message
