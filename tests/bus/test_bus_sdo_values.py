"""Values by name and type: checked before a frame is sent, read with the sign that the standard gives them."""

from __future__ import annotations

import math

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.sdo.client import SdoClient
from axisbus.cia301.datatypes import DataType
from axisbus.eds.dictionary import Dictionary, merged_type
from axisbus.eds.model import Eds, Number, Object, ObjectType, Variable
from axisbus.errors import ArgumentError, LimitError
from kit.bus.fake_bus import FakeBus, Slave

T = DataType


def variable(index: int, sub: int, name: str, data_type: DataType, **more: object) -> Variable:
    return Variable(index, sub, name, data_type, "rw", **more)  # type: ignore[arg-type]


def eds(*variables: Variable) -> Eds:
    objects: dict[int, Object] = {}
    for entry in variables:
        subs = {**(objects[entry.index].subs if entry.index in objects else {}), entry.subindex: entry}
        kind = ObjectType.RECORD if len(subs) > 1 or entry.subindex else ObjectType.VAR
        objects[entry.index] = Object(entry.index, entry.name, kind, subs)
    return Eds("test.eds", objects, {})


FILE = eds(
    variable(0x6081, 0, "Speed of profile", T.UNSIGNED32, low=Number(0), high=Number(5000)),
    variable(0x60FF, 0, "Target velocity", T.UNSIGNED32),  # the standard says INTEGER32
    variable(0x6077, 0, "Torque", T.UNSIGNED32),  # and INTEGER16 here: sign from there, size from here
    variable(0x607C, 0, "Home offset", T.INTEGER32, low=Number(0x8000_0000), high=Number(0x7FFF_FFFF)),
    variable(0x6085, 0, "Quick stop deceleration", T.UNSIGNED32, low=Number(0), high=Number(0)),
    variable(0x2000, 0, "Stiffness", T.REAL32, low=0.0, high=2.5),
    variable(0x2001, 0, "Label", T.VISIBLE_STRING),
    variable(0x2002, 0, "Blob", T.DOMAIN),
)


@pytest.fixture
def slave(fake: FakeBus) -> Slave:
    slave = Slave(
        5,
        {
            (0x6081, 0): bytes(4),
            (0x60FF, 0): b"\xf6\xff\xff\xff",
            (0x6064, 0): b"\xfe\xff\xff\xff",
            (0x6077, 0): b"\xff\xff\xff\xff",
            (0x6060, 0): b"\xff\x00\x00\x00",
            (0x607C, 0): bytes(4),
            (0x6085, 0): bytes(4),
            (0x2000, 0): b"\x00\x00\xc0\x3f",
            (0x2001, 0): b"motor\0",
            (0x2002, 0): b"\x01\x02\x03\x04\x05",
            (0x2003, 0): b"\xff\xff",
            (0x2004, 0): b"\1\2\3",
            (0x2005, 0): b"\1\2\3\4\5",
            (0x2006, 0): b"\1\2\3\4\5\6\7\x08",
        },
    )
    fake.peers.append(slave)
    return slave


@pytest.fixture
def sdo(channel: Channel, slave: Slave) -> SdoClient:
    return SdoClient(channel, 5, FILE)


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("Target velocity", -10),
        ("60FFh", -10),
        ("0x60FF", -10),
        ("0x60FF:00", -10),
        (0x60FF, -10),
        (0x6064, -2),  # not in the file: the standard's type
        (0x6077, -1),
        (0x6060, -1),  # 4 bytes came for an INTEGER8
        ("Stiffness", 1.5),
        ("label", "motor"),
        (0x2002, b"\x01\x02\x03\x04\x05"),
        (0x2003, 0xFFFF),  # an unknown object: unsigned
        (0x2004, 0x030201),
        (0x2005, b"\1\2\3\4\5"),  # no number has five bytes
        (0x2006, 0x0807060504030201),
    ],
)
def test_a_value_is_read_by_its_type(sdo: SdoClient, key: int | str, value: object) -> None:
    assert sdo.read(key) == value


def test_a_written_value_has_the_size_of_the_file(sdo: SdoClient, slave: Slave) -> None:
    sdo.write("Target velocity", 0, -3)
    sdo.write(0x6077, 0, -3)
    sdo.write("Stiffness", 0, 2)
    assert slave.writes == [
        (0x60FF, 0, b"\xfd\xff\xff\xff"),
        (0x6077, 0, b"\xfd\xff\xff\xff"),
        (0x2000, 0, b"\x00\x00\x00\x40"),
    ]


@pytest.mark.parametrize(
    ("key", "value", "error", "words"),
    [
        ("Speed of profile", 5001, LimitError, "HighLimit 5000"),
        ("Speed of profile", -1, LimitError, "UNSIGNED32 holds 0 to 4294967295"),
        ("Home offset", 1 << 31, LimitError, "does not fit INTEGER32"),
        ("Stiffness", 2.6, LimitError, "HighLimit 2.5"),
        ("Stiffness", 1e39, LimitError, "REAL32"),
        ("Stiffness", math.nan, ArgumentError, "not a finite number"),
        ("Speed of profile", 1.5, ArgumentError, "not a whole number"),
        ("Speed of profile", "fast", ArgumentError, "not a number"),
        ("Speed of profile", b"\x01", ArgumentError, "not a number"),
        ("Label", 5, ArgumentError, "is a number"),
        ("Blob", 5, ArgumentError, "is a number"),
        (0x2003, 5, ArgumentError, "data type is not known"),
        ("Speed of profle", 5, ArgumentError, "speed of profile"),
        (0x12345, 5, ArgumentError, "not an object"),
    ],
)
def test_an_invalid_value_is_refused_before_anything_is_sent(
    sdo: SdoClient, fake: FakeBus, key: int | str, value: object, error: type[Exception], words: str
) -> None:
    with pytest.raises(error) as caught:
        sdo.write(key, 0, value)  # type: ignore[arg-type]
    assert words in str(caught.value)
    assert fake.sent == []


def test_an_unchecked_value_passes_the_limits_of_the_file_but_not_those_of_its_type(
    sdo: SdoClient, slave: Slave, fake: FakeBus
) -> None:
    sdo.write_unchecked("Speed of profile", 0, 5001)
    sdo.write_unchecked(0x6077, 0, -3)
    assert slave.writes == [(0x6081, 0, b"\x89\x13\0\0"), (0x6077, 0, b"\xfd\xff\xff\xff")]
    fake.sent.clear()
    with pytest.raises(LimitError, match="UNSIGNED32 holds 0 to 4294967295"):
        sdo.write_unchecked("Speed of profile", 0, -1)
    with pytest.raises(ArgumentError, match="the data type of node 5, 2003h:00 is not known"):
        sdo.write_unchecked(0x2003, 0, 1)
    assert fake.sent == []


@pytest.mark.parametrize(
    ("index", "most"), [(0x6081, 256), (0x2000, 256), (0x2001, 65_536), (0x2002, 1 << 24), (0x2003, 1 << 24)]
)
def test_how_much_is_taken_of_an_object_depends_on_its_type(
    sdo: SdoClient, monkeypatch: pytest.MonkeyPatch, index: int, most: int
) -> None:
    """A number of 256 bytes is a device's mistake, and one without end an attack."""
    asked: list[int] = []
    monkeypatch.setattr(sdo, "_run", lambda request, *_: asked.append(request.most) or b"\0\0\0\0")
    sdo.read(index)
    sdo.upload(index)
    sdo.upload(index, most=7)
    assert asked == [most, most, 7]


def test_limits_that_limit_nothing_are_not_kept(sdo: SdoClient, slave: Slave) -> None:
    """0 and 0 mean "none" in many files, and a low limit of 80000000h is two's complement."""
    sdo.write("Quick stop deceleration", 0, 7)
    sdo.write("Home offset", 0, -5)
    assert slave.writes == [(0x6085, 0, b"\x07\0\0\0"), (0x607C, 0, b"\xfb\xff\xff\xff")]


def test_a_type_may_be_given(sdo: SdoClient, slave: Slave) -> None:
    sdo.write(0x2003, 0, -1, data_type=T.INTEGER16)
    assert slave.writes == [(0x2003, 0, b"\xff\xff")]
    assert sdo.read(0x2003, data_type=T.INTEGER16) == -1


def test_names_of_the_standard_serve_without_a_file() -> None:
    plain = Dictionary()
    assert plain.resolve("controlword").index == 0x6040
    entry = plain.resolve("6099h:02")
    assert (entry.index, entry.subindex, entry.data_type) == (0x6099, 2, T.UNSIGNED32)
    assert plain.entry(0x6864).data_type is T.INTEGER32  # position actual value of the second axis
    assert plain.entry(0x1A00, 3).data_type is None or plain.entry(0x1A00, 3).data_type is T.UNSIGNED32


@pytest.mark.parametrize(
    ("file", "standard", "merged"),
    [
        (T.UNSIGNED32, T.INTEGER32, T.INTEGER32),
        (T.INTEGER32, T.INTEGER16, T.INTEGER32),
        (T.UNSIGNED8, T.INTEGER8, T.INTEGER8),
        (T.INTEGER16, T.UNSIGNED16, T.UNSIGNED16),
        (T.REAL32, T.INTEGER32, T.REAL32),
        (T.UNSIGNED32, None, T.UNSIGNED32),
    ],
)
def test_size_from_the_file_and_sign_from_the_standard(
    file: DataType, standard: DataType | None, merged: DataType
) -> None:
    assert merged_type(file, standard) is merged
