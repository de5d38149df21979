"""Each rule finds the smallest breach of it, on the right line and column, and leaves the nearest other thing alone."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterable

import pytest

from axisbus.eds import EdsFinding, Severity, check
from axisbus.eds.io import reader
from axisbus.eds.rules import engine
from axisbus.eds.rules.table import rules
from kit.eds.rule_base import BASE, edited, place
from kit.eds.rule_cases import AXIS_TYPE, CASES, DCF, SECOND_AXIS, Case, Edit, not_optional, without

WITHOUT_A_CASE = {"S000", "S099"}  # of unreadable files and of too many findings: below


def text_of(edits: Iterable[Edit]) -> tuple[str, bytes]:
    """Return the edited base, as text and as bytes."""
    text, data = BASE, b""
    for edit in edits:
        if isinstance(edit, str):
            text = edited(edit, text=text)
        else:
            made = edit(text)
            if isinstance(made, bytes):
                data = made
            else:
                text = made
    return text, data or text.encode("latin-1")


def found(edits: Iterable[Edit]) -> list[EdsFinding]:
    text, data = text_of(edits)
    name = "test.dcf" if "FileName=test.dcf" in text else "test.eds"
    return list(check(reader.read(data, name)))


def test_the_base_is_clean() -> None:
    assert found(()) == []


def test_every_rule_has_a_case_and_code() -> None:
    assert {case.rule for case in CASES} | WITHOUT_A_CASE == set(rules())
    assert engine.RULE_FUNCTIONS.keys() <= rules().keys()


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.rule)
def test_a_breach_is_found_at_its_line(case: Case) -> None:
    text, _ = text_of(case.bad)
    hits = [each for each in found(case.bad) if each.rule == case.rule]
    assert hits, [f"{each.line} {each.rule} {each.message}" for each in found(case.bad)]
    assert [(each.line, each.column) for each in hits] == [place(text, case.at)]


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.rule)
def test_values_next_to_a_violation_are_accepted(case: Case) -> None:
    assert [each for each in found(case.near) if each.rule == case.rule] == []


def only(rule: str, *edits: Edit) -> EdsFinding:
    (hit,) = [each for each in found(edits) if each.rule == rule]
    return hit


def test_cases_that_the_standard_leaves_open_are_notes() -> None:
    assert only("V006", "1014:DefaultValue=$NodeID+0x80").severity is Severity.NOTE
    assert only("V006", "1014:DefaultValue=0x80+$NODEID").severity is Severity.WARNING
    assert only("V001", "2005:DataType=0x000C", "2005:DefaultValue=365 43200000").severity is Severity.NOTE


def test_an_uncertain_row_of_the_table_gives_only_a_note() -> None:
    """The sign of 6086h is not certain from public sources, that of 6064h is."""
    assert only("M002", "6086:DataType=0x0006").severity is Severity.NOTE
    assert only("M002", "6064:DataType=0x0007").severity is Severity.WARNING


def test_crossed_limits_are_reported_at_the_limit_that_the_default_contradicts() -> None:
    text = edited("2000:HighLimit=0")  # 1 to 9, default 5
    assert (only("V004", "2000:HighLimit=0").line, 11) == place(text, "2000:HighLimit")
    without_default = ("2000:HighLimit=-1", "2000:LowLimit=0", "2000:DefaultValue", "2000:DataType=0x0004")
    assert (only("V004", *without_default).line, 11) == place(text_of(without_default)[0], "2000:HighLimit")
    text = edited("2000:LowLimit=10")
    assert (only("V004", "2000:LowLimit=10").line, 10) == place(text, "2000:LowLimit")


def test_a_wrong_type_is_one_finding_not_one_for_each_value_that_does_not_fit_it() -> None:
    edits = ("607A:DataType=0x0005", "607A:DefaultValue=-5")  # LowLimit is -1000
    assert [each.rule for each in found(edits)] == ["M002"]


def test_a_value_that_is_wrong_for_either_type_is_reported_in_addition_to_the_type() -> None:
    edits = ("607A:DataType=0x0005", "607A:DefaultValue=far")
    assert {each.rule for each in found(edits)} == {"M002", "V001"}


def test_a_misspelt_key_is_one_finding_and_an_error_if_the_key_is_mandatory() -> None:
    edits = (
        without(
            "[2000]\nParameterName=Gain\nObjectType=0x7\nDataType",
            "[2000]\nParameterName=Gain\nObjectType=0x7\nDataTyp",
        ),
    )
    assert [(each.rule, each.severity) for each in found(edits)] == [("S017", Severity.ERROR)]
    edits = (without("LowLimit=1\nHigh", "LowLimt=1\nHigh"),)
    assert [(each.rule, each.severity) for each in found(edits)] == [("S017", Severity.WARNING)]


def test_the_missing_sub_index_is_named() -> None:
    assert only("O007", "-2003sub2").message.endswith("has 3 sub-indices; sub-index 2 seems to be missing")


@pytest.mark.parametrize("count", ["0xFFFFFFFFFF", "9" * 19])
def test_a_sub_index_zero_beyond_all_bounds_is_checked_in_a_moment(count: str) -> None:
    """It is counted up to 254 (FEh), not to the count in the file."""
    edits = ("2003sub0:DataType=0x001B", f"2003sub0:DefaultValue={count}", "-2003sub2")
    assert "sub-index" not in only("O007", *edits).message.partition(";")[2]


def test_the_object_that_a_list_meant_is_named() -> None:
    (hit,) = found(("ManufacturerObjects:6=0x2050",))
    assert (hit.rule, hit.message.rpartition("; ")[2]) == ("L005", "2005 may be meant")


def test_modes_are_derived_from_their_objects_if_the_file_does_not_claim_any() -> None:
    assert only("M006", "6502:DefaultValue").message.endswith("the objects show pp")


def test_objects_of_a_second_axis_are_checked_like_those_of_the_first() -> None:
    assert only("M002", *SECOND_AXIS, *AXIS_TYPE, "6841:DataType=0x0003").index == 0x6841


def test_a_dcf_is_checked_as_configured_and_as_delivered() -> None:
    configured = (*DCF, "1600sub2:ParameterValue=0x20990020")
    assert only("P002", *configured).line == place(text_of(configured)[0], "1600sub2:ParameterValue")[0]
    delivered = (*DCF, "1600sub2:ParameterValue=0x20000020", "1600sub2:DefaultValue=0x20990020")
    assert only("P002", *delivered).line == place(text_of(delivered)[0], "1600sub2:DefaultValue")[0]


def test_an_input_module_is_not_judged_by_the_table_of_drives() -> None:
    """6064h of a device that is no drive may be anything; that it is mapped against its own PDOMapping is an error all the same."""
    no_drive = (
        "1000:DefaultValue=0x00030191",
        *not_optional(0x6060, 15),
        "6064:PDOMapping=0",
        "6064:DataType=0x0007",
    )
    assert {each.rule for each in found(no_drive)} == {"P004"}


@pytest.mark.parametrize(
    ("rule", "edit", "where"),
    [
        ("V016", "60C2sub1:HighLimit=$NODEID+0xFF", "60C2sub1:HighLimit"),
        ("V003", "60C2sub1:HighLimit=$NODEID+1000", ""),
        ("V003", "2000:LowLimit=$NODEID+5", "2000:DefaultValue"),
        ("V003", "2000:HighLimit=$NODEID+5", ""),
        ("P002", "1600sub1:DefaultValue=$NODEID+0x60400010", "1600sub1:DefaultValue"),
        ("O013", "2004Name:3=Back", "2004Name:3"),
    ],
)
def test_findings_of_formulas_and_names_have_their_line(rule: str, edit: str, where: str) -> None:
    hits = [each for each in found((edit,)) if each.rule == rule]
    assert [each.line for each in hits] == ([place(edited(edit), where)[0]] if where else [])


@pytest.mark.parametrize("given", ["one", "-1", "1.5"])
def test_an_invalid_number_of_pdos_is_reported(given: str) -> None:
    assert only("D006", f"DeviceInfo:NrOfTXPDO={given}").message == f"NrOfTXPDO={given} is not a number"


@pytest.mark.parametrize("key", ["LSS_Supported", "DynamicChannelsSupported", "BaudRate_50", "Granularity"])
def test_every_entry_of_the_device_info_is_missed(key: str) -> None:
    assert only("D001", f"DeviceInfo:{key}").message == f"[DeviceInfo] has no {key}"


SDO_CLIENT = (
    *("OptionalObjects:25=0x1280", "OptionalObjects:SupportedObjects=25"),
    ">[1280]\nParameterName=SDO client\nObjectType=0x9\nSubNumber=4\n\n"
    + "".join(
        f"[1280sub{sub}]\nParameterName={name}\nObjectType=0x7\nDataType=0x{kind:04X}\nAccessType=rw\n{default}PDOMapping=0\n\n"
        for sub, name, kind, default in (
            (0, "Highest sub-index", 5, "DefaultValue=3\n"),
            (1, "COB-ID to the server", 7, ""),
            (2, "COB-ID to the client", 7, ""),
            (3, "Node-ID of the server", 5, ""),
        )
    ),
)


@pytest.mark.parametrize(
    ("edits", "where"),
    [
        (("1200sub1:DataType=0x0006",), "1200sub1"),
        ((*SDO_CLIENT, "1280sub2:DataType=0x0006"), "1280sub2"),
        ((*SDO_CLIENT, "1280sub3:DataType=0x0007"), "1280sub3"),
    ],
)
def test_the_parameters_of_an_sdo_have_their_types(edits: tuple[Edit, ...], where: str) -> None:
    hit = only("C003", *edits)
    assert hit.line == place(text_of(edits)[0], f"{where}:DataType")[0]
    assert found(SDO_CLIENT) == []


def with_object(index: str, kind: int, default: str) -> tuple[Edit, ...]:
    return (
        *(f"OptionalObjects:25=0x{index}", "OptionalObjects:SupportedObjects=25"),
        f">[{index}]\nParameterName=Added\nObjectType=0x7\nDataType=0x{kind:04X}\nAccessType=rw\nDefaultValue={default}\n"
        "PDOMapping=0\n",
    )


@pytest.mark.parametrize(
    ("edits", "rule", "words"),
    [
        (("1005:DefaultValue=$NODEID+0x80",), "C016", "depends on the node ID, but SYNC"),
        (("1005:DefaultValue=0x181",), "", ""),
        (("1005:DefaultValue=0x605",), "C016", "gives the COB-ID 0x605, which"),
        (("1005:DefaultValue=0x1080",), "C016", "more than 11 bits"),
        (("1005:DefaultValue=0x20001080",), "", ""),
        (with_object("1012", 7, "0x80000100"), "", ""),
        (with_object("1012", 7, "0x80000000"), "C016", "without an identifier for TIME"),
        (with_object("1012", 7, "$NODEID+0x100"), "C016", "TIME has one identifier"),
        (("1014:DefaultValue=0x300",), "C016", "has no $NODEID: every node would use 0x300"),
        (("1014:DefaultValue=0x85",), "V007", "for node 5 alone"),
        (("1014:DefaultValue=$NODEID+0x600",), "C016", "gives every node ID a COB-ID such as 0x601"),
        (("1014:DefaultValue=$NODEID+0x780",), "C016", "0x781"),
        (("1014:DefaultValue=$NODEID+0x7F0",), "C016", "0x86F, which has more than 11 bits"),
        (with_object("100E", 7, "$NODEID+0x700"), "", ""),
        (with_object("100E", 7, "$NODEID+0x680"), "C016", "is not $NODEID+0x700"),
        (with_object("100E", 7, "0x700"), "V019", "0x700"),
        (with_object("100E", 7, "0x710"), "V007", "for node 16 alone"),
        (("1800sub1:DefaultValue=$NODEID+0x1180",), "P013", "0x11FF, which has more than 11 bits"),
    ],
)
def test_the_identifier_of_each_service_is_in_its_range(
    edits: tuple[Edit, ...], rule: str, words: str
) -> None:
    hits = found(edits)
    assert [each.rule for each in hits] == ([rule] if rule else [])
    assert all(words in each.message for each in hits)


@pytest.mark.parametrize(
    ("default", "words"),
    [
        ("6", "begins in hm, without any object"),
        ("5", "begins in mode 5, a mode that CiA 402 does not have"),
        ("7", "begins in ip, without"),
    ],
)
def test_a_mode_without_objects_is_reported_if_6502h_is_missing(default: str, words: str) -> None:
    edits = (
        "-6502",
        "OptionalObjects:24",
        "OptionalObjects:SupportedObjects=23",
        f"6060:DefaultValue={default}",
    )
    assert words in only("M011", *edits).message
    assert only("M011", "6060:DefaultValue=5").message.endswith("a mode that CiA 402 does not have")


def test_a_target_without_a_complete_mode_is_reported_if_6502h_is_missing() -> None:
    edits = ("6502:DefaultValue", *with_object("60FF", 4, "0"))
    assert only("M018", *edits).message == (
        "60FF (Target velocity) is there, but pv would need 606C (Velocity actual value) too; "
        "csv would need 606C (Velocity actual value) too"
    )
    assert "M018" not in [each.rule for each in found(with_object("60FF", 4, "0"))]


@pytest.mark.parametrize("spelled", ["0x-3", "0X-3", "-0x-3"])
def test_a_sign_inside_a_number_is_an_error(spelled: str) -> None:
    assert only("V021", f"2003sub1:DefaultValue={spelled}").severity is Severity.ERROR


@pytest.mark.parametrize(
    "at",
    [
        "[6086]",
        "6]\nParameterName=Motion p",
        "sub2]",
        "Interpolation time p",
        "[2003sub1]",
        "[2004]",
        "60400010",
        "cess",
    ],
)
def test_a_file_that_ends_in_the_middle_is_one_finding(at: str) -> None:
    """Behind its lists, wherever it is cut: between sections, in a record, in a line."""
    start = BASE.index("[6040]") if at == "cess" else BASE.index("[1000]")
    cut = BASE[: BASE.index(at, start)]
    hits = [each.rule for each in check(reader.read(cut.encode(), "test.eds"))]
    assert hits == ["S020"]


@pytest.mark.parametrize("lines", range(120, 540, 7))
def test_a_file_cut_anywhere_ends_early_and_has_no_other_errors(lines: int) -> None:
    cut = "\n".join(BASE.split("\n")[:lines])
    hits = [each for each in check(reader.read(cut.encode(), "test.eds")) if each.severity is Severity.ERROR]
    assert [each.rule for each in hits] == ["S020"]


def test_a_file_whose_last_line_has_no_line_end_has_no_finding() -> None:
    assert list(check(reader.read(BASE.rstrip().encode(), "test.eds"))) == []


@pytest.mark.parametrize(
    ("rule", "mapped"),
    [
        ("P002", "0x20990020"),
        ("P003", "0x60640010"),
        ("P004", "0x60810020"),
        ("P005", "0x20020008"),
        ("P010", "0x00070020"),
    ],
)
def test_a_mapping_entry_that_is_not_counted_is_a_note(rule: str, mapped: str) -> None:
    edits = (
        "1A00sub3:DefaultValue=" + mapped,
        "2002:ObjectType=0x7",
        "2002:DataType=0x0005",
        "2002:PDOMapping=1",
    )
    hit = only(rule, *edits)
    assert (hit.severity, "[1A00sub3], not active, maps" in hit.message) == (Severity.NOTE, True)
    assert only(rule, *edits, "1A00sub0:DefaultValue=3").severity is not Severity.NOTE


def test_a_pdo_that_waits_to_be_configured_carries_nothing_yet() -> None:
    empty = ("1A00sub0:DefaultValue=0", "1800sub1:DefaultValue=$NODEID+0x80000180")
    assert only("P016", "1A00sub0:DefaultValue=0").severity is Severity.WARNING
    assert only("P016", *empty).severity is Severity.NOTE


PDOS_OF_V3 = (
    *("OptionalObjects:25=0x1004", "OptionalObjects:SupportedObjects=25"),
    ">[1004]\nParameterName=Number of PDOs supported\nObjectType=0x8\nSubNumber=2\n\n"
    "[1004sub0]\nParameterName=Synchronous\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\nDefaultValue=0x00040004\nPDOMapping=0\n\n"
    "[1004sub1]\nParameterName=Asynchronous\nObjectType=0x7\nDataType=0x0007\nAccessType=ro\nPDOMapping=0\n\n",
)


def test_the_number_of_pdos_of_an_older_device_is_no_highest_sub_index() -> None:
    """1004h of DS 301 V3: UNSIGNED32 in sub-index 0, with the PDOs by SYNC in its two words."""
    assert found(PDOS_OF_V3) == []
    assert only("O009", *PDOS_OF_V3, "1004sub0:DataType=0x0005").severity is Severity.ERROR


def test_an_eds_read_from_a_device_contradicts_no_default() -> None:
    assert [each.rule for each in found((*DCF, "1018sub2:ParameterValue=7", "1001:ParameterValue=0"))] == []


def test_the_node_ids_with_which_a_cob_id_collides_are_named() -> None:
    said = only("P013", "1800sub1:DefaultValue=$NODEID+0x600").message
    assert "gives every node ID a COB-ID such as 0x601 (node 1), which CiA 301 keeps" in said
    said = only("P013", "1800sub1:DefaultValue=$NODEID+0x6B0").message
    assert "gives the node IDs 48 to 79, 81 to 127 a COB-ID such as 0x6E0" in said
    assert (
        "gives node ID 127 a COB-ID such as 0x581"
        in only("P013", "1800sub1:DefaultValue=$NODEID+0x502").message
    )
    assert "gives the COB-ID 0x605, which" in only("P013", "1800sub1:DefaultValue=0x605").message


def test_one_key_belongs_and_two_belong() -> None:
    assert "DataType belongs to its" in only("O022", "2003:DataType=0x0007").message
    assert (
        "DataType and AccessType belong to its"
        in only("O022", "2003:AccessType=rw", "2003:DataType=7").message
    )


def test_a_number_twice_in_a_list_is_to_be_numbered_again_as_fix_does() -> None:
    assert (
        "renumber the entries (axisbus eds fix does this)"
        in only("S004", "ManufacturerObjects>6=0x2005").remedy
    )


def test_a_word_that_cannot_be_mapped_is_a_note() -> None:
    assert only("M005", "6060:PDOMapping=0").severity is Severity.NOTE


def test_a_word_that_is_mapped_and_cannot_be_is_an_error_at_the_word() -> None:
    hit = only("P004", "6064:PDOMapping=0")
    text = edited("6064:PDOMapping=0")
    assert (hit.severity, hit.line) == (Severity.ERROR, place(text, "6064:PDOMapping")[0])
    assert [each.rule for each in found(("6064:PDOMapping=0",))] == ["P004"]


def test_the_rules_do_not_depend_on_docstrings():
    """An interpreter that removes them (-OO) finds the same."""
    program = "import sys; from axisbus.eds.rules import engine; print(*sorted(engine.RULE_FUNCTIONS))"
    found = [
        subprocess.run(
            [sys.executable, *options, "-c", program], capture_output=True, text=True, check=True
        ).stdout.split()
        for options in ((), ("-OO",))
    ]
    assert found[0] == found[1] == sorted(engine.RULE_FUNCTIONS)
    assert len(found[0]) > 100
