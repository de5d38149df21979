"""Whatever the bytes: a model that canopen can use, or one clear error."""

from __future__ import annotations

from eds_texts import HEAD, canopen_facts
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.eds import canopen_text, loads, reader, writer
from axisbus.errors import EdsError

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
def test_any_lines_are_read_and_what_was_understood_reaches_canopen(some: list[str], newline: str) -> None:
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
