"""The EDS files that come with the library are complete, consistent, and describe the devices that they name."""

from __future__ import annotations

from pathlib import Path

import pytest

from axisbus.cia301.pdo import MappedObject
from axisbus.cia402 import dictionary
from axisbus.cia402.modes import FACTS, ModeOfOperation, supported
from axisbus.eds import Eds, Number, load
from axisbus.eds.builtin import names, resolve
from axisbus.eds.io import reader

MODULE = "generic-cia401"
DRIVES = [name for name in names() if name != MODULE]


def builtin(name: str) -> Eds:
    return load(resolve(f"builtin:{name}", Path()))


def number(eds: Eds, index: int, subindex: int = 0) -> int:
    value = eds.get(index, subindex)
    assert value is not None, f"{index:04X}:{subindex:02X}"
    assert isinstance(value.default, Number)
    return value.default.resolve(5)


def mapping(eds: Eds, index: int) -> list[MappedObject]:
    return [MappedObject.from_entry(number(eds, index, entry)) for entry in range(1, number(eds, index) + 1)]


@pytest.mark.parametrize("name", names())
def test_a_builtin_file_is_in_order(name: str) -> None:
    path = resolve(f"builtin:{name}", Path())
    reading = reader.read(path.read_bytes(), str(path))
    assert reading.eds.findings == ()
    assert reading.document.encoding == "ascii"
    assert max(map(len, reading.document.lines)) <= 255
    assert reading.eds.info["fileinfo"]["filename"] == path.name
    assert reading.eds.device_type == (0xF0191 if name == MODULE else 0x20192)
    listed = [
        int(value, 16)
        for kind in ("mandatoryobjects", "optionalobjects", "manufacturerobjects")
        for key, value in reading.eds.info[kind].items()
        if key != "supportedobjects"
    ]
    assert sorted(listed) == list(reading.eds.objects)
    for entry in reading.eds:
        if entry.is_record:
            assert len({sub.name for sub in entry.subs.values()}) == len(entry.subs)


@pytest.mark.parametrize("name", names())
def test_every_mapped_object_exists_fits_and_may_be_mapped(name: str) -> None:
    eds = builtin(name)
    for pdo in range(2 if name == MODULE else 4):
        for index, wanted in ((0x1600 + pdo, "writable"), (0x1A00 + pdo, "readable")):
            mapped = mapping(eds, index)
            assert sum(entry.bits for entry in mapped) <= 64
            for entry in mapped:
                target = eds.get(entry.index, entry.subindex)
                assert target is not None, str(entry)
                assert target.pdo_mapping, str(entry)
                assert target.bits == entry.bits
                assert getattr(target, wanted)


@pytest.mark.parametrize("name", DRIVES)
def test_pdos_have_the_identifiers_of_the_predefined_connection_set(name: str) -> None:
    eds = builtin(name)
    cob_ids = [number(eds, 0x1400 + pdo, 1) for pdo in range(4)] + [
        number(eds, 0x1800 + pdo, 1) for pdo in range(4)
    ]
    # Node 5; bit 31 marks the two of each that are free, bit 30 (no remote request) all that are sent.
    assert cob_ids == [0x205, 0x305, 0x80000405, 0x80000505, 0x40000185, 0x40000285, 0xC0000385, 0xC0000485]
    assert number(eds, 0x1014) == 0x85
    assert [number(eds, 0x1800 + pdo, 2) for pdo in range(4)] == [255] * 4
    assert {0, 1, 2, 3, 5} <= set(eds.objects[0x1800].subs)


@pytest.mark.parametrize("name", DRIVES)
def test_the_first_pdos_carry_each_mode(name: str) -> None:
    eds = builtin(name)
    received = {entry.index for pdo in range(4) for entry in mapping(eds, 0x1600 + pdo)}
    sent = {entry.index for pdo in range(4) for entry in mapping(eds, 0x1A00 + pdo)}
    assert received == {0x6040, 0x6060, 0x607A, 0x60FF, 0x6071}
    assert sent == {0x6041, 0x6061, 0x6064, 0x606C, 0x6077}


@pytest.mark.parametrize("name", DRIVES)
def test_types_and_access_are_those_of_the_standard(name: str) -> None:
    profile = [sub for entry in builtin(name) if entry.index >= 0x6000 for sub in entry.subs.values()]
    checked = 0
    for sub in profile:
        row = dictionary.entry(sub.index, sub.subindex)
        if row is not None:
            assert (sub.data_type.name, sub.access) == (row.data_types[0].name, row.access_text), hex(
                sub.index
            )
            checked += 1
    assert (
        checked >= len(profile) - 7
    )  # 60E3h continues after its first entry, which the table does not spell out


def test_the_generic_module_has_its_inputs_outputs_and_error_values() -> None:
    eds = builtin(MODULE)
    mapped = [
        (entry.index, entry.subindex)
        for pdo in (0x1600, 0x1601, 0x1A00, 0x1A01)
        for entry in mapping(eds, pdo)
    ]
    assert mapped[:4] == [(0x6200, 1), (0x6200, 2), (0x6411, 1), (0x6411, 2)]
    assert mapped[4:] == [(0x6000, 1), (0x6000, 2), (0x6401, 1), (0x6401, 2), (0x6401, 3), (0x6401, 4)]
    assert [number(eds, 0x6206, sub) for sub in (1, 2)] == [0xFF, 0xFF]
    assert [number(eds, index, sub) for index in (0x6207, 0x6444) for sub in (1, 2)] == [0] * 4
    assert [number(eds, 0x6443, sub) for sub in (1, 2)] == [1, 1]


def test_the_generic_drive_has_the_objects_of_its_modes() -> None:
    eds = builtin("generic-cia402")
    word = number(eds, 0x6502)
    assert word == 0b11_1010_1101
    modes = supported(word)
    assert [FACTS[mode].short for mode in modes] == ["pp", "pv", "tq", "hm", "csp", "csv", "cst"]
    for mode in modes:
        for index in FACTS[mode].required:
            assert index in eds, f"{mode.text} needs {index:04X}h"
    for index in (0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6007, 0x1016, 0x1029, 0x60C2, 0x6065, 0x6085):
        assert index in eds


def test_the_generic_drive_stops_on_its_ramps_by_default() -> None:
    eds = builtin("generic-cia402")
    codes = [number(eds, index) for index in (0x605A, 0x605B, 0x605C, 0x605D, 0x605E, 0x6007)]
    assert codes == [2, 1, 1, 1, 2, 3]
    assert all(number(eds, index) > 0 for index in (0x6081, 0x6083, 0x6084, 0x6085, 0x607F, 0x6087, 0x609A))
    assert number(eds, 0x60C2, 1) * 10 ** number(eds, 0x60C2, 2) == pytest.approx(0.001)


def test_the_eds_of_the_joint_module_has_the_published_facts() -> None:
    eds = builtin("gim6010-8")
    assert eds.identity.vendor_id == 0x000C0B00
    assert number(eds, 0x6502) == 0x761
    assert [number(eds, index) for index in (0x605A, 0x605B, 0x605C, 0x605D, 0x605E)] == [0] * 5
    assert (number(eds, 0x608F, 1), number(eds, 0x608F, 2)) == (16384, 1)
    assert (number(eds, 0x6091, 1), number(eds, 0x6091, 2)) == (8, 1)
    assert (number(eds, 0x6073), number(eds, 0x6075), number(eds, 0x6076), number(eds, 0x6080)) == (
        6000,
        10000,
        10000,
        1000,
    )
    assert (number(eds, 0x60C2, 1), number(eds, 0x60C2, 2)) == (1, 0)
    assert number(eds, 0x2000, 1) == 14
    homing = eds.get(0x6098)
    assert homing is not None
    assert (homing.low, homing.high) == (Number(0), Number(35))
    assert 0x6007 not in eds
    for index in (0x203E, 0x203F, 0x60FC, 0x60B2, 0x2008, 0x200A, 0x200B):
        assert index in eds


def test_the_eds_of_the_joint_module_states_that_it_is_not_the_manufacturer_s() -> None:
    text = resolve("builtin:gim6010-8", Path()).read_text()
    assert "NOT the maker's file (cb_0.1.eds)" in text
    assert "ASSUMED: 1016" in text
    assert "6502 = 0x761 does not agree with CiA 402" in text


def test_the_claim_of_6502_on_the_joint_module_contradicts_its_objects() -> None:
    claimed = supported(number(builtin("gim6010-8"), 0x6502))
    assert ModeOfOperation.PROFILE_VELOCITY not in claimed
    assert ModeOfOperation.CYCLIC_SYNC_POSITION not in claimed
