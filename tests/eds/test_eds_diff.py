"""Two files compared: equal meanings are no difference, and each change is found once, in its group, with its effect."""

from __future__ import annotations

import random
import re
from itertools import pairwise

import pytest

import axisbus.eds
from axisbus.eds import Eds, EdsDifference, diff, load, loads
from axisbus.eds.report import compare
from axisbus.eds.report.consequences import DifferenceGroup
from kit.eds.samples import BUILTIN, CORPUS, STATUS, communication, mapped, small, small_text
from kit.eds.texts import record, variable


def only(a: str | Eds, b: str | Eds, node_id: int | None = None) -> EdsDifference:
    """Return the one difference that there must be between two drives."""
    one, other = (small(each) if isinstance(each, str) else each for each in (a, b))
    found = diff(one, other, node_id)
    assert len(found) == 1, found
    return found[0]


def entry(**keys: str) -> str:
    return variable("2000", ParameterName="Thing", DataType=keys.pop("DataType", "0x6"), **keys)


@pytest.mark.parametrize(
    ("a", "b"),
    [
        ({"DefaultValue": "10"}, {"DefaultValue": "0x0A"}),
        ({"DefaultValue": "10"}, {"DefaultValue": "012"}),  # octal
        ({"DefaultValue": "0x0a"}, {"DefaultValue": "0x000A"}),
        ({"DataType": "0x3", "DefaultValue": "-1"}, {"DataType": "3", "DefaultValue": "0xFFFF"}),
        (
            {"DataType": "0x7", "DefaultValue": "$NODEID+0x600"},
            {"DataType": "7", "DefaultValue": "0x600+$NodeId"},
        ),
        ({"DataType": "0x8", "DefaultValue": "1.50"}, {"DataType": "0x8", "DefaultValue": "1.5"}),
        ({"AccessType": "RW"}, {"AccessType": "rw"}),
        ({"LowLimit": "0", "HighLimit": "0x10"}, {"LowLimit": "0x0", "HighLimit": "16"}),
        ({"PDOMapping": "0"}, {}),
        ({"ObjFlags": "0x0"}, {}),
    ],
)
def test_another_spelling_of_the_same_value_is_no_difference(a: dict[str, str], b: dict[str, str]) -> None:
    assert diff(small(entry(**a)), small(entry(**b))) == ()


def test_order_case_and_comments_are_no_difference() -> None:
    text = small_text(STATUS + entry(DefaultValue="1"))
    sections = re.split(r"(?=^\[)", text, flags=re.MULTILINE)
    random.Random(5).shuffle(sections)
    turned = "; mixed\n" + "".join(sections).replace("DefaultValue", "defaultvalue").replace(
        "1A00sub", "1a00SUB"
    )
    assert diff(loads(text.encode(), "a.eds"), loads(turned.encode(), "b.eds")) == ()


def test_dates_and_file_names_describe_the_file_and_not_the_device() -> None:
    stamped = small("[FileInfo]\nFileName=old.eds\nModificationDate=01-01-2020\n")
    assert diff(stamped, small("[FileInfo]\nFileName=new.eds\nModificationDate=01-01-2024\n")) == ()


def test_a_formula_is_its_value_only_for_a_node() -> None:
    formula, fixed = communication("1800", "$NODEID+0x180"), communication("1800", "0x185")
    assert diff(small(formula), small(fixed), 5) == ()
    found = only(formula, fixed)
    assert (found.group, found.index, found.subindex) == (DifferenceGroup.PDO, 0x1800, 1)
    assert (found.a, found.b) == ("$NODEID+0x180", "0x00000185")
    assert len(diff(small(formula), small(fixed), 6)) == 1


def test_a_changed_mapping_is_one_difference_with_removed_and_added_objects() -> None:
    head = communication("1800", "$NODEID+0x180")
    found = only(
        head + mapped("1A00", "0x60410010", "0x60610008"), head + mapped("1A00", "0x60410010", "0x60640020")
    )
    assert (found.group, found.what, found.index) == (DifferenceGroup.PDO, "TPDO1 mapping", 0x1A00)
    assert found.a == "6041:00/16 Statusword, 6061:00/8 Mode display"
    assert found.b == "6041:00/16 Statusword, 6064:00/32 Position"
    assert found.matters.startswith("TPDO1 no longer carries 6061 and now carries 6064")


def test_the_same_objects_in_another_order_are_a_changed_mapping() -> None:
    head = communication("1800", "$NODEID+0x180")
    found = only(
        head + mapped("1A00", "0x60410010", "0x60610008"), head + mapped("1A00", "0x60610008", "0x60410010")
    )
    assert "carries the same in another order" in found.matters


def test_a_mapping_entry_beyond_the_count_is_an_ordinary_default() -> None:
    head = communication("1800", "$NODEID+0x180")
    used = mapped("1A00", "0x60410010", "0x60610008", count="1")
    found = only(head + used, head + mapped("1A00", "0x60410010", "0x60640020", count="1"))
    assert (found.index, found.subindex, found.matters) == (0x1A00, 2, "")


@pytest.mark.parametrize(
    ("a", "b", "meaning"),
    [
        (("$NODEID+0x180", "255"), ("$NODEID+0x80000180", "255"), "now switched off"),
        (("$NODEID+0x80000180", "255"), ("$NODEID+0x180", "255"), "now switched on"),
        (("$NODEID+0x180", "255"), ("$NODEID+0x280", "255"), "travels under another identifier"),
        (("$NODEID+0x180", "255"), ("$NODEID+0x180", "1"), "now synchronous"),
        (("$NODEID+0x180", "1"), ("$NODEID+0x180", "254"), "no longer synchronous"),
        (("$NODEID+0x180", "1"), ("$NODEID+0x180", "4"), "comes at other times"),
    ],
)
def test_the_meaning_of_a_changed_pdo_parameter(a: tuple[str, str], b: tuple[str, str], meaning: str) -> None:
    found = only(communication("1800", *a), communication("1800", *b))
    assert (found.group, found.matters) == (DifferenceGroup.PDO, meaning)


def test_other_claimed_modes_are_named() -> None:
    def modes(word: str) -> str:
        return variable("6502", ParameterName="Supported drive modes", AccessType="ro", DefaultValue=word)

    # CiA 402-2: bit 0 pp, bit 2 pv, bit 5 hm, bit 7 csp.
    found = diff(small(modes("0x0A1")), small(modes("0x025")))
    assert [(each.what, each.a, each.b) for each in found if each.index is None] == [
        ("modes no longer claimed (6502h)", "csp", ""),
        ("modes newly claimed (6502h)", "", "pv"),
    ]
    assert all(each.group is DifferenceGroup.IDENTITY for each in found)
    assert found[0].matters == "commands that use these modes will be refused"


@pytest.mark.parametrize(
    ("a", "b", "group", "matters"),
    [
        ({"AccessType": "rw"}, {"AccessType": "ro"}, DifferenceGroup.TYPES, "can no longer be written"),
        ({"AccessType": "ro"}, {"AccessType": "rw"}, DifferenceGroup.TYPES, "can now be written"),
        ({"AccessType": "rw"}, {"AccessType": "wo"}, DifferenceGroup.TYPES, "can no longer be read"),
        (
            {"DataType": "0x6"},
            {"DataType": "0x7"},
            DifferenceGroup.TYPES,
            "transfers of the other size are refused",
        ),
        ({"DataType": "0x6"}, {"DataType": "0x3"}, DifferenceGroup.TYPES, "with or without a sign"),
        ({"PDOMapping": "1"}, {"PDOMapping": "0"}, DifferenceGroup.TYPES, "can no longer be mapped"),
        ({"PDOMapping": "0"}, {"PDOMapping": "1"}, DifferenceGroup.TYPES, ""),
        (
            {"HighLimit": "100"},
            {"HighLimit": "90"},
            DifferenceGroup.LIMITS,
            "values that were allowed may be refused",
        ),
        ({"HighLimit": "100"}, {"HighLimit": "200"}, DifferenceGroup.LIMITS, ""),
        ({}, {"LowLimit": "1"}, DifferenceGroup.LIMITS, "values that were allowed may be refused"),
        ({"LowLimit": "1"}, {}, DifferenceGroup.LIMITS, ""),
        ({"DefaultValue": "1"}, {"DefaultValue": "2"}, DifferenceGroup.DEFAULTS, ""),
        ({"DefaultValue": "1"}, {}, DifferenceGroup.DEFAULTS, ""),
    ],
)
def test_a_change_of_one_fact_is_one_difference_in_its_group(
    a: dict[str, str], b: dict[str, str], group: DifferenceGroup, matters: str
) -> None:
    found = only(entry(**a), entry(**b))
    assert (found.group, found.index) == (group, 0x2000)
    assert found.matters.startswith(matters) if not matters else matters in found.matters
    assert bool(found.matters) == bool(matters)
    line = small_text("").count("\n") + 1
    assert (found.line_a, found.line_b) == (line, line)


@pytest.mark.parametrize(
    ("section", "a", "b", "matters"),
    [
        ("605A", "2", "0", "quick stop: brakes on the quick-stop ramp, then power off -> the motor coasts"),
        ("6085", "100", "200", "a quick stop needs another distance and time"),
        ("6065", "100", "200", "another following error leads to a fault"),
        ("6080", "3000", "1000", "another default limit of motion or torque"),
        ("1017", "0", "100", "how soon the master notices a dead drive"),
        ("1005", "0x80", "0x40000080", "now produces SYNC itself"),
        (
            "685A",
            "2",
            "6",
            "quick stop: brakes on the quick-stop ramp, then power off -> brakes on the quick-stop ramp",
        ),
    ],
)
def test_differences_in_defaults_that_a_master_relies_on_are_marked(
    section: str, a: str, b: str, matters: str
) -> None:
    found = only(variable(section, DefaultValue=a), variable(section, DefaultValue=b))
    assert found.matters.startswith(matters)


def test_another_identity_is_refused_by_a_master_that_checks_it() -> None:
    def identity(product: str) -> str:
        return record(
            "1018", variable("1018sub2", ParameterName="Product code", AccessType="ro", DefaultValue=product)
        )

    found = only(identity("0x11"), identity("0x12"))
    assert (found.group, found.a, found.b) == (DifferenceGroup.IDENTITY, "0x00000011", "0x00000012")
    assert "refuses" in found.matters


def test_added_and_removed_objects_and_sub_indices() -> None:
    two = record("2100", variable("2100sub1", ParameterName="One"), variable("2100sub2", ParameterName="Two"))
    one = record("2100", variable("2100sub1", ParameterName="One"))
    gone = only(two, one)
    assert (gone.group, gone.index, gone.subindex, gone.a, gone.b) == (
        DifferenceGroup.REMOVED,
        0x2100,
        2,
        "UNSIGNED32 rw",
        "",
    )
    assert gone.line_a > 0
    assert gone.line_b == 0
    come = only("", two)
    assert (come.group, come.index, come.subindex, come.b) == (
        DifferenceGroup.ADDED,
        0x2100,
        None,
        "RECORD with 2 sub-indices",
    )


def test_a_variable_that_became_an_array_is_one_difference() -> None:
    array = record("2000", variable("2000sub0", DataType="0x5"), variable("2000sub1"), kind="0x8")
    found = only(variable("2000", ParameterName="Record"), array)
    assert (found.what, found.a, found.b) == ("Record: ObjectType", "VAR", "ARRAY")
    assert found.matters == "its values are under other sub-indices"


def test_a_removed_object_that_a_mode_or_a_pdo_needs_is_marked() -> None:
    target = variable("607A", ParameterName="Target position", DataType="0x4", PDOMapping="1")
    assert only(target, "").matters == "needed by pp csp"
    carried = communication("1800", "$NODEID+0x180") + mapped("1A00", "0x20000020")
    removed = only(carried + variable("2000", PDOMapping="1"), carried)
    assert (removed.group, removed.matters) == (DifferenceGroup.REMOVED, "TPDO1 carried it")


def test_a_renamed_object_is_a_difference_that_does_not_matter() -> None:
    found = only(variable("2000", ParameterName="Old"), variable("2000", ParameterName="New"))
    assert (found.group, found.a, found.b, found.matters) == (DifferenceGroup.NAMES, "Old", "New", "")


def test_a_device_that_lost_a_bit_rate() -> None:
    slower = loads(small_text("").replace("BaudRate_500=1", "BaudRate_500=0").encode(), "b.eds")
    found = only(small(""), slower)
    assert (found.group, found.what, found.a, found.b) == (DifferenceGroup.IDENTITY, "BaudRate_500", "1", "0")
    assert found.matters


def test_two_dcfs_for_different_nodes() -> None:
    def dcf(node_id: str, spelling: str) -> Eds:
        return small(f"[{spelling}]\nNodeID={node_id}\nBaudrate=500\n")

    found = only(dcf("5", "DeviceComissioning"), dcf("0x6", "DeviceCommissioning"))
    assert (found.group, found.what, found.a, found.b) == (
        DifferenceGroup.IDENTITY,
        "DCF: NodeID",
        "5",
        "0x6",
    )
    assert diff(dcf("5", "DeviceComissioning"), dcf("0x05", "DeviceComissioning")) == ()
    assert diff(dcf("5", "DeviceComissioning"), small("")) == ()


def test_a_device_that_no_longer_takes_dummies_in_its_pdos() -> None:
    without = loads(small_text("").replace("Dummy0005=1", "Dummy0005=0").encode(), "b.eds")
    found = only(small(""), without)
    assert (found.what, found.a, found.b) == ("DummyUsage", "BOOLEAN, UNSIGNED8", "BOOLEAN")


@pytest.mark.parametrize("path", BUILTIN, ids=lambda path: path.stem)
def test_one_changed_line_in_a_real_drive_is_one_difference_at_that_line(path) -> None:
    """The oracle is the edit itself: a default of a plain object is raised by one in the text."""
    text = path.read_text()
    lines = text.splitlines(keepends=True)
    places = [
        at
        for at, line in enumerate(lines)
        if re.fullmatch(r"DefaultValue=\d+\n", line) and not re.search(r"\[1[468A]", _section(lines, at))
    ]
    whole = loads(text.encode(), "a.eds")
    for at in random.Random(7).sample(places, 12):
        value = int(lines[at].partition("=")[2])
        edited = [*lines[:at], f"DefaultValue={value + 1 if value < 255 else value - 1}\n", *lines[at + 1 :]]
        found = [
            each for each in diff(whole, loads("".join(edited).encode(), "b.eds")) if each.index is not None
        ]
        assert len(found) == 1, (lines[at], found)
        section = int(_section(lines, at)[1:5], 16)
        assert found[0].index == section
        assert lines[found[0].line_a - 1].startswith(f"[{section:04X}")


def _section(lines: list[str], at: int) -> str:
    return next(line for line in reversed(lines[: at + 1]) if line.startswith("["))


def test_the_report_has_important_differences_first() -> None:
    a, b = small(STATUS + entry(DefaultValue="1")), small(entry(DefaultValue="2"))
    text = "\n".join(compare.lines(a, b, diff(a, b), None))
    assert text.index("Important for a master") < text.index("\nPDOs: ") < text.index("\ndefaults: 1")
    assert "2000h Thing: DefaultValue: 1 -> 2" in text
    assert "the drive has no TPDO1 any more" in text


def test_equal_differences_of_neighbouring_sub_indices_are_printed_once() -> None:
    subs = [variable(f"2100sub{at}", ParameterName=f"Value {at}") for at in range(1, 9)]
    a, b = (
        small(record("2100", *subs)),
        small(record("2100", *subs).replace("AccessType=rw", "AccessType=ro")),
    )
    found = diff(a, b)
    assert len(found) == 8
    text = "\n".join(compare.lines(a, b, found, None))
    assert text.count("can no longer be written") == 1
    assert "2100h:01-08" in text


@pytest.mark.parametrize(
    ("version", "revision", "said"),
    [("1", "5", "1.5"), ("0x01", "0x0A", "1.10"), ("002", "07", "2.7"), ("1.0", "5", "1.5"), ("-", "", "-")],
)
def test_the_versions_of_the_files_are_named_as_numbers(version: str, revision: str, said: str) -> None:
    info = f"[FileInfo]\nFileVersion={version}\nFileRevision={revision}\n\n"
    eds = loads((info + small_text(STATUS)).encode(), "a.eds")
    assert f", file version {said})" in next(iter(compare.lines(eds, eds, (), None)))


def test_equal_files_are_reported_as_such() -> None:
    eds = small(STATUS)
    assert list(compare.lines(eds, eds, (), None))[-1] == "no difference in meaning"


def test_the_library_offers_diff_without_importing_it_at_once() -> None:
    assert axisbus.eds.diff is diff
    with pytest.raises(AttributeError, match=r"axisbus\.eds"):
        axisbus.eds.nothing  # noqa: B018


_SWAPPED = {DifferenceGroup.ADDED: DifferenceGroup.REMOVED, DifferenceGroup.REMOVED: DifferenceGroup.ADDED}


@pytest.mark.skipif(not CORPUS, reason="no folder of EDS files (AXISBUS_EDS_CORPUS)")
def test_real_files_of_one_maker_differ_alike_in_both_directions() -> None:
    """A file does not differ from itself; the differences of A and B are those of B and A with the sides exchanged."""
    different = 0
    for one, other in pairwise(CORPUS):
        a = load(one)
        assert diff(a, a) == ()
        if one.name[:12] != other.name[:12]:
            continue
        b = load(other)
        there = {(each.group, each.index, each.subindex, each.a, each.b) for each in diff(a, b)}
        back = {
            (_SWAPPED.get(each.group, each.group), each.index, each.subindex, each.b, each.a)
            for each in diff(b, a)
        }
        assert there == back, (one.name, other.name)
        different += bool(there)
    assert different > 10
