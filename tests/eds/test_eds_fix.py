"""Fixes: each defect becomes the intended text, nothing else changes, and cases that need judgement stay."""

from __future__ import annotations

import codecs
import difflib
import re
from collections import Counter
from dataclasses import replace

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from axisbus.eds import Eds, check, writer
from axisbus.eds.fix import Fixed, fix, unified
from axisbus.eds.fixes.text import plain
from axisbus.eds.io import reader
from axisbus.eds.model import Object
from kit.corpus import FILES
from kit.eds.texts import HEAD, canopen_facts, our_facts, record, variable


def fixed(body: str, head: str = HEAD) -> Fixed:
    return fix(reader.read((head + body).encode(), "test.eds"))


def mended(body: str) -> str:
    """Return the body as fixed, without the usual head."""
    whole = writer.dumps(fixed(body).reading).decode()
    assert whole.startswith(HEAD)
    return whole[len(HEAD) :]


def without_lines(eds: Eds) -> dict[int, Object]:
    """Return the objects, equal ones with equal content, wherever they are and however their names' letters are written."""
    return {
        index: replace(
            entry,
            line=0,
            name=plain(entry.name) or entry.name,
            subs={
                key: replace(sub, line=0, name=plain(sub.name) or sub.name) for key, sub in entry.subs.items()
            },
        )
        for index, entry in eds.objects.items()
    }


DUMMIES = "".join(f"Dummy000{number}=0\n" for number in range(2, 8))
COMPACT = "[2000]\nObjectType=8\nDataType=5\nAccessType=rw\nParameterName=a\nCompactSubObj=2\n"
I8, I32, U8, BOOL, TEXT, OCTETS = "0x2", "0x4", "0x5", "0x1", "0x9", "0xA"


@pytest.mark.parametrize(
    ("rule", "data_type", "given", "meant"),
    [
        ("V006", "7", "0x80+$NODEID", "$NODEID+0x80"),
        ("V006", "7", "$NodeID + 0x200", "$NODEID+0x200"),
        ("V006", "7", "640 + $nodeid", "$NODEID+640"),
        ("V020", "7", "=$NODEID+0x00000300", "$NODEID+0x00000300"),
        ("V020", "7", "$MY_NODE_ID+0x40000180", "$NODEID+0x40000180"),
        ("V010", I32, "0x80000000", "-2147483648"),
        ("V010", I8, "0xFD", "-3"),
        ("V021", I32, "0x-3", "-3"),
        ("V011", U8, "12.0", "12"),
        ("V015", BOOL, "False", "0"),
        ("V013", TEXT, '"Gen4"', "Gen4"),
        ("V017", OCTETS, "0x01FF", "01FF"),
        ("V001", U8, "1Fh", "0x1F"),
        ("V001", "7", "Ox1F", "0x1F"),
        ("V001", "7", "16#1F4", "0x1F4"),
        ("V001", "7", "2#1010", "0xA"),
        ("V001", "0x1B", "0x1234567890ABCDEFLL", "0x1234567890ABCDEF"),
    ],
)
def test_a_value_is_written_as_the_standard_has_it(rule: str, data_type: str, given: str, meant: str) -> None:
    before = variable("2000", DataType=data_type, DefaultValue=given)
    done = fixed(before)
    assert [each.rule for each in done.fixes] == [rule]
    assert mended(before) == variable("2000", DataType=data_type, DefaultValue=meant)
    assert rule not in [each.rule for each in done.reading.eds.findings]


@pytest.mark.parametrize(
    ("data_type", "given"),
    [
        (U8, "4x0"),  # 0x40, 0x04 or 0x0
        (U8, "010"),  # octal by the standard, ten for many an author
        (U8, "12.5"),
        (U8, "-1"),
        (U8, "0x100"),
        (U8, "FF"),
        ("7", "$NODEID+$NODEID"),
        (OCTETS, "0x0"),
        (OCTETS, "NULL"),
        ("0x8", "0x40490FDB"),
        (TEXT, '""quoted""'),
        (TEXT, '" "'),
    ],
)
def test_values_that_need_judgement_are_left_unchanged(data_type: str, given: str) -> None:
    before = variable("2000", DataType=data_type, DefaultValue=given)
    assert fixed(before).fixes == ()
    assert mended(before) == before


@pytest.mark.parametrize(
    ("rule", "before", "after"),
    [
        ("L003", "[OptionalObjects]\nSupportedObjects=4\n1=0x1000\n", "[OptionalObjects]\nSupportedObjects=1\n1=0x1000\n"),
        ("L003", "[OptionalObjects]\nSupportedObjects=0x4\n1=0x1000\n", "[OptionalObjects]\nSupportedObjects=0x1\n1=0x1000\n"),
        ("L001", "[OptionalObjects]\n1=0x1000\n", "[OptionalObjects]\nSupportedObjects=1\n1=0x1000\n"),
        ("S017", "[OptionalObjects]\nSupported Objects=1\n1=0x1000\n", "[OptionalObjects]\nSupportedObjects=1\n1=0x1000\n"),
        ("L004", "[OptionalObjects]\nSupportedObjects=2\n1=0x1\n3=0x2\n", "[OptionalObjects]\nSupportedObjects=2\n1=0x1\n2=0x2\n"),
        ("D017", "[Comments]\nLines=7\nLine1=a\nLine2=b\n", "[Comments]\nLines=2\nLine1=a\nLine2=b\n"),
        ("D016", "[DummyUsage]\nDummy1=1\n" + DUMMIES, "[DummyUsage]\nDummy0001=1\n" + DUMMIES),
        ("D019", "[DummyUsage]\n" + DUMMIES, "[DummyUsage]\n" + DUMMIES + "Dummy0001=0\n"),
        ("S001", "[Comments]\nLines=1\nLine1=für\n", "[Comments]\nLines=1\nLine1=fuer\n"),
        ("S001", "[Comments]\nLines=0\n; 5 µm ± 2°\n", "[Comments]\nLines=0\n; 5 um +/- 2deg\n"),
        ("K001", "[DeviceCommissioning]\nNodeID=5\n", "[DeviceComissioning]\nNodeID=5\n"),
        ("B002", COMPACT + "[2000Name]\nNrOfEntries=9\n1=a\n", COMPACT + "[2000Name]\nNrOfEntries=1\n1=a\n"),
        ("B003", "[1000ObjectLinks]\nObjectLinks=0x2\n1=0x1000\n", "[1000ObjectLinks]\nObjectLinks=0x1\n1=0x1000\n"),
        ("X004", "[M1FixedObjects]\nNrOfEntries=0\n1=0x6000\n", "[M1FixedObjects]\nNrOfEntries=1\n1=0x6000\n"),
        ("S009", "\t[DummyUsage]\nDummy0001=0\n" + DUMMIES, "[DummyUsage]\nDummy0001=0\n" + DUMMIES),
        ("S010", "[DummyUsage\nDummy0001=0\n" + DUMMIES, "[DummyUsage]\nDummy0001=0\n" + DUMMIES),
        ("S011", "[DummyUsage] ; none\nDummy0001=0\n" + DUMMIES, "[DummyUsage]\n; none\nDummy0001=0\n" + DUMMIES),
        ("S006", "[DummyUsage]\n# none\nDummy0001=0\n" + DUMMIES, "[DummyUsage]\n;# none\nDummy0001=0\n" + DUMMIES),
        ("S004", "[DummyUsage]\nDummy0001=0\nDUMMY0001 = 0\n" + DUMMIES, "[DummyUsage]\nDummy0001=0\n" + DUMMIES),
    ],
)  # fmt: skip
def test_a_section_is_fixed_in_its_lines(rule: str, before: str, after: str) -> None:
    done = fixed(before)
    assert [each.rule for each in done.fixes] == [rule]
    assert mended(before) == after


def test_letters_of_the_baud_rates_and_the_access_are_those_of_the_standard() -> None:
    head = HEAD.replace("VendorNumber=1", "Baudrate_500=1\nBaudRate_125=1")
    done = fixed(variable("2000", AccessType="RO"), head)
    assert [each.rule for each in done.fixes] == ["D012", "O019"]
    assert writer.dumps(done.reading).decode() == (head + variable("2000", AccessType="ro")).replace(
        "Baudrate", "BaudRate"
    )


def test_the_number_of_sub_indices_counts_all_but_the_structure() -> None:
    subs = (variable("2000sub0", DataType=U8), variable("2000sub1"), variable("2000subFF"))
    before = record("2000", *subs).replace("SubNumber=3", "SubNumber=9")
    assert mended(before) == before.replace("SubNumber=9", "SubNumber=2")
    assert mended(before.replace("SubNumber=9\n", "")) == before.replace("SubNumber=9", "SubNumber=2")


def test_255_compact_sub_indices_become_254_without_a_further_change() -> None:
    before = "[2000]\nParameterName=a\nObjectType=8\nDataType=5\nAccessType=rw\nCompactSubObj=0xFF\nSubNumber=255\n"
    done = fixed(before)
    assert [each.rule for each in done.fixes] == ["O013", "B001"]
    assert mended(before) == before.replace("0xFF", "0xFE").replace("SubNumber=255", "SubNumber=0")


def test_a_list_with_one_number_twice_gets_every_object_its_own() -> None:
    before = "[OptionalObjects]\nSupportedObjects=4\n1=0x1001\n2=0x1002\n2=0x1003\n4=0x1004\n2=0x1004\n"
    assert mended(before) == "[OptionalObjects]\nSupportedObjects=4\n1=0x1001\n2=0x1002\n3=0x1003\n4=0x1004\n"


def test_a_list_in_the_middle_of_a_merge_is_left_to_a_person() -> None:
    before = (
        "[OptionalObjects]\nSupportedObjects=9\n<<<<<<< HEAD\n1=0x1001\n=======\n1=0x1002\n>>>>>>> theirs\n"
    )
    assert fixed(before).fixes == ()


def test_the_second_of_two_equal_sections_is_removed_and_its_comment_stays() -> None:
    twin = variable("2000").rstrip() + "\n"
    other = variable("2001")
    assert mended(f"{twin}\n{twin}; mine\n\n{other}") == f"{twin}\n; mine\n{other}"
    assert mended(f"{twin}\n{twin}") == f"{twin}\n"
    different = twin + "\n" + variable("2000", DefaultValue="1")
    assert fixed(different).fixes == ()


def test_leading_zeros_are_removed_unless_the_name_is_taken() -> None:
    before = record("2000", variable("2000sub00", DataType=U8), variable("2000sub0A"))
    assert mended(before) == before.replace("sub00", "sub0").replace("sub0A", "subA")
    taken = record("2000", variable("2000sub0", DataType=U8), variable("2000sub00", DataType="6"))
    assert "O012" not in [each.rule for each in fixed(taken).fixes]


def test_a_comment_behind_a_value_is_moved_below_it_before_the_value_is_fixed() -> None:
    before = variable("2000", DataType=I8, DefaultValue="0xFF ; minus one", AccessType="RW ; both")
    after = variable("2000", DataType=I8, DefaultValue="-1\n; minus one", AccessType="rw\n; both")
    assert mended(before) == after


def test_limits_and_lists_of_values_are_fixed_too() -> None:
    before = variable("2000", DataType=I8, LowLimit="0x80", HighLimit="127") + (
        "[2001]\nParameterName=a\nObjectType=8\nDataType=2\nAccessType=rw\nCompactSubObj=1\n[2001Value]\nNrOfEntries=1\n1=0xFE\n"
    )
    assert mended(before) == before.replace("0x80", "-128").replace("0xFE", "-2")


@pytest.mark.parametrize(
    ("written", "plain"),
    [
        ("Größe", "Groesse"),
        ("Temp. °C, µA², 5 ‰", "Temp. degC, uA2, 5 per mille"),
        ("Réglage – “à vide”", 'Reglage - "a vide"'),
        ("e\u0301", "e"),
        ("速度", "速度"),
        ("Gr\ufffd\ufffde", "Gr\ufffd\ufffde"),
    ],
)
def test_a_name_is_written_in_ascii_if_that_is_possible(written: str, plain: str) -> None:
    assert mended(variable("2000", ParameterName=written)) == variable("2000", ParameterName=plain)


def test_many_names_beyond_ascii_are_one_fix() -> None:
    body = "; für\n; µm\n" + variable("2000", ParameterName="Größe")
    (done,) = fixed(body).fixes
    assert done.what == "; für in ASCII, and 2 more lines"


@pytest.mark.parametrize("key", ["DefaultValue", "ParameterValue", "Unit", "UploadFile"])
def test_a_letter_that_a_device_or_tool_compares_stays(key: str) -> None:
    before = variable("2000", DataType=TEXT, **{key: "Größe"})
    assert (fixed(before).fixes, mended(before)) == ((), before)


def test_a_missing_sub_index_is_not_counted_away() -> None:
    """The check says that a sub-index is missing: SubNumber is correct and must not be changed."""
    missing = record(
        "2000",
        variable("2000sub0", DataType=U8, DefaultValue="3"),
        variable("2000sub1"),
        variable("2000sub3"),
    )
    for before in (missing, record("2000", variable("2000sub1"), variable("2000sub2"))):
        wrong = re.sub("SubNumber=([0-9])", lambda found: f"SubNumber={int(found[1]) + 1}", before)
        assert fixed(wrong).fixes == ()


def test_the_counts_of_a_file_that_ends_in_the_middle_are_not_made_to_fit() -> None:
    before = record(
        "2000",
        variable("2000sub0", DataType=U8),
        variable("2000sub1", DefaultValue="1Fh"),
        "[2000sub2]\nParam",
    )
    lists = "[ManufacturerObjects]\nSupportedObjects=3\n1=0x2000\n2=0x2001\n3=0x2002\n\n"
    done = fixed(lists + before.rstrip())
    assert [each.rule for each in done.fixes] == ["V001"]


@pytest.mark.parametrize(
    "body",
    [
        "[2000]\nParameterName=a\nObjectType=8\nDataType=5\nAccessType=rw\nCompactSubObj=x\nSubNumber=3\n"
        + variable("2000sub0", DataType=U8),
        "[Comments]\nLines=1\nLine0=a\nLine1=b\n",
        record("2000", variable("2000sub0", DataType=U8)).replace(
            "SubNumber=1", "SubNumber=1\nCompactSubObj=255"
        ),
        variable("2000", AccessType="READ"),
    ],
)
def test_texts_that_the_check_does_not_count_or_know_are_not_fixed(body: str) -> None:
    assert fixed(body).fixes == ()


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16-le", "utf-16-be"])
def test_a_byte_order_mark_is_removed(encoding: str) -> None:
    bom = {"utf-8": codecs.BOM_UTF8, "utf-16-le": codecs.BOM_UTF16_LE, "utf-16-be": codecs.BOM_UTF16_BE}[
        encoding
    ]
    for name in ("Speed", "速度"):
        text = HEAD + variable("2000", ParameterName=name)
        done = fix(reader.read(bom + text.encode(encoding), "x.eds"))
        assert [each.rule for each in done.fixes] == ["S002"]
        assert writer.dumps(done.reading) == text.encode()


def test_lines_that_end_in_cr_alone_end_in_lf() -> None:
    done = fix(reader.read(HEAD.replace("\n", "\r").encode(), "x.eds"))
    assert [each.rule for each in done.fixes] == ["S014"]
    assert writer.dumps(done.reading) == HEAD.encode()


def test_line_ends_spacing_and_everything_else_stay() -> None:
    before = ("; top\r\n" + HEAD.replace("\n", "\r\n") + "[2000]\r\n ParameterName = x \r\nDataType =\t0x2\r\nAccessType=rw\r\n"
              "DefaultValue =  0xFF  \r\nodd line\r\n").encode()  # fmt: skip
    done = fix(reader.read(before, "x.eds"))
    assert writer.dumps(done.reading) == before.replace(b"0xFF", b"-1")


def test_lines_are_named_as_the_original_has_them() -> None:
    before = "[OptionalObjects]\nSupportedObjects=1 ; one\n1=0x1000\n\n" + variable(
        "2000", DataType=I8, DefaultValue="0xFF"
    )
    original = reader.read((HEAD + before).encode(), "test.eds")
    done = fix(original)
    wrong = [line for line, raw in enumerate(original.document.lines, 1) if "0xFF" in raw]
    assert [each.line for each in done.fixes if each.rule == "V010"] == wrong


def test_the_diff_has_the_unified_format() -> None:
    body = "".join(
        record(f"{index:X}", variable(f"{index:X}sub0", DataType=I8, DefaultValue="0xFF ; minus"), variable(f"{index:X}sub01"))
        for index in (0x2000, 0x2010, 0x2011)
    ) + "[Comments]\nLines=1 ; last line"  # fmt: skip
    before = reader.read((HEAD + body).encode(), "test.eds")
    done = fix(before)
    ours = list(unified(before.document, done, "x"))
    theirs = difflib.unified_diff(before.document.lines, done.reading.document.lines, lineterm="")
    assert ours[:2] == ["--- x", "+++ x (mended)"]
    assert [line for line in ours[2:] if line[0] == "@"] == [line for line in theirs if line[0] == "@"]
    assert patched(list(before.document.lines), ours[2:]) == list(done.reading.document.lines)
    assert list(unified(before.document, fix(reader.read(HEAD.encode(), "x")), "x"))[:0] == []


def patched(lines: list[str], diff: list[str]) -> list[str]:
    """Apply a unified diff by its lines, as ``patch`` does."""
    made: list[str] = []
    at = 0
    for line in diff:
        if line.startswith("@@"):
            start = int(line.split()[1].split(",")[0][1:]) - 1
            made += lines[at:start]
            at = start
            continue
        if line[0] in " -":
            assert lines[at] == line[1:]
            at += 1
        if line[0] in " +":
            made.append(line[1:])
    return made + lines[at:]


LINES = st.sampled_from(
    [
        *("[2000]", "[2000sub1]", "[2000sub01]", "[OptionalObjects]", "[2000Value]", "[Comments]", "[2000", " [2001] ; x"),
        *("ParameterName=a", "DataType=2", "DataType=0x9", "AccessType=RW", "ObjectType=8", "CompactSubObj=255", "SubNumber=3"),
        *("DefaultValue=0xFF", "DefaultValue=0x80+$nodeid ; c", 'DefaultValue="a"', "DefaultValue=1Fh", "LowLimit=0x-2"),
        *("SupportedObjects=9", "1=0x2000", "1=0x2001", "3=0x2000", "NrOfEntries=x", "Lines=1", "Line1=c", "# c", "; c", "", "?"),
    ]
)  # fmt: skip


@settings(max_examples=200, deadline=None)
@example(["[OptionalObjects]", "# c"], "\n")  # what seems truncated is a comment after the first fix
@given(st.lists(LINES, max_size=20), st.sampled_from(["\n", "\r\n", "\r"]))
def test_fixing_a_file_twice_changes_no_more_than_fixing_it_once(lines: list[str], newline: str) -> None:
    before = reader.read((HEAD + "\n".join(lines)).replace("\n", newline).encode(), "x.eds")
    done = fix(before)
    again = reader.read(writer.dumps(done.reading), "x.eds")
    assert list(again.document.lines) == list(done.reading.document.lines)
    assert fix(again).fixes == ()
    comments = [line.strip() for line in before.document.lines if line.strip()[:1] == ";"]
    kept = [line.strip() for line in again.document.lines]
    assert all(comment in kept for comment in comments)


@pytest.mark.skipif(not FILES, reason="no folder of EDS files (AXISBUS_EDS_CORPUS)")
def test_fixed_real_files_are_read_with_the_same_content() -> None:
    for path in FILES:
        before = reader.read(path.read_bytes(), path.name)
        done = fix(before)
        again = reader.read(writer.dumps(done.reading), path.name)
        assert fix(again).fixes == (), path.name
        unreadable = [each.index for each in before.eds.findings if each.rule == "V001"]
        ours, then = without_lines(again.eds), without_lines(before.eds)
        assert {k: v for k, v in ours.items() if k not in unreadable} == {
            k: v for k, v in then.items() if k not in unreadable
        }, path.name


@pytest.mark.skipif(not FILES, reason="no folder of EDS files (AXISBUS_EDS_CORPUS)")
def test_fix_repairs_findings_of_check() -> None:
    """``fix`` repairs only findings; afterwards there is no new finding, and the repaired ones are gone."""
    for path in FILES:
        before = reader.read(path.read_bytes(), path.name)
        found = check(before)
        if len(before.eds.findings) > 900:
            continue  # not all of it is listed
        done = fix(before)
        assert {each.rule for each in done.fixes} <= {each.rule for each in found}, path.name
        counts = Counter((each.rule, each.index, each.subindex) for each in found)
        after = Counter((each.rule, each.index, each.subindex) for each in check(done.reading))
        assert after - counts == Counter(), path.name


def test_a_fixed_file_is_read_by_canopen_as_by_us() -> None:
    body = variable("2000", DataType=I32, DefaultValue="0xFFFFFFFF", AccessType="RW") + variable(
        "2001", DefaultValue="0x180+$NodeID"
    )
    done = fixed(body).reading
    text = writer.dumps(done).decode()
    assert canopen_facts(text, 5) == our_facts(done.eds, 5)


@pytest.mark.parametrize(
    ("encoding", "name"),
    [
        ("cp1250", "Prędkość"),
        ("cp1250", "Rychlost řídicí"),
        ("cp1251", "Темп"),
        ("cp1251", "Дцй"),
        ("cp1253", "Ταχύτητα"),
        ("cp1254", "Hız değeri"),
        ("cp1257", "Greitis ąžuolo"),
        ("cp852", "Prędkość"),
        ("cp866", "Скорость"),
        ("koi8_r", "Скорость"),
        ("euc_kr", "속도"),
        ("gbk", "速度"),
        ("gbk", "氨 A"),
        ("big5", "速度"),
        ("shift_jis", "速度"),
    ],
)
def test_names_of_a_file_whose_code_page_is_not_certain_stay_as_they_are(encoding: str, name: str) -> None:
    before = (HEAD + variable("2000", ParameterName=name) + f"; {name}\n").encode(encoding)
    done = fix(reader.read(before, "x.eds"))
    assert before.splitlines()[-1] in writer.dumps(done.reading).splitlines()
    assert f"ParameterName={name}".encode(encoding) in writer.dumps(done.reading).splitlines()


@pytest.mark.parametrize(
    ("encoding", "name", "plain"),
    [
        ("cp1252", "Größe in µm, 5 °C", "Groesse in um, 5 degC"),
        ("cp1252", "Beschleunigung (m/s²) – Öl", "Beschleunigung (m/s2) - Oel"),
        ("cp850", "Größe für Öl", "Groesse fuer Oel"),
        ("utf-8", "Vitesse à l'arrêt", "Vitesse a l'arret"),
    ],
)
def test_names_of_a_file_whose_code_page_is_certain_are_spelt_in_ascii(
    encoding: str, name: str, plain: str
) -> None:
    before = (HEAD + variable("2000", ParameterName=name)).encode(encoding)
    done = fix(reader.read(before, "x.eds"))
    assert f"ParameterName={plain}".encode() in writer.dumps(done.reading).splitlines()
