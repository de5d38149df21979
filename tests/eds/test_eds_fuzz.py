"""Whatever the bytes: a model that canopen can use, or one clear error."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.cia301.datatypes import DataType
from axisbus.eds import (
    Eds,
    Number,
    Object,
    ObjectType,
    Variable,
    canopen_text,
    concise,
    concise_dcf_values,
    dcf,
    loads,
    writer,
)
from axisbus.eds.io import reader
from axisbus.errors import ArgumentError, EdsError
from kit.eds.texts import HEAD, canopen_facts, our_facts

SECTIONS = [
    "1000",
    "1018",
    "1018sub1",
    "2000",
    "2000sub0",
    "2000SUB01",
    "2000sub1",
    "2000Name",
    "2000Value",
    "DummyUsage",
]
SECTIONS += [
    "M1ModuleInfo",
    "M1FixedObjects",
    "M1Fixed6000",
    "M1SubExt6000",
    "ConnectedModules",
    "DynamicChannels",
    "2000ObjectLinks",
]
SECTIONS += ["A0", "A0sub1", "DeviceInfo", "DeviceComissioning", "Comments", "2000Denotation", "Odd ]["]
KEYS = [
    "ParameterName",
    "ObjectType",
    "DataType",
    "AccessType",
    "DefaultValue",
    "LowLimit",
    "HighLimit",
    "PDOMapping",
]
KEYS += [
    "CompactSubObj",
    "ParameterValue",
    "Denotation",
    "1",
    "2",
    "NodeID",
    "CompactPDO",
    "NrOfRXPDO",
    "Dummy0002",
    " ",
]
VALUES = [
    "0",
    "1",
    "0x7",
    "0x9",
    "8",
    "2",
    "0x0009",
    "0x0008",
    "0x000F",
    "0x00A0",
    "-5",
    "0xFF",
    "$NODEID+0x200",
    "010",
]
VALUES += [
    "",
    "ü",
    "a ; b",
    '"x"',
    "255",
    "1.5",
    "rw",
    "ro",
    "nan",
    "0x-3",
    "=$NODEID",
    "99999999999999999999",
    "\x85",
    "%s",
]

lines = st.one_of(
    st.sampled_from(SECTIONS).map("[{}]".format),
    st.tuples(st.sampled_from(KEYS), st.one_of(st.sampled_from(VALUES), st.text(max_size=8))).map("=".join),
    st.text(max_size=12),
)


@settings(max_examples=150, deadline=None)
@given(st.binary(max_size=400))
def test_any_bytes_are_read_or_refused(data: bytes) -> None:
    try:
        reading = reader.read(data, "fuzz.eds")
    except EdsError:
        return
    assert writer.dumps(reading.document) == data


@settings(max_examples=250, deadline=None)
@given(st.lists(lines, max_size=25), st.sampled_from(["\n", "\r\n", "\r"]))
def test_random_lines_are_read_and_all_entries_reach_canopen(some: list[str], newline: str) -> None:
    data = (HEAD + "\n".join(some)).replace("\n", newline).encode("utf-8", errors="replace")
    reading = reader.read(data, "fuzz.eds")
    assert writer.dumps(reading.document) == data
    assert {(entry.index, sub) for entry in reading.eds for sub in entry.subs if entry.index > 7} == set(
        canopen_facts(canopen_text(reading.eds), 5)
    )


@settings(max_examples=60, deadline=None)
@given(st.data())
def test_a_damaged_file_is_still_read(data: st.DataObject) -> None:
    whole = bytearray((HEAD * 3).encode())
    for _ in range(data.draw(st.integers(1, 6))):
        whole[data.draw(st.integers(0, len(whole) - 1))] = data.draw(st.integers(0, 255))
    try:
        eds = loads(bytes(whole), "damaged.eds")
    except EdsError:
        return
    assert eds.objects


@settings(max_examples=100, deadline=None)
@given(st.lists(lines, max_size=25), st.sampled_from(["1", "-1", "0x10", "$NODEID+1", "a", "0.5", "01FF"]))
def test_any_lines_become_a_dcf_or_are_refused_with_a_sentence(some: list[str], value: str) -> None:
    reading = reader.read((HEAD + "\n".join(some)).encode("utf-8", errors="replace"), "fuzz.eds")
    for entry in reading.eds:
        for sub in list(entry.subs.values())[:2]:
            try:
                made = dcf.make(reading, dcf.Settings(5, 500), [(sub, value)])
                writes = concise_dcf_values.configuration(made).writes
            except (EdsError, ArgumentError):
                continue
            there = made.eds.get(sub.index, sub.subindex)
            assert there is not None
            assert there.parameter_value is not None
            assert concise.decode(concise.encode(writes)) == writes


NAMES = st.text("abcXYZ 019=#%[]$_-", min_size=1, max_size=12).map(str.strip).filter(bool)
INTEGERS = [kind for kind in DataType if kind.integer]
OTHERS = {
    DataType.REAL32: st.floats(width=32, allow_nan=False, allow_infinity=False),
    DataType.REAL64: st.floats(allow_nan=False, allow_infinity=False),
    DataType.VISIBLE_STRING: NAMES,
    DataType.OCTET_STRING: st.binary(min_size=1, max_size=9),
    DataType.DOMAIN: st.binary(min_size=1, max_size=9),
}


@st.composite
def variables(draw: st.DrawFn, index: int, subindex: int) -> Variable:
    """Make an entry of any type with values that it can hold."""
    kind = draw(st.sampled_from([*INTEGERS, *OTHERS]))
    value = st.integers(*kind.range).map(Number) if kind.integer else OTHERS[kind]
    low, high = sorted(draw(st.integers(*kind.range)) for _ in range(2)) if kind.integer else (0, 0)
    bounded = draw(st.booleans()) and (low, high) != (0, 0)
    return Variable(
        index,
        subindex,
        draw(NAMES),
        kind,
        draw(st.sampled_from(["ro", "wo", "rw", "rwr", "rww", "const"])),
        draw(st.none() | value),
        draw(st.none() | value),
        Number(low) if bounded else None,
        Number(high) if bounded else None,
        draw(st.booleans()),
        draw(st.integers(0, 3)),
    )


@st.composite
def models(draw: st.DrawFn) -> Eds:
    """Make a model of variables and records."""
    objects = {}
    for index in sorted(draw(st.sets(st.integers(0x1000, 0xFFFF), min_size=1, max_size=5))):
        count = draw(st.integers(0, 3))
        subs = {sub: draw(variables(index, sub)) for sub in range(count + 1)}
        kind = draw(st.sampled_from([ObjectType.ARRAY, ObjectType.RECORD])) if count else ObjectType.VAR
        objects[index] = Object(index, draw(NAMES) if count else subs[0].name, kind, subs)
    info = {"deviceinfo": {"vendorname": draw(NAMES), "vendornumber": "0x1A"}}
    return Eds("made", objects, info, draw(st.none() | st.integers(1, 127)))


@settings(max_examples=150, deadline=None)
@given(models())
def test_every_written_model_is_read_equally_by_canopen_and_by_us(eds: Eds) -> None:
    data = writer.dumps(eds)
    assert our_facts(loads(data, "made.dcf"), 5) == our_facts(eds, 5)
    theirs, ours = canopen_facts(data.decode(), 5), our_facts(eds, 5)
    for key, (name, kind, access, mapping, default, value, *_) in ours.items():
        assert theirs[key][:6] == (name, kind, access, mapping, default, value)
    assert theirs.keys() == ours.keys()


def test_more_sections_than_any_device_has_are_refused_at_once() -> None:
    with pytest.raises(EdsError, match="too many sections"):
        reader.read(HEAD.encode() + b"[\n" * 600_000, "noise.eds")
