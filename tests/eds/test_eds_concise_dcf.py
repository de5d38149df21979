"""The concise DCF: octets typed off from CiA 302-3, and an order of writes that a device takes."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.eds import concise
from axisbus.eds.concise import ConciseWrite
from axisbus.eds.concise_dcf_values import configuration, parameters
from axisbus.eds.io import reader
from axisbus.eds.io.reader import EdsParseResult
from axisbus.errors import ArgumentError, EdsError
from kit.eds.texts import HEAD, record, variable

U8, U16 = "5", "6"
HEARTBEAT_AND_SPEED = bytes.fromhex(
    "02 00 00 00"  # two entries
    "17 10 00 02 00 00 00 64 00"  # 1017h:00, 2 octets, 100
    "81 60 00 04 00 00 00 e8 03 00 00"  # 6081h:00, 4 octets, 1000
)


def dcf(body: str, node: int = 5) -> EdsParseResult:
    return reader.read(f"{HEAD}[DeviceComissioning]\nNodeID={node}\n\n{body}".encode(), "x.dcf")


def pdo(index: int, *, cob: str, mapping: dict[int, str], count: str, **keys: str) -> str:
    """Return an RPDO: its COB-ID and count as DefaultValue, mapping entries as ParameterValue."""
    communication = record(
        f"{index:X}",
        variable(f"{index:X}sub0", DataType=U8, AccessType="const", DefaultValue="2"),
        variable(f"{index:X}sub1", DefaultValue=cob),
        variable(f"{index:X}sub2", DataType=U8, DefaultValue="255", **keys),
    )
    where = f"{index + 0x200:X}"
    entries = (
        variable(f"{where}sub{sub}", DefaultValue="0x60400010", ParameterValue=text)
        for sub, text in mapping.items()
    )
    return communication + record(where, variable(f"{where}sub0", DataType=U8, DefaultValue=count), *entries)


def test_the_stream_is_as_the_standard_prints_it() -> None:
    writes = (ConciseWrite(0x1017, 0, b"\x64\x00"), ConciseWrite(0x6081, 0, b"\xe8\x03\x00\x00"))
    assert concise.encode(writes) == HEARTBEAT_AND_SPEED
    assert concise.decode(HEARTBEAT_AND_SPEED) == writes
    assert concise.decode(b"\0\0\0\0") == ()


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"", "0 octets"),
        (HEARTBEAT_AND_SPEED[:-1], r"entry 2 \(6081h:00\) has 3 of 4 octets"),
        (HEARTBEAT_AND_SPEED[:15], "entry 2 at octet 13 is cut off"),
        (HEARTBEAT_AND_SPEED + b"\0", "says 2 entries, and holds 2 and 1 octet more"),
        (b"\x03" + HEARTBEAT_AND_SPEED[1:], "says 3 entries, and holds 2"),
        (b"\xff\xff\xff\xff" + HEARTBEAT_AND_SPEED[4:], "says 4294967295 entries"),
    ],
)
def test_a_stream_that_is_not_whole_is_refused(data: bytes, words: str) -> None:
    with pytest.raises(EdsError, match=words):
        concise.decode(data, "x.bin")


@given(st.binary(max_size=60))
def test_any_octets_are_a_stream_or_refused(data: bytes) -> None:
    try:
        writes = concise.decode(data)
    except EdsError:
        return
    assert concise.encode(writes) == data


def test_only_values_that_differ_and_can_be_written_are_written() -> None:
    made = configuration(
        dcf(
            variable("1017", DataType=U16, DefaultValue="0", ParameterValue="100")
            + variable("6081", DefaultValue="0", ParameterValue="1000")
            + variable("6083", DefaultValue="10", ParameterValue="0xA")
            + variable("6085", DefaultValue="10")
            + variable("1000sub1", ParameterValue="1")
            + variable("2000", ParameterValue="7", ObjFlags="1")
            + variable("2001", DefaultValue="1", ParameterValue="7", AccessType="ro")
            + variable("6040", DataType=U16, ParameterValue="15")
            + record(
                "1010", variable("1010sub0", DataType=U8), variable("1010sub1", ParameterValue="0x65766173")
            )
        )
    )
    assert concise.encode(made.writes) == HEARTBEAT_AND_SPEED
    assert [each.index for each in made.left_out] == [0x1010, 0x2000, 0x2001, 0x6040]


def test_a_pdo_is_disabled_mapped_and_enabled_in_this_order_and_1020h_is_last() -> None:
    made = configuration(
        dcf(
            record(
                "1020", variable("1020sub0", DataType=U8), variable("1020sub1", ParameterValue="0x12345678")
            )
            + pdo(
                0x1400,
                cob="$NODEID+0x200",
                mapping={1: "0x60400010", 2: "0x60FF0020"},
                count="2",
                ParameterValue="1",
            )
            + variable("6081", DefaultValue="0", ParameterValue="1000")
        )
    )
    assert made.writes == (
        ConciseWrite(0x6081, 0, bytes.fromhex("e8030000")),
        ConciseWrite(0x1400, 1, bytes.fromhex("05020080")),  # 205h of node 5, bit 31
        ConciseWrite(0x1400, 2, b"\x01"),
        ConciseWrite(0x1600, 0, b"\x00"),
        ConciseWrite(0x1600, 1, bytes.fromhex("10004060")),
        ConciseWrite(0x1600, 2, bytes.fromhex("2000ff60")),
        ConciseWrite(0x1600, 0, b"\x02"),
        ConciseWrite(0x1400, 1, bytes.fromhex("05020000")),
        ConciseWrite(0x1020, 1, bytes.fromhex("78563412")),
    )


def test_a_pdo_that_is_to_stay_off_is_not_enabled() -> None:
    made = configuration(dcf(pdo(0x1800, cob="$NODEID+0x80000180", mapping={1: "0x60410010"}, count="1")))
    assert [write[:2] for write in made.writes] == [(0x1800, 1), (0x1A00, 0), (0x1A00, 1), (0x1A00, 0)]
    assert made.writes[0].data == bytes.fromhex("85010080")


def test_a_fixed_number_of_mapped_objects_is_not_written() -> None:
    body = pdo(0x1400, cob="0x205", mapping={1: "0x60FF0020"}, count="1")
    count = variable("1600sub0", DataType=U8, DefaultValue="1")
    fixed = body.replace(count, count.replace("=rw", "=const"))
    assert fixed != body
    assert [write[:2] for write in configuration(dcf(fixed)).writes] == [
        (0x1400, 1),
        (0x1600, 1),
        (0x1400, 1),
    ]


def test_a_pdo_of_unknown_identifier_is_refused_rather_than_guessed() -> None:
    with pytest.raises(EdsError, match="no value of 1400h:01"):
        configuration(dcf(pdo(0x1400, cob="", mapping={1: "0x60FF0020"}, count="1")))


def test_an_invalid_value_is_refused_with_its_line() -> None:
    reading = dcf(variable("6081", ParameterValue="4x0"))
    line = next(number for number, raw in enumerate(reading.document.lines, 1) if "4x0" in raw)
    with pytest.raises(EdsError, match=f"x.dcf:{line}: '4x0' cannot be written to 6081h:00"):
        configuration(reading)


def test_a_formula_needs_a_node() -> None:
    reading = reader.read((HEAD + variable("2000", ParameterValue="$NODEID+1")).encode(), "x.eds")
    assert configuration(reading, 9).writes == (ConciseWrite(0x2000, 0, bytes.fromhex("0a000000")),)
    with pytest.raises(EdsError, match="depends on the node ID"):
        configuration(reading)


def test_every_type_is_converted_to_octets_and_back() -> None:
    kinds = {
        "INTEGER16": ("3", "-2", "feff"),
        "REAL32": ("8", "0.5", "0000003f"),
        "VISIBLE_STRING": ("9", "abc", "616263"),
        "OCTET_STRING": ("0xA", "01FF", "01ff"),
        "BOOLEAN": ("1", "1", "01"),
        "INTEGER24": ("0x10", "-1", "ffffff"),
        "UNSIGNED64": ("0x1B", "18446744073709551615", "ffffffffffffffff"),
        "TIME_OF_DAY": ("0xC", "1", "010000000000"),
    }
    body = "".join(
        variable(f"200{number}", DataType=kind, ParameterValue=text)
        for number, (kind, text, _) in enumerate(kinds.values())
    )
    reading = dcf(body)
    writes = configuration(reading).writes
    assert [write.data.hex() for write in writes] == [octets for _, _, octets in kinds.values()]
    assert [text for _, text in parameters(reading.eds, writes)] == [text for _, text, _ in kinds.values()]


def test_of_several_writes_to_one_entry_the_last_is_its_value() -> None:
    eds = dcf(variable("6081")).eds
    ((entry, text),) = parameters(
        eds, [ConciseWrite(0x6081, 0, b"\x01\0\0\0"), ConciseWrite(0x6081, 0, b"\x02\0\0\0")]
    )
    assert (entry.index, text) == (0x6081, "2")


def test_a_stream_for_another_device_is_refused() -> None:
    eds = dcf(variable("6081")).eds
    with pytest.raises(ArgumentError, match="has no object 6099h:01"):
        parameters(eds, [ConciseWrite(0x6099, 1, b"\0\0\0\0")])
    with pytest.raises(EdsError, match="takes 4 octets"):
        parameters(eds, [ConciseWrite(0x6081, 0, b"\0\0")])
