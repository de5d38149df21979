"""Data types, codes and PDO codec against numbers typed by hand."""

import pickle

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.cia301 import abort, emcy
from axisbus.cia301.datatypes import DataType, check_range, decode, encode
from axisbus.cia301.nmt import NmtState
from axisbus.cia301.pdo import MappedObject, PdoCodec
from axisbus.errors import ArgumentError, LimitError


@pytest.mark.parametrize(
    ("value", "data_type", "wire"),
    [
        (-1, DataType.INTEGER8, "ff"),
        (-2, DataType.INTEGER16, "feff"),
        (0x12345678, DataType.UNSIGNED32, "78563412"),
        (-1000000, DataType.INTEGER32, "c0bdf0ff"),
        (1, DataType.BOOLEAN, "01"),
        (0xABCDEF, DataType.UNSIGNED24, "efcdab"),
        (-1, DataType.INTEGER64, "ffffffffffffffff"),
        (1.5, DataType.REAL32, "0000c03f"),
        ("abc", DataType.VISIBLE_STRING, "616263"),
        (b"\x01\x02", DataType.DOMAIN, "0102"),
    ],
)
def test_encoding_of_each_type(value, data_type, wire):
    assert encode(value, data_type).hex() == wire
    assert decode(bytes.fromhex(wire), data_type) == value


@pytest.mark.parametrize(
    ("value", "data_type"),
    [(256, DataType.UNSIGNED8), (-1, DataType.UNSIGNED32), (40000, DataType.INTEGER16)],
)
def test_overflow_names_type_and_range(value, data_type):
    with pytest.raises(LimitError, match=data_type.name):
        check_range(value, data_type, "607Ah")


def test_wrong_kinds_are_refused():
    with pytest.raises(ArgumentError):
        encode("text", DataType.UNSIGNED8)
    with pytest.raises(ArgumentError):
        encode(1.5, DataType.UNSIGNED8)


def test_unknown_codes_are_members():
    assert DataType(0x1234).name == "TYPE_1234"
    assert NmtState(42).text == "state-42"
    assert abort.describe(0x12345678).startswith("0x12345678, not in CiA 301")


def test_abort_texts():
    assert abort.describe(0x06020000) == "0x06020000, Object does not exist in the object dictionary"
    assert "EDS" in abort.explain(0x06070010).hint


@pytest.mark.parametrize(
    ("code", "text"),
    [
        (0x8611, "Following error"),
        (0x3210, "DC link over-voltage"),
        (0x8130, "Life guard error or heartbeat error"),
        (0x8613, "(class of this code)"),
        (0xFF23, "CANopen device specific"),
    ],
)
def test_emcy_codes(code, text):
    assert text in emcy.explain(code)


def test_short_emcy_frames_are_read():
    message = emcy.parse(b"\x11\x86\x20", 1.0)
    assert (message.code, message.register, message.data) == (0x8611, 0x20, bytes(5))
    assert emcy.register_words(0x21) == ["generic error", "device profile"]
    assert emcy.parse(bytes(8), 0.0).is_reset


def test_codec_of_a_byte_aligned_map():
    """6041 (16 bits), 6061 (8), 6064 (32), as a drive sends them: state 0x0237, mode 1, position -2."""
    codec = PdoCodec(
        [MappedObject(0x6041, 0, 16), MappedObject(0x6061, 0, 8), MappedObject(0x6064, 0, 32)],
        [False, True, True],
    )
    assert codec.unpack(bytes.fromhex("370201feffffff")) == (0x0237, 1, -2)
    assert codec.pack((0x0237, 1, -2)).hex() == "370201feffffff"


def test_codec_of_odd_bits():
    """A 1-bit, a signed 3-bit, a dummy of 4 and a signed 12-bit entry: bits 0, 1-3, 4-7, 8-19."""
    entries = [
        MappedObject(0x2000, 1, 1),
        MappedObject(0x2000, 2, 3),
        MappedObject(5, 0, 4),
        MappedObject(0x2000, 3, 12),
    ]
    codec = PdoCodec(entries, [False, True, False, True])
    data = (1 | 0b110 << 1 | 0 << 4 | 0xFFE << 8).to_bytes(3, "little")
    assert codec.unpack(data) == (1, -2, 0, -2)
    assert codec.pack((1, -2, 0, -2)) == data


def test_negative_value_in_an_unsigned_entry_is_cut_as_the_drive_does():
    codec = PdoCodec([MappedObject(0x60FF, 0, 32)], [False])
    assert codec.pack((-1,)).hex() == "ffffffff"


def test_more_than_64_bits_are_refused():
    with pytest.raises(ArgumentError, match="72 bits"):
        PdoCodec(
            [MappedObject(0x6064, 0, 32), MappedObject(0x606C, 0, 32), MappedObject(0x6061, 0, 8)], [True] * 3
        )


@given(st.lists(st.tuples(st.integers(1, 16), st.booleans()), min_size=1, max_size=4), st.data())
def test_codec_unpacks_the_packed_values(fields, data):
    entries = [MappedObject(0x2000, number, bits) for number, (bits, _) in enumerate(fields)]
    signed = [sign for _, sign in fields]
    values = tuple(
        data.draw(
            st.integers(-(1 << bits - 1), (1 << bits - 1) - 1) if sign else st.integers(0, (1 << bits) - 1)
        )
        for bits, sign in fields
    )
    codec = PdoCodec(entries, signed)
    assert codec.unpack(codec.pack(values)) == values


def test_mapping_entry_of_the_standard():
    entry = MappedObject.from_entry(0x60410010)
    assert entry == (0x6041, 0, 16)
    assert entry.entry == 0x60410010
    assert str(entry) == "6041:00/16"


def test_errors_pickle_with_all_their_texts():
    from axisbus.errors import DriveFault, SdoAbort

    for error in (
        DriveFault("x: fault", axis="x", code=0x8611, observed="seen", remedy="do"),
        SdoAbort("no", node=1, index=0x6081, subindex=0, code=0x06020000, observed="o", remedy="r"),
    ):
        again = pickle.loads(pickle.dumps(error))
        assert type(again) is type(error)
        assert str(again) == str(error)
        assert again.__dict__ == error.__dict__
