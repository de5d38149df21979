"""Short forms in a file, expanded: CompactSubObj with its lists, CompactPDO."""

from __future__ import annotations

import pytest

from axisbus.cia301.datatypes import DataType
from axisbus.eds import Eds, Number, loads
from kit.eds.texts import HEAD, only, read, rules, variable

COMPACT = variable(
    "2100", ObjectType="0x8", ParameterName="Gain", DataType="0x0005", DefaultValue="7", CompactSubObj="3"
)


def test_compact_sub_indices_are_named_by_number_and_share_all_other_keys() -> None:
    entry = read(COMPACT).objects[0x2100]
    assert [(sub.subindex, sub.name) for sub in entry.subs.values()] == [
        (0, "NrOfObjects"),
        (1, "Gain1"),
        (2, "Gain2"),
        (3, "Gain3"),
    ]
    count = entry.subs[0]
    assert (count.data_type, count.access, count.default) == (DataType.UNSIGNED8, "ro", Number(3))
    assert {(sub.data_type, sub.access, sub.default) for index, sub in entry.subs.items() if index} == {
        (DataType.UNSIGNED8, "rw", Number(7))
    }


def test_lists_of_a_compact_object_give_names_values_and_denotations_of_its_sub_indices() -> None:
    eds = read(
        COMPACT
        + "[2100Name]\nNrOfEntries=1\n2=Middle\n\n[2100Value]\nNrOfEntries=2\n1=10\n3=0xFF\n\n"
        + "[2100Denotation]\nNrOfEntries=1\n3=last one\n"
    )
    subs = eds.objects[0x2100].subs
    assert [subs[number].name for number in (1, 2, 3)] == ["Gain1", "Middle", "Gain3"]
    assert [subs[number].initial(None) for number in (1, 2, 3)] == [10, 7, 255]
    assert [subs[number].default for number in (1, 2, 3)] == [Number(7)] * 3
    assert subs[3].denotation == "last one"
    assert eds.findings == ()


def test_a_list_that_names_no_sub_index_is_reported() -> None:
    eds = read(COMPACT + "[2100Value]\nNrOfEntries=2\n1=10\n9=3\n")
    assert only(eds).rule == "O013"
    assert "sub-index 9" in only(eds).message


def test_a_value_in_a_list_is_checked_as_any_other() -> None:
    eds = read(COMPACT + "[2100Value]\n1=300\n")
    assert (only(eds).rule, only(eds).subindex) == ("V005", 1)


def test_an_explicit_sub_index_and_compact_ones_are_both_read() -> None:
    eds = read(COMPACT + variable("2100sub2", ParameterName="Special", DataType="0x0006"))
    subs = eds.objects[0x2100].subs
    assert list(subs) == [0, 1, 2, 3]
    assert (subs[2].name, subs[2].data_type) == ("Special", DataType.UNSIGNED16)


@pytest.mark.parametrize(("count", "entries"), [("255", 254), ("300", 0), ("-1", 0), ("many", 0)])
def test_an_impossible_number_of_entries_is_reported(count: str, entries: int) -> None:
    eds = read(COMPACT.replace("CompactSubObj=3", f"CompactSubObj={count}"))
    assert len(eds.objects[0x2100].subs) == (entries + 1 if entries else 0)
    assert rules(eds) == ["O013"]


def compact_pdos(parts: str, rpdos: int, tpdos: int, body: str = "") -> Eds:
    """Read a file whose PDOs are only counted, with the communication sub-indices of the mask ``parts``."""
    head = f"[DeviceInfo]\nVendorNumber=1\nCompactPDO={parts}\nNrOfRXPDO={rpdos}\nNrOfTXPDO={tpdos}\n"
    return loads((HEAD.replace("[DeviceInfo]\nVendorNumber=1\n", head) + body).encode(), "x.eds")


def test_compact_pdos_exist_with_the_sub_indices_of_the_mask() -> None:
    eds = compact_pdos("0x13", 2, 1)
    assert [entry.index for entry in eds] == [0x1000, 0x1400, 0x1401, 0x1600, 0x1601, 0x1800, 0x1A00]
    assert list(eds.objects[0x1400].subs) == [0, 1, 2, 5]
    assert eds.objects[0x1400].subs[0].default == Number(5)
    assert eds.objects[0x1401].subs[1].default == Number(0x300, plus_node_id=True)
    assert eds.objects[0x1800].subs[1].default == Number(0x180, plus_node_id=True)
    count = eds.get(0x1A00, 0)
    assert count is not None
    assert (count.access, count.default) == ("rw", Number(0))


def test_compact_pdos_complete_the_pdos_of_the_file() -> None:
    eds = compact_pdos("3", 2, 0, variable("1400sub1") + "[1400]\nParameterName=Own\nObjectType=9\n")
    assert eds.objects[0x1400].name == "Own"
    assert 0x1401 in eds
    assert 0x1402 not in eds


def test_a_fifth_compact_pdo_has_no_identifier_of_the_predefined_set() -> None:
    cob_id = compact_pdos("3", 5, 0).get(0x1404, 1)
    assert cob_id is not None
    assert cob_id.default == Number(0x80000000)


def test_an_absurd_number_of_pdos_stays_bounded() -> None:
    assert len(compact_pdos("3", 10**9, 0).objects) == 1 + 2 * 512
