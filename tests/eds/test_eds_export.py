"""CSV, JSON and DBC for other programs: each is read back by another implementation."""

from __future__ import annotations

import csv
import io
import json
import random
import sys
from pathlib import Path

import cantools
import pytest
from cantools.database.can import Database, Message

from axisbus.cia301.pdo import PdoCodec
from axisbus.cia402.si_units import decoded
from axisbus.eds import Eds, layout, load
from axisbus.eds.report import export_values, frames
from axisbus.errors import ArgumentError, UserError
from kit.eds.samples import BITS, BUILTIN, EVERY_TENTH, STATUS, builtin, communication, mapped, small
from kit.eds.texts import canopen_facts, variable


def read(eds: Eds, node_id: int = 5) -> Database:
    return cantools.database.load_string(frames.dumps(eds, node_id, words=True).text, "dbc")


def message(database: Database, name: str) -> Message:
    found = database.get_message_by_name(name)
    assert isinstance(found, Message)
    return found


def test_csv_has_a_row_for_each_entry_as_canopen_reads_it() -> None:
    (path,) = (path for path in BUILTIN if path.stem == "generic-cia402")
    rows = list(csv.DictReader(io.StringIO(export_values.csv_text(load(path), 5))))
    known = canopen_facts(path.read_text(), 5)
    assert {(int(row["index"], 16), int(row["subindex"], 16)) for row in rows} == set(known)
    for row in rows:
        name, _, access, mappable, default, *_ = known[int(row["index"], 16), int(row["subindex"], 16)]
        assert (row["name"], row["access"], bool(row["pdo"])) == (name, access, mappable)
        assert row["default"] == ("" if default is None else str(default))


def test_csv_keeps_commas_quotes_and_formulas() -> None:
    eds = small(variable("2000", ParameterName='A, "B"', DefaultValue="$NODEID+0x10"))
    (row,) = [
        row
        for row in csv.DictReader(io.StringIO(export_values.csv_text(eds, None)))
        if row["index"] == "0x2000"
    ]
    assert (row["name"], row["default"], row["data_type"]) == ('A, "B"', "$NODEID+0x10", "UNSIGNED32")


@pytest.mark.parametrize("path", EVERY_TENTH, ids=lambda path: path.stem[:40])
def test_json_holds_every_entry_and_pdo(path: Path) -> None:
    eds = load(path)
    whole = json.loads(export_values.json_text(eds, None))
    assert [(each["index"], each["subindex"]) for each in whole["entries"]] == [
        (entry.index, subindex) for entry in eds for subindex in entry.subs
    ]
    assert [each["name"] for each in whole["pdos"]] == [each.name for each in layout.layouts(eds, None)]


def test_identifiers_are_those_of_the_predefined_connection_set() -> None:
    database = read(builtin("generic-cia402"))
    # CiA 301 7.3.5, node 5; typed by hand.
    assert {each.name: each.frame_id for each in database.messages} == {
        "NMT": 0x000,
        "SYNC": 0x080,
        "Node5_EMCY": 0x085,
        "Node5_TPDO1": 0x185,
        "Node5_RPDO1": 0x205,
        "Node5_TPDO2": 0x285,
        "Node5_RPDO2": 0x305,
        "Node5_SDO_response": 0x585,
        "Node5_SDO_request": 0x605,
        "Node5_Heartbeat": 0x705,
    }
    assert message(database, "Node5_TPDO1").senders == ["Node5"]
    assert message(database, "Node5_RPDO1").senders == ["Master"]


@pytest.mark.parametrize("path", EVERY_TENTH, ids=lambda path: path.stem[:40])
def test_values_packed_by_our_codec_are_decoded_by_cantools(path: Path) -> None:
    eds = load(path)
    database = read(eds)
    numbers = random.Random(1)
    names = {each.name for each in database.messages}
    for each in layout.layouts(eds, 5):
        if f"Node5_{each.name}" not in names:
            continue
        slots = each.slots
        if any(slot.data_type is not None and slot.data_type.name.startswith("REAL") for slot in slots):
            continue
        codec = PdoCodec([slot.mapped for slot in slots], [slot.signed for slot in slots])
        values = [0 if slot.mapped.is_dummy else _any(numbers, slot.bits, slot.signed) for slot in slots]
        decoded = message(database, f"Node5_{each.name}").decode(codec.pack(values), decode_choices=False)
        expected = [
            value for slot, value in zip(slots, values, strict=True) if not slot.mapped.is_dummy and slot.bits
        ]
        signals = sorted(message(database, f"Node5_{each.name}").signals, key=lambda signal: signal.start)
        assert [decoded[signal.name] for signal in signals] == expected


def _any(numbers: random.Random, bits: int, signed: bool) -> int:
    low = -(1 << bits - 1) if signed and bits else 0
    return numbers.randint(low, low + (1 << bits) - 1)


def test_a_frame_written_down_by_hand() -> None:
    """Statusword 1637h, mode 8 (csp), position -2: bytes 37 16 08 FE FF FF FF."""
    decoded = message(read(small(STATUS)), "Node5_TPDO1").decode(bytes.fromhex("371608FEFFFFFF"))
    assert decoded["Statusword"] == 0x1637
    assert decoded["Position"] == -2
    assert str(decoded["Mode_display"]) == "csp"


def test_single_bits_and_dummies() -> None:
    signals = {signal.name: signal for signal in message(read(small(BITS)), "Node5_TPDO1").signals}
    assert {name: (each.start, each.length, each.is_signed) for name, each in signals.items()} == {
        "Ready_now": (0, 1, False),
        "Gear": (1, 3, False),
        "Position": (8, 32, True),
        "Pressure": (40, 24, True),
    }
    assert all(each.byte_order == "little_endian" and each.scale == 1 for each in signals.values())


def test_a_real_is_a_float() -> None:
    real = variable("2000", ParameterName="Temperature", DataType="0x8", AccessType="ro", PDOMapping="1")
    eds = small(communication("1800", "$NODEID+0x180") + mapped("1A00", "0x20000020") + real)
    decoded = message(read(eds), "Node5_TPDO1").decode(bytes.fromhex("0000C03F"))  # IEEE 754: 1.5
    assert decoded == {"Temperature": 1.5}


def test_heartbeat_emergency_and_nmt_are_decoded_too() -> None:
    database = read(builtin("gim6010-8"))
    assert str(message(database, "Node5_Heartbeat").decode(b"\x7f")["NMT_state"]) == "pre_operational"
    assert str(message(database, "NMT").decode(b"\x81\x05")["Command"]) == "reset_node"
    emergency = message(database, "Node5_EMCY").decode(bytes.fromhex("1032050102030405"))
    assert (emergency["Error_code"], emergency["Error_register"]) == (0x3210, 0x05)


def test_equal_names_in_one_pdo_get_their_address() -> None:
    two = "".join(
        variable(index, ParameterName="Value", DataType="0x6", PDOMapping="1") for index in ("2000", "2001")
    )
    eds = small(communication("1800", "$NODEID+0x180") + mapped("1A00", "0x20000010", "0x20010010") + two)
    names = [signal.name for signal in message(read(eds), "Node5_TPDO1").signals]
    assert sorted(names) == ["Value_2000_00", "Value_2001_00"]


def test_an_object_mapped_twice_is_two_signals() -> None:
    eds = small(communication("1800", "$NODEID+0x180") + mapped("1A00", "0x60410010", "0x60410010"))
    names = [signal.name for signal in message(read(eds), "Node5_TPDO1").signals]
    assert sorted(names) == ["Statusword_6041_00_1", "Statusword_6041_00_2"]


def test_an_identifier_of_29_bits_stays_one() -> None:
    eds = small(communication("1800", "0x20012345") + mapped("1A00", "0x60410010"))
    found = message(read(eds), "Node5_TPDO1")
    assert (found.frame_id, found.is_extended_frame) == (0x12345, True)


@pytest.mark.parametrize(
    ("body", "reason"),
    [
        (communication("1800", "0x80000180") + mapped("1A00", "0x60410010"), "TPDO1: switched off"),
        (communication("1800", "0x180") + mapped("1A00"), "TPDO1: maps nothing"),
        (
            communication("1800", "0x180") + mapped("1A00", "0x60640020", "0x60640020", "0x60410010"),
            "TPDO1: maps 80 bits, a CAN frame holds 64",
        ),
        (communication("1800", "") + mapped("1A00", "0x60410010"), "TPDO1: the file gives no COB-ID"),
        (
            communication("1800", "0x705") + mapped("1A00", "0x60410010"),
            "already the identifier of Node5_Heartbeat",
        ),
    ],
)
def test_pdos_that_a_dbc_cannot_contain_are_left_out_and_named(body: str, reason: str) -> None:
    made = frames.dumps(small(body), 5)
    (left_out,) = made.left_out
    assert reason in left_out
    assert not any("TPDO" in each.name for each in cantools.database.load_string(made.text, "dbc").messages)


def test_a_dbc_needs_a_node_id() -> None:
    with pytest.raises(ArgumentError, match="depend on the node ID") as caught:
        frames.dumps(small(STATUS), None)
    assert "--node" in caught.value.remedy


def test_without_cantools_the_error_names_the_package(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "cantools.database.can", None)
    with pytest.raises(UserError, match="cantools, which is not installed") as caught:
        frames.dumps(small(STATUS), 5)
    assert 'pip install "axisbus[dbc]"' in caught.value.remedy


def test_a_dbc_has_units_limits_and_the_meaning_of_bits_and_modes() -> None:
    limited = variable("607A", DataType="0x0004", PDOMapping="1", LowLimit="-1000", HighLimit="2000")
    body = (
        limited
        + variable("60A8", DefaultValue="0xFF410000")
        + variable("6071", DataType="0x0003", PDOMapping="1")
        + communication("1800", "$NODEID+0x180")
        + mapped("1A00", "0x607A0020", "0x60710010", "0x60410010")
    )
    text = frames.dumps(small(body), 5).text
    found = {
        signal.name: signal
        for signal in message(cantools.database.load_string(text, "dbc"), "Node5_TPDO1").signals
    }
    position = next(signal for signal in found.values() if signal.length == 32)
    assert (position.minimum, position.maximum, position.unit) == (-1000, 2000, "0.1deg")
    assert next(signal for signal in found.values() if signal.length == 16).unit == "0.1% rated torque"
    bits = {signal.start: signal for signal in found.values() if signal.length == 1}
    assert sorted(bits) == list(range(48, 64))
    assert dict(bits[51].choices or {}) == {0: "not_fault", 1: "fault"}
    assert dict(bits[53].choices or {}) == {0: "quick_stop_active", 1: "no_quick_stop"}
    assert bits[62].choices is None  # the maker's


@pytest.mark.parametrize(
    ("code", "unit"),
    [
        (0x00B44700, "rev/min"),
        (0xFD010300, "0.001m/s"),
        (0x00B50000, "inc"),
        (0x00000000, ""),
        (0x00B49900, ""),
    ],
)
def test_units_are_those_of_the_si_unit_objects(code: int, unit: str) -> None:
    found = decoded(code)
    assert ("" if found is None else found.text) == unit


def test_pdos_that_are_switched_off_are_in_a_dbc_on_request() -> None:
    eds = small(communication("1800", "$NODEID+0x80000180") + mapped("1A00", "0x60410010"))
    assert "TPDO1" not in frames.dumps(eds, 5).text
    made = frames.dumps(eds, 5, switched_off=True)
    assert made.left_out == ()
    found = message(cantools.database.load_string(made.text, "dbc"), "Node5_TPDO1")
    assert found.frame_id == 0x185
    assert "switched off" in str(found.comment)
