"""Objects from sections: present and missing entries, and the deviations of real files."""

from __future__ import annotations

import random
from pathlib import Path

import pytest

from axisbus.cia301.datatypes import DataType
from axisbus.eds import Number, ObjectType, Severity, loads
from axisbus.eds.io import reader
from kit.eds.texts import HEAD, HEAD_LINES, only, read, record, rules, variable

EDS_FOLDER = Path(__file__).parents[2] / "eds"


def test_a_plain_variable_has_all_keys_of_its_section() -> None:
    eds = read(
        "[6081]\nParameterName=Profile velocity\nObjectType=0x7\nDataType=0x0007\nAccessType=rww\n"
        "DefaultValue=1000\nPDOMapping=1\nLowLimit=1\nHighLimit=5000\nObjFlags=0x1\n"
    )
    entry = eds.get(0x6081)
    assert entry is not None
    assert (entry.index, entry.subindex, entry.name) == (0x6081, 0, "Profile velocity")
    assert (entry.data_type, entry.access, entry.default) == (DataType.UNSIGNED32, "rww", Number(1000))
    assert (entry.low, entry.high) == (Number(1), Number(5000))
    assert (entry.pdo_mapping, entry.object_flags, entry.line) == (True, 1, HEAD_LINES + 1)
    assert (entry.readable, entry.writable, entry.bits) == (True, True, 32)
    assert eds.findings == ()


def test_a_record_has_its_sub_indices_in_order() -> None:
    eds = read(record("6099", variable("6099sub2"), variable("6099Sub0", DataType="5"), variable("6099SUB1")))
    entry = eds.objects[0x6099]
    assert entry.object_type is ObjectType.RECORD
    assert entry.is_record
    assert list(entry.subs) == [0, 1, 2]
    assert entry.subs[0].data_type is DataType.UNSIGNED8
    assert eds.findings == ()


def test_sub_indices_are_hexadecimal() -> None:
    eds = read(record("2000", variable("2000sub10"), variable("2000subA"), variable("2000subFE")))
    assert list(eds.objects[0x2000].subs) == [0x0A, 0x10, 0xFE]


def test_objects_are_ordered_by_index_for_any_order_in_the_file() -> None:
    eds = read(variable("6040") + variable("2000") + variable("1005"))
    assert [entry.index for entry in eds] == [0x1000, 0x1005, 0x2000, 0x6040]


def test_a_sub_index_before_its_parent_is_no_matter() -> None:
    eds = read(variable("2000sub1") + record("2000"))
    assert eds.get(0x2000, 1) is not None
    assert eds.findings == ()


def test_a_sub_index_without_parent_makes_a_record() -> None:
    eds = read(variable("2000sub1"))
    assert eds.objects[0x2000].object_type is ObjectType.RECORD
    assert eds.get(0x2000, 1) is not None
    finding = only(eds)
    assert (finding.rule, finding.severity, finding.index) == ("O005", Severity.ERROR, 0x2000)


def test_a_leading_zero_in_a_sub_index_is_read_and_reported() -> None:
    eds = read(record("2000", variable("2000sub0A"), variable("2000subA")))
    assert list(eds.objects[0x2000].subs) == [0x0A]
    assert rules(eds) == ["O012", "S003"]


def test_without_object_type_an_object_is_a_variable() -> None:
    eds = read("[2000]\nParameterName=A\nDataType=7\nAccessType=rw\n")
    assert eds.objects[0x2000].object_type is ObjectType.VAR
    assert eds.findings == ()


def test_without_object_type_sub_indices_make_a_record() -> None:
    eds = read("[2000]\nParameterName=A\n\n" + variable("2000sub1"))
    assert eds.objects[0x2000].object_type is ObjectType.RECORD
    assert rules(eds) == ["O006"]


def test_a_variable_with_sub_indices_stays_a_variable() -> None:
    eds = read(variable("2000") + variable("2000sub1"))
    assert list(eds.objects[0x2000].subs) == [0]
    finding = only(eds)
    assert (finding.rule, finding.line) == ("O011", HEAD_LINES + 3)


def test_a_domain_needs_neither_type_nor_access() -> None:
    eds = read("[1F50]\nParameterName=Program\nObjectType=0x2\n")
    entry = eds.get(0x1F50)
    assert entry is not None
    assert (entry.data_type, entry.access, entry.object_type) == (DataType.DOMAIN, "rw", ObjectType.DOMAIN)
    assert eds.findings == ()


@pytest.mark.parametrize(
    ("body", "rule", "line"),
    [
        ("[2000]\nDataType=7\nAccessType=rw\n", "O001", 1),
        ("[2000]\nParameterName=A\nAccessType=rw\n", "O002", 1),
        ("[2000]\nParameterName=A\nDataType=\nAccessType=rw\n", "O002", 3),
        ("[2000]\nParameterName=A\nDataType=UNSIGNED8\nAccessType=rw\n", "O002", 3),
        ("[2000]\nParameterName=A\nDataType=0x0E\nAccessType=rw\n", "O002", 3),
        ("[2000]\nParameterName=A\nDataType=7\n", "O003", 1),
        ("[2000]\nParameterName=A\nDataType=7\nAccessType=read\n", "O003", 4),
        ("[2000]\nParameterName=A\nDataType=7\nAccessType=rw\nObjectType=variable\n", "O004", 5),
        ("[2000]\nParameterName=A\nDataType=7\nAccessType=rw\nObjectType=0x77\n", "O004", 5),
        ("[2000]\nParameterName=A\nDataType=7\nAccessType=rw\nPDOMapping=maybe\n", "V001", 5),
        ("[2000]\nParameterName=A\nDataType=7\nAccessType=rw\nLowLimit=4\nHighLimit=x\n", "V001", 6),
        ("[2000]\nParameterName=A\nDataType=7\nAccessType=rw # rw\n", "S011", 4),
    ],
)
def test_a_missing_or_wrong_entry_is_read_with_a_finding(body: str, rule: str, line: int) -> None:
    eds = read(body)
    finding = only(eds)
    assert eds.get(0x2000) is not None
    assert (finding.rule, finding.line, finding.index) == (rule, HEAD_LINES + line, 0x2000)
    assert finding.message
    assert finding.remedy


def test_a_value_that_is_not_understood_is_absent_and_points_to_itself() -> None:
    eds = read(variable("2000", DefaultValue="   4x0"))
    entry = eds.get(0x2000)
    assert entry is not None
    assert entry.default is None
    finding = only(eds)
    assert (finding.rule, finding.line, finding.column) == ("V001", HEAD_LINES + 6, 17)
    assert finding.message == "[2000] DefaultValue: 4x0 is not an integer"


def test_a_type_that_the_file_defines_means_its_base_type() -> None:
    limited = "[A0]\nParameterName=Limited\nObjectType=5\n\n" + variable(
        "A0sub1", DefaultValue="0x0006", DataType="5"
    )
    eds = read(variable("2000", DataType="0x00A0", DefaultValue="12") + limited)
    entry = eds.get(0x2000)
    assert entry is not None
    assert (entry.data_type, entry.default) == (DataType.UNSIGNED16, Number(12))


def test_a_wrong_type_is_kept_as_in_the_file() -> None:
    eds = read(variable("60FF", DataType="0x0007", DefaultValue="4294967295"))
    entry = eds.get(0x60FF)
    assert entry is not None
    assert (entry.data_type, entry.default) == (DataType.UNSIGNED32, Number(4294967295))


def test_a_dcf_has_values_names_and_a_node() -> None:
    eds = read(
        "[DeviceComissioning]\nNodeID=0x0C\nNodeName=left axis\nBaudrate=500\n\n"
        + variable("6081", DefaultValue="10", ParameterValue="250", Denotation="cruise")
        + variable("1400", DataType="7", ParameterValue="$NODEID+0x200")
    )
    speed, cob = eds.get(0x6081), eds.get(0x1400)
    assert speed is not None
    assert cob is not None
    assert eds.node_id == 12
    assert (speed.default, speed.parameter_value, speed.denotation) == (Number(10), Number(250), "cruise")
    assert (speed.initial(12), cob.initial(12)) == (250, 0x20C)
    assert eds.info["devicecomissioning"]["nodename"] == "left axis"
    assert eds.findings == ()


def test_the_other_spelling_of_commissioning_is_read_and_reported() -> None:
    eds = read("[DeviceCommissioning]\nNodeID=3\n")
    assert eds.node_id == 3
    assert only(eds).rule == "K001"


@pytest.mark.parametrize("node_id", ["0", "128", "", "x", "$NODEID"])
def test_an_invalid_node_id_is_reported(node_id: str) -> None:
    eds = read(f"[DeviceComissioning]\nNodeID={node_id}\n")
    assert eds.node_id is None
    assert only(eds).rule == "K003"


def test_dummies_are_those_that_the_file_allows() -> None:
    assert read("[DummyUsage]\nDummy0002=1\nDummy0005=1\nDummy0007=0\n").dummies == {2, 5}
    assert read("").dummies == frozenset()


def test_entries_are_found_by_name_in_any_case() -> None:
    eds = read(
        variable("6040", ParameterName="Controlword")
        + record("6099", variable("6099sub1", ParameterName="Fast"))
    )
    word, speed = eds.find(" controlWORD"), eds.find("record.fast")
    assert word is not None
    assert speed is not None
    assert (word.index, speed.index, speed.subindex) == (0x6040, 0x6099, 1)
    assert eds.find("nothing") is None


def test_the_identity_is_that_of_1018_or_else_of_the_device_information() -> None:
    described = record(
        "1018", variable("1018sub1", DefaultValue="0xC0B00"), variable("1018sub2", DefaultValue="0")
    )
    eds = loads(
        (HEAD.replace("VendorNumber=1", "VendorNumber=1\nProductNumber=0x20") + described).encode(), "x.eds"
    )
    assert (eds.identity.vendor_id, eds.identity.product_code, eds.identity.revision) == (0xC0B00, 0x20, None)


def test_every_finding_has_a_line_a_reason_and_a_remedy() -> None:
    eds = read(
        "x\n"
        + variable("2000", DefaultValue="-1", LowLimit="5", HighLimit="1")
        + variable("2000sub1")
        + "[Odd]\n"
    )
    assert rules(eds) == ["S006", "O011", "V009", "V004", "S012"]
    assert [finding.line for finding in eds.findings] == [HEAD_LINES + line for line in (1, 4, 7, 8, 17)]
    assert all(finding.message and finding.remedy and finding.column >= 1 for finding in eds.findings)


ZEROS = {"LowLimit": "0", "HighLimit": "0"}


@pytest.mark.parametrize(
    ("data_type", "default", "kept"),
    [("0x3", "0", True), ("7", "0x00", True), ("0x8", "0.0", True), ("0x3", "5", False), ("0x3", "", False)],
)
def test_limits_of_zero_apply_with_a_default_of_zero(data_type: str, default: str, kept: bool) -> None:
    """As of 6086h, which has one profile, and 1003h:00, to which only 0 is written; else they are an editor's way to say none."""
    eds = read(variable("6086", DataType=data_type, DefaultValue=default, **ZEROS))
    low, high = eds.objects[0x6086].subs[0].low, eds.objects[0x6086].subs[0].high
    plain = [getattr(limit, "value", limit) for limit in (low, high)]
    assert plain == ([0, 0] if kept else [None, None])
    assert ("V018" in [finding.rule for finding in eds.findings]) is not kept


def test_limits_of_zero_mean_no_limit_in_a_file_that_uses_them_with_other_defaults() -> None:
    body = "".join(
        variable(f"20{number:02}", DataType="7", DefaultValue=str(number), **ZEROS) for number in (0, 1, 2)
    )
    eds = read(body)
    assert [eds.objects[index].subs[0].high for index in (0x2000, 0x2001, 0x2002)] == [None] * 3
    assert [finding.rule for finding in eds.findings] == ["V018"] * 3


def test_entries_that_differ_in_name_alone_are_distinguished_by_name_and_line() -> None:
    bodies = [variable("2000", ParameterName="A"), variable("2001", ParameterName=" B "), variable("2002")]
    eds = read("".join(bodies))
    first, second, third = (eds.objects[index] for index in (0x2000, 0x2001, 0x2002))
    assert [entry.name for entry in (first, second, third)] == ["A", "B", "Thing"]
    assert [entry.subs[0].name for entry in (first, second, third)] == ["A", "B", "Thing"]
    assert [entry.subs[0].index for entry in (first, second, third)] == [0x2000, 0x2001, 0x2002]
    lines = [entry.line for entry in (first, second, third)]
    assert lines == [HEAD_LINES + 1 + number * bodies[0].count("\n") for number in range(3)]
    assert [entry.subs[0].line for entry in (first, second, third)] == lines


def test_the_meaning_of_a_section_depends_on_its_position() -> None:
    text = "ParameterName=x\nObjectType=0x8\nDataType=0x0007\nAccessType=rw\n"
    untyped = text.replace("ObjectType=0x8\n", "")
    body = f"[2000]\n{text}[2000sub1]\n{text}[2001]\n{text}[2001sub1]\n{text}[2002]\n{text}"
    body += f"[2003]\n{untyped}[2004]\n{untyped}[2004sub1]\n{untyped}[2005]\n{untyped}[2006]\n{untyped}[2006sub1]\n{untyped}"
    eds = read(body)
    kinds = {index: eds.objects[index].object_type for index in range(0x2000, 0x2007)}
    assert [kinds[index] for index in (0x2000, 0x2001, 0x2002)] == [ObjectType.ARRAY] * 3
    assert [kinds[index] for index in (0x2003, 0x2005)] == [ObjectType.VAR] * 2
    assert [kinds[index] for index in (0x2004, 0x2006)] == [ObjectType.RECORD] * 2
    assert [list(eds.objects[index].subs) for index in (0x2001, 0x2002, 0x2003)] == [[1], [], [0]]
    assert {eds.objects[index].subs[1].object_type for index in (0x2000, 0x2001, 0x2004)} == {ObjectType.VAR}


def test_arrays_of_one_text_each_have_their_own_compact_entries() -> None:
    text = "ParameterName=x\nObjectType=0x8\nDataType=0x0007\nAccessType=rw\nCompactSubObj=2\n"
    own = "ParameterName=own\nDataType=0x0005\nAccessType=ro\n"
    eds = read(f"[2000]\n{text}[2000sub1]\n{own}[2001]\n{text}[2001sub2]\n{own}")
    names = [[sub.name for sub in eds.objects[index].subs.values()] for index in (0x2000, 0x2001)]
    assert names == [["NrOfObjects", "own", "x2"], ["NrOfObjects", "x1", "own"]]


def test_a_defect_in_repeated_sections_is_found_in_each() -> None:
    indices = [0x2000, 0x2001, 0x2002]
    eds = read("".join(variable(f"{index:04X}", DefaultValue="0x1FFFFFFFF") for index in indices))
    assert [entry.subs[0].default for entry in eds][1:] == [None] * 3
    assert [(found.rule, found.index) for found in eds.findings] == [("V005", index) for index in indices]


# Lines for sections that are alike in all sorts of ways, and in some only seem to be.
LINES = (
    *(
        "ParameterName=A",
        "ParameterName=B",
        " parametername=C",
        "ObjectType=0x7",
        "ObjectType=0x8",
        "ObjectType=2",
        "ObjectType=9",
    ),
    *(
        "DataType=0x0007",
        "DataType=0x0003",
        "DataType=9",
        "AccessType=rw",
        "AccessType=ro",
        "CompactSubObj=2",
        "SubNumber=1",
    ),
    *(
        "DefaultValue=0",
        "DefaultValue=5",
        "DefaultValue=",
        "defaultvalue=7",
        "DefaultValue =8",
        ";DefaultValue=9",
        "XDefaultValue=1",
    ),
    *(
        "LowLimit=0",
        "HighLimit=0",
        "LowLimit=1",
        "HighLimit=9",
        "ParameterValue=3",
        "Denotation=x",
        "PDOMapping=1",
        "Other=4",
        "",
    ),
)


def alike(seed: int) -> bytes:
    """Return a file of sections of few different lines."""
    chosen = random.Random(seed)
    pool = chosen.sample(LINES, 9)
    text = HEAD
    for index in range(0x2000, 0x2010):
        subs = ["", *(f"sub{number}" for number in range(chosen.randrange(3)))]
        for sub in subs[chosen.random() < 0.1 and len(subs) > 1 :]:
            body = [chosen.choice(pool) for _ in range(chosen.randrange(6))]
            text += "\n".join([f"[{index:04X}{sub}]", "ParameterName=N", *body, ""])
    return text.encode()


@pytest.mark.parametrize("seed", range(0, 400, 50))
def test_objects_are_the_same_with_and_without_the_findings(seed: int) -> None:
    """Reading with findings parses every section; reading without them copies equal ones."""
    for number in range(seed, seed + 50):
        looked_at, checked = (reader.read(alike(number), "test.eds").eds for _ in range(2))
        assert checked.findings is not None
        for entry, same in zip(looked_at, checked, strict=True):
            assert (entry, dict(entry.subs)) == (same, dict(same.subs)), number


@pytest.mark.parametrize("name", ["generic-cia402.eds", "gim6010-8.eds"])
def test_objects_of_our_files_are_the_same_with_and_without_the_findings(name: str) -> None:
    data = (EDS_FOLDER / name).read_bytes()
    looked_at, checked = (reader.read(data, name).eds for _ in range(2))
    one_by_one = list(looked_at)
    assert checked.findings is not None
    assert one_by_one == list(checked)


@pytest.mark.parametrize("sub", ["", "sub1"])
def test_of_two_defaults_in_sections_that_are_alike_the_first_counts(sub: str) -> None:
    bodies = {
        0x2000: "defaultvalue=7\nDefaultValue=1\n",
        0x2001: "defaultvalue=7\nDefaultValue=2\n",
        0x2002: "DefaultValue=3\ndefaultvalue=7\n",
        0x2003: "DefaultValue=4\ndefaultvalue=7\n",
        0x2004: ";DefaultValue=5\n",
        0x2005: ";DefaultValue=6\n",
        0x2006: "",
    }
    parts = {index: f"ParameterName=x\nDataType=7\nAccessType=rw\n{body}" for index, body in bodies.items()}
    heads = {index: f"[{index:04X}]\nParameterName=x\nObjectType=9\n" if sub else "" for index in parts}
    eds = read("".join(f"{heads[index]}[{index:04X}{sub}]\n{part}" for index, part in parts.items()))
    found = [eds.objects[index].subs[1 if sub else 0].default for index in bodies]
    assert found == [Number(7), Number(7), Number(3), Number(4), None, None, None]


@pytest.mark.parametrize("sub", ["", "sub1"])
@pytest.mark.parametrize("first", [0, 5])
def test_limits_of_zero_follow_the_default_of_their_own_section(sub: str, first: int) -> None:
    indices = {0x2000: first, 0x2001: 5 - first, 0x2002: 0}
    limited = "ParameterName=x\nDataType=7\nAccessType=rw\nLowLimit=0\nHighLimit=0\nDefaultValue="
    heads = {index: f"[{index:04X}]\nParameterName=x\nObjectType=9\n" if sub else "" for index in indices}
    eds = read(
        "".join(f"{heads[at]}[{at:04X}{sub}]\n{limited}{default}\n" for at, default in indices.items())
    )
    found = [eds.objects[index].subs[1 if sub else 0] for index in indices]
    limits = {0: (Number(0), Number(0)), 5: (None, None)}
    assert [(entry.low, entry.high) for entry in found] == [limits[default] for default in indices.values()]
