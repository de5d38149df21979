"""Objects that PDOs carry: their values out of the frames, of whatever size and sign."""

from __future__ import annotations

import struct
from fractions import Fraction

import pytest

from axisbus.cia301.datatypes import DataType
from axisbus.cia301.frame import CanFrame
from axisbus.cia301.pdo import PdoLocation
from axisbus.cia401.signal import IoPoint
from axisbus.ipc.frames import FrameQueue, unpacked
from axisbus.record.objects import MappedObjects, MappedSignal, WantedObject


def place(
    shift: int, bits: int, kind: DataType | None, label: str = "x", can_id: int = 0x181, **point
) -> MappedSignal:
    wanted = WantedObject(
        label, 1, 0x2000, 0, label, kind, IoPoint("x", 1, 0x2000, 0, bits, **point) if point else None
    )
    return MappedSignal(wanted, PdoLocation(can_id, "TPDO1", shift, bits))


@pytest.mark.parametrize(
    ("where", "data", "value"),
    [
        (place(0, 16, DataType.UNSIGNED16), "37 06", 0x0637),
        (place(16, 8, DataType.INTEGER8), "00 00 ff", -1),
        (place(24, 32, DataType.INTEGER32), "00 00 00 fe ff ff ff", -2),
        (place(3, 1, DataType.BOOLEAN), "08", 1),
        (place(4, 12, None), "10 32", 0x321),
        (place(0, 32, DataType.REAL32), struct.pack("<f", 1.5).hex(" "), 1.5),
        (place(0, 64, DataType.UNSIGNED64), "01 00 00 00 00 00 00 80", 0x8000_0000_0000_0001),
        (place(0, 16, DataType.UNSIGNED16), "37", None),
        (place(8, 8, DataType.UNSIGNED8, signed=False, output=False, bit=2), "00 04", True),
        (place(8, 8, DataType.UNSIGNED8, signed=False, output=True, bit=3), "00 04", False),
        (
            place(0, 16, DataType.INTEGER16, signed=True, output=False, scale=Fraction(100), offset=1.0),
            "9c ff",
            0.0,
        ),
    ],
)
def test_a_value_is_read_out_of_a_frame(where, data, value):
    assert where.value(bytes.fromhex(data)) == value


class Session:
    """A session that only reports frames."""

    def __init__(self):
        self.taps = {}

    def tap(self, hear, can_ids=()):
        self.taps[hear] = set(can_ids)

    def untap(self, hear):
        del self.taps[hear]


def test_each_frame_is_a_value_at_its_own_time():
    session = Session()
    objects = MappedObjects(
        session,
        lambda: [
            place(0, 16, DataType.UNSIGNED16, "a"),
            place(16, 8, DataType.INTEGER8, "b"),
            place(0, 8, None, "c", 0x281),
        ],
    )
    objects.begin()
    ((hear, wanted),) = session.taps.items()
    assert wanted == {0x181, 0x281}
    hear(
        [
            CanFrame(1.0, 0x181, b"\x01\x02\xff"),
            CanFrame(1.1, 0x281, b"\x07"),
            CanFrame(1.2, 0x181, b"\x02\x02"),
        ]
    )
    hear([CanFrame(1.3, 0x281, b"", remote=True), CanFrame(1.4, 0x381, b"\x01")])
    written = []
    objects.write(lambda *value: written.append(value))
    assert written == [("a", 1.0, 0x0201), ("b", 1.0, -1), ("c", 1.1, 7), ("a", 1.2, 0x0202)]
    assert objects.counts == {"a": 2, "b": 1, "c": 1}
    objects.write(lambda *value: written.append(value))
    assert len(written) == 4
    objects.end()
    assert not session.taps


def test_an_object_that_a_boot_up_maps_to_another_place_is_read_there_and_its_last_values_are_dropped():
    session, there = Session(), [place(0, 8, None, "a"), place(8, 8, None, "b")]
    objects = MappedObjects(session, lambda: there)
    objects.begin()
    ((hear, _),) = session.taps.items()
    hear([CanFrame(1.0, 0x181, b"\x01\x02"), CanFrame(5.0, 0x181, b"\x63\x03")])
    written = []
    objects.write(lambda *value: written.append(value), until=5.0)
    assert written == [("a", 1.0, 1), ("b", 1.0, 2)]
    there = [place(8, 8, None, "b"), place(0, 8, None, "a", 0x281)]
    assert objects.locate_again() == ["a"]
    assert objects.locate_again() == []
    ((hear, wanted),) = session.taps.items()
    assert wanted == {0x181, 0x281}
    hear([CanFrame(5.1, 0x281, b"\x04"), CanFrame(5.1, 0x181, b"\x63\x05")])
    objects.write(lambda *value: written.append(value))
    assert written[2:] == [("b", 5.0, 3), ("a", 5.1, 4), ("b", 5.1, 5)]
    objects.end()
    assert not session.taps


def test_without_such_objects_nothing_is_listened_to():
    session = Session()
    objects = MappedObjects(session, list)
    objects.begin()
    objects.end()
    assert not session.taps


def test_frames_are_transferred_unchanged_and_dropped_ones_are_counted():
    frames = [
        CanFrame(1.25, 0x181, bytes(range(8))),
        CanFrame(2.0, 0x1ABCDEF0, b"", extended=True),
        CanFrame(3.0, 0x701, b"", remote=True),
    ]
    queue = FrameQueue()
    for frame in frames:
        queue.put(frame)
    packed, lost = queue.take()
    assert (list(unpacked(packed)), lost) == (frames, 0)
    queue.select((0x181,))
    for _ in range(20_010):
        queue.put(frames[0])
        queue.put(frames[1])
    packed, lost = queue.take()
    assert (len(list(unpacked(packed))), lost) == (20_000, 10)
    assert queue.take() == (b"", 0)
