"""The catalogue of standard objects against facts typed off by hand: entries, arrays, numbered parameters, axes."""

import pytest

from axisbus.cia301.datatypes import DataType
from axisbus.cia402 import dictionary


@pytest.mark.parametrize(
    ("address", "standard", "name", "data_type", "access", "mapping"),
    [
        ((0x1000, 0), "CiA 301", "Device type", DataType.UNSIGNED32, {"ro"}, ""),
        ((0x1018, 2), "CiA 301", "Product code", DataType.UNSIGNED32, {"ro"}, ""),
        ((0x1400, 2), "CiA 301", "Transmission type", DataType.UNSIGNED8, {"rw"}, ""),
        ((0x1411, 2), "CiA 301", "Transmission type", DataType.UNSIGNED8, {"rw"}, ""),
        ((0x1603, 7), "CiA 301", "Application object", DataType.UNSIGNED32, {"rw", "const"}, ""),
        ((0x6040, 0), "CiA 402", "Controlword", DataType.UNSIGNED16, {"rw"}, "RPDO"),
        ((0x6841, 0), "CiA 402", "Statusword", DataType.UNSIGNED16, {"ro"}, "TPDO"),
        ((0x6099, 1), "CiA 402", "Speed during search for switch", DataType.UNSIGNED32, {"rw"}, "RPDO"),
    ],
)
def test_an_entry_has_the_properties_of_its_standard(address, standard, name, data_type, access, mapping):
    row = dictionary.entry(*address)
    assert row is not None
    assert (row.standard, row.name, row.data_type) == (standard, name, data_type)
    assert (row.access, row.mapping) == (access, mapping)


@pytest.mark.parametrize(
    ("address", "mandatory", "sure", "modes"),
    [
        ((0x1000, 0), True, True, ()),
        ((0x1006, 0), False, True, ()),  # only for a SYNC producer
        ((0x6040, 0), True, True, ("all",)),
        ((0x603F, 0), False, False, ("all",)),
        ((0x6042, 0), False, True, ("vl",)),  # only in that mode
        ((0x6046, 1), True, True, ("vl",)),
        ((0x6047, 1), True, False, ("vl",)),
    ],
)
def test_conditions_for_a_mandatory_entry_and_their_certainty(address, mandatory, sure, modes):
    row = dictionary.entry(*address)
    assert (row.index, row.subindex) == address
    assert (row.mandatory, row.sure, row.modes) == (mandatory, sure, modes)


@pytest.mark.parametrize(
    ("index", "single"), [(0x1000, True), (0x1018, True), (0x1400, False), (0x1A12, False)]
)
def test_numbered_objects_share_a_row(index, single):
    assert [row.single for row in dictionary.of(index)] == [single] * len(dictionary.of(index))


@pytest.mark.parametrize(
    ("address", "types"),
    [
        ((0x1008, 0), [DataType.VISIBLE_STRING]),
        ((0x1022, 0), [DataType.UNSIGNED8, DataType.UNSIGNED16]),
        ((0x6064, 0), [DataType.INTEGER32]),
    ],
)
def test_an_entry_has_all_the_data_types_that_the_standards_give_it(address, types):
    assert list(dictionary.entry(*address).data_types) == types


@pytest.mark.parametrize("index", [0x1018, 0x6046])
def test_a_record_or_array_of_several_types_has_no_data_type(index):
    assert dictionary.whole(index).data_types == ()


def test_a_choice_of_types_is_no_single_one():
    store_format = dictionary.entry(0x1022, 0)
    assert store_format.data_type is None
    assert store_format.data_types == (DataType.UNSIGNED8, DataType.UNSIGNED16)


def test_an_object_as_a_whole_is_before_its_entries():
    identity = dictionary.of(0x1018)
    assert [row.name for row in identity] == [
        *("Identity object", "Vendor-ID", "Product code", "Revision number", "Serial number"),
    ]
    assert identity[0].object_type == "RECORD"
    assert not identity[0].subindices
    assert dictionary.whole(0x1018) is identity[0]
    assert dictionary.entry(0x1018, 5) is None


def test_the_elements_of_an_array_are_described_by_the_whole_object():
    whole = dictionary.whole(0x1016)
    assert (whole.object_type, whole.data_type, whole.single) == ("ARRAY", DataType.UNSIGNED32, True)
    assert dictionary.entry(0x1016, 3) is None


def test_an_object_is_found_by_its_name():
    assert dictionary.named(" profile VELOCITY") == (0x6081, 0)
    assert dictionary.named("Device type") == (0x1000, 0)
    assert dictionary.named("Identity object") is None  # it has sub-indices
    assert dictionary.named("Vendor-ID") is None
    assert dictionary.name(0x7081) == "Profile velocity"


@pytest.mark.parametrize("index", [0x0005, 0x1004, 0x2000, 0x5FFF, 0x67F0, 0xA000])
def test_an_index_outside_the_standards_has_no_entry(index):
    assert dictionary.of(index) == ()
    assert dictionary.whole(index) is None
    assert dictionary.entry(index, 0) is None
    assert dictionary.name(index) == ""
