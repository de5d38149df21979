"""Reading and writing the objects of a device, against a store of bytes: PDOs, skeletons; error frames."""

from __future__ import annotations

import zlib
from datetime import datetime
from types import SimpleNamespace

import pytest

from axisbus.bus.link import controller
from axisbus.bus.link.controller import CanErrorState
from axisbus.bus.node.from_device import as_file, skeleton, stored_eds
from axisbus.bus.node.verify import VerifiedAspect, verify
from axisbus.bus.pdo.configure import set_pdo
from axisbus.bus.pdo.read import read_pdo, read_pdos
from axisbus.bus.sdo import client as sdo_errors
from axisbus.cia301.datatypes import DataType
from axisbus.cia301.pdo import MappedObject
from axisbus.cia301.sdo_session import SdoTransferRequest
from axisbus.eds.dictionary import Dictionary, DictionaryEntry
from axisbus.eds.model import Eds, Number, Object, ObjectType, Severity, Variable
from axisbus.errors import BootError, EdsError, SdoAbort, SdoTimeout

MISSING, NO_SUB, WRITE_ONLY, NOT_MAPPABLE = 0x06020000, 0x06090011, 0x06010001, 0x06040041
INVALID, NO_RTR = 1 << 31, 1 << 30


class Store:
    """A device as its bytes; ``refuse`` holds abort codes by (index, sub-index, value or None), ``deaf`` unstored keys."""

    node_id = 5

    def __init__(self, objects: dict[tuple[int, int], bytes], eds: Eds | None = None) -> None:
        self.objects = dict(objects)
        self.dictionary = Dictionary(eds)
        self.refuse: dict[tuple[int, int, int | None], int] = {}
        self.deaf: set[tuple[int, int]] = set()
        self.written: list[tuple[str, int]] = []

    def upload(self, index: int, subindex: int = 0, progress=None) -> bytes:
        code = self.refuse.get((index, subindex, None))
        if code is None and (index, subindex) not in self.objects:
            code = MISSING if not any(one == index for one, _ in self.objects) else NO_SUB
        if code is not None:
            raise SdoAbort("refused", node=5, index=index, subindex=subindex, code=code)
        return self.objects[index, subindex]

    def download(self, index: int, subindex: int, data: bytes) -> None:
        value = int.from_bytes(data, "little")
        code = self.refuse.get((index, subindex, value))
        if code is not None:
            raise SdoAbort("refused", node=5, index=index, subindex=subindex, code=code)
        self.written.append((f"{index:04X}:{subindex}", value))
        if (index, subindex) not in self.deaf:
            self.objects[index, subindex] = data

    def write(self, index: int, subindex: int, value: int, *, data_type: DataType) -> None:
        self.download(index, subindex, value.to_bytes(data_type.bits // 8, "little"))


def little(value: int, size: int) -> bytes:
    return value.to_bytes(size, "little")


def pdo(
    receive: bool, number: int, cob_id: int, kind: int, *mapped: str, **more: int
) -> dict[tuple[int, int], bytes]:
    """The objects of one PDO; ``more``: inhibit, event, start."""
    communication = (0x1400 if receive else 0x1800) + number - 1
    found = {
        (communication, 0): b"\5",
        (communication, 1): little(cob_id, 4),
        (communication, 2): little(kind, 1),
    }
    for name, sub, size in (("inhibit", 3, 2), ("event", 5, 2), ("start", 6, 1)):
        if name in more:
            found[communication, sub] = little(more[name], size)
    at = communication + 0x200
    found[at, 0] = little(len(mapped), 1)
    return found | {(at, sub): little(int(text, 16), 4) for sub, text in enumerate(mapped, 1)}


def drive() -> Store:
    return Store(
        pdo(True, 1, 0x205, 255, "60400010", "60600008")
        | pdo(False, 1, 0x185 | NO_RTR, 1, "60410010", "60640020", inhibit=10, event=100, start=3)
    )


# PDO parameters.


def test_a_pdo_is_read_with_all_that_it_has():
    found = read_pdo(drive(), False, 1)
    assert (found.number, found.cob_id, found.valid, found.transmission_type) == (1, 0x185, True, 1)
    assert found.mapping == (MappedObject(0x6041, 0, 16), MappedObject(0x6064, 0, 32))
    assert (found.inhibit_time, found.event_timer, found.sync_start) == (10, 100, 3)
    received = read_pdo(drive(), True, 1)
    assert (received.cob_id, received.inhibit_time, received.event_timer, received.sync_start) == (
        0x205,
        None,
        None,
        None,
    )


@pytest.mark.parametrize(
    ("raw", "cob_id", "valid"),
    [
        (0x185, 0x185, True),
        (0x185 | INVALID, 0x185, False),
        (0x185 | 0x40000000, 0x185, True),
        (0x2000_0000 | 0x1ABCDE5, 0x1ABCDE5, True),
        (0xFFFF_F985 & ~0x20000000, 0x185, False),
    ],
)
def test_a_cob_id_has_11_bits_or_29_if_bit_29_is_set(raw, cob_id, valid):
    device = drive()
    device.objects[0x1800, 1] = little(raw, 4)
    found = read_pdo(device, False, 1)
    assert (found.cob_id, found.valid) == (cob_id, valid)


@pytest.mark.parametrize("missing", [1, 2])
def test_a_pdo_without_cob_id_or_transmission_type_is_not_there(missing):
    device = drive()
    del device.objects[0x1800, missing]
    assert read_pdo(device, False, 1) is None
    assert read_pdos(device).tpdos == ()
    assert len(read_pdos(device).rpdos) == 1


@pytest.mark.parametrize(
    ("count", "entries"), [(0, 0), (1, 1), (2, 2), (3, 2), (0xFD, 2), (0xFE, 0), (0xFF, 0)]
)
def test_a_mapping_has_as_many_entries_as_it_counts_and_has(count, entries):
    device = drive()
    device.objects[0x1A00, 0] = little(count, 1)
    assert len(read_pdo(device, False, 1).mapping) == entries


def with_pdos(*numbers: int) -> Eds:
    """An EDS with these TPDOs."""

    def entry(index: int) -> Object:
        return Object(
            index, "p", ObjectType.RECORD, {1: Variable(index, 1, "c", DataType.UNSIGNED32, "rw", None)}
        )

    return Eds("x", {0x1800 + n - 1: entry(0x1800 + n - 1) for n in numbers}, {})


def test_of_many_pdos_the_first_eight_of_each_axis_are_read_and_those_that_are_named():
    numbers = [*range(1, 13), *range(60, 76), 128, 129, 512]
    device = Store({}, with_pdos(*numbers))
    for number in numbers:
        device.objects |= pdo(False, number, 0x185, 1)
    found = [one.number for one in read_pdos(device).tpdos]
    assert found == [*range(1, 9), *range(65, 73), 129, 512]
    more = [one.number for one in read_pdos(device, [(False, 12), (True, 11), (False, 13)]).tpdos]
    assert more == [*range(1, 9), 12, *range(65, 73), 129, 512]


def test_the_mapping_of_the_last_rpdo_is_not_read_as_a_tpdo():
    device = Store(pdo(True, 512, 0x205, 1, "60400010", "60600008"), with_pdos(0, 1))
    assert 0x17FF in device.dictionary.eds
    device.objects |= pdo(False, 1, 0x185, 1)
    assert [one.number for one in read_pdos(device).tpdos] == [1]


def test_without_an_eds_the_usual_pdos_are_tried():
    device = Store({})
    for number in (1, 8, 9, 64, 65, 68, 69):
        device.objects |= pdo(False, number, 0x185, 1)
    assert [one.number for one in read_pdos(device).tpdos] == [1, 8, 65, 68]


def test_setting_a_pdo_switches_it_off_first_and_on_last_with_its_own_bits():
    device = drive()
    mapping = (MappedObject(0x6041, 0, 16), MappedObject(0x606C, 0, 32))
    found = set_pdo(
        device,
        False,
        1,
        mapping=mapping,
        transmission_type=255,
        event_timer=50,
        inhibit_time=20,
        sync_start=0,
        cob_id=0x1C5,
    )
    assert device.written == [
        ("1800:1", 0x185 | NO_RTR | INVALID),
        ("1A00:0", 0),
        ("1A00:1", 0x60410010),
        ("1A00:2", 0x606C0020),
        ("1A00:0", 2),
        ("1800:2", 255),
        ("1800:6", 0),
        ("1800:3", 20),
        ("1800:5", 50),
        ("1800:1", 0x1C5 | NO_RTR),
    ]
    assert (found.cob_id, found.mapping, found.transmission_type) == (0x1C5, mapping, 255)
    assert (found.event_timer, found.inhibit_time, found.sync_start) == (50, 20, 0)


def test_values_that_are_already_set_are_not_written():
    device = drive()
    before = read_pdo(device, False, 1)
    assert (
        set_pdo(device, False, 1, transmission_type=1, mapping=before.mapping, cob_id=0x185, rtr=False)
        == before
    )
    assert device.written == []
    set_pdo(device, False, 1, transmission_type=2)
    assert device.written == [("1800:1", 0x185 | NO_RTR | INVALID), ("1800:2", 2), ("1800:1", 0x185 | NO_RTR)]


def test_whether_a_pdo_answers_remote_frames_is_its_bit_30():
    device = drive()
    set_pdo(device, False, 1, rtr=True)
    assert device.written == [("1800:1", 0x185 | NO_RTR | INVALID), ("1800:1", 0x185)]
    device.written.clear()
    set_pdo(device, False, 1, rtr=True)
    assert device.written == []
    set_pdo(device, False, 1, rtr=False)
    assert device.written[-1] == ("1800:1", 0x185 | NO_RTR)


def test_a_pdo_with_29_bits_is_written_with_bit_29():
    device = drive()
    set_pdo(device, True, 1, cob_id=0x12345)
    assert device.written[-1] == ("1400:1", 0x12345 | 1 << 29)
    set_pdo(device, True, 1, cob_id=0x7FF)
    assert device.written[-1] == ("1400:1", 0x7FF)


def test_a_pdo_that_was_off_is_switched_on():
    device = drive()
    device.objects[0x1400, 1] = little(0x205 | INVALID, 4)
    assert set_pdo(device, True, 1).valid
    assert device.written[-1] == ("1400:1", 0x205)


def test_a_refused_timer_is_no_failure_and_any_other_abort_restores_the_pdo():
    device = drive()
    device.refuse[0x1800, 5, 50] = 0x06090030
    assert set_pdo(device, False, 1, event_timer=50, inhibit_time=20).event_timer == 100
    before = dict(device.objects)
    device.refuse[0x1A00, 2, 0x606C0020] = NOT_MAPPABLE
    with pytest.raises(BootError, match="606Ch cannot be mapped into TPDO1") as caught:
        set_pdo(
            device,
            False,
            1,
            mapping=(MappedObject(0x6041, 0, 16), MappedObject(0x606C, 0, 32)),
            transmission_type=7,
        )
    assert (caught.value.index, caught.value.subindex) == (0x1A00, 2)
    assert "pre-operational" in caught.value.remedy
    assert device.objects == before


@pytest.mark.parametrize(
    ("deaf", "value", "message", "seen"),
    [
        ((0x1800, 2), None, "its transmission type", "written 7h, read back 1h"),
        ((0x1800, 6), None, "its SYNC start value", "written 9h, read back 3h"),
        ((0x1A00, 2), None, "its mapping", "606C:00/32, read back"),
    ],
)
def test_a_value_that_reads_back_differently_is_reported(deaf, value, message, seen):
    device = drive()
    device.deaf.add(deaf)
    with pytest.raises(BootError, match=f"TPDO1 accepted {message}") as caught:
        set_pdo(
            device,
            False,
            1,
            mapping=(MappedObject(0x6041, 0, 16), MappedObject(0x606C, 0, 32)),
            transmission_type=7,
            sync_start=9,
        )
    assert seen in caught.value.observed
    assert caught.value.index == (0x1A00 if "mapping" in message else 0x1800)


def test_a_pdo_that_is_not_there_cannot_be_set():
    with pytest.raises(BootError, match="the drive has no TPDO2") as caught:
        set_pdo(drive(), False, 2)
    assert caught.value.index == 0x1801
    with pytest.raises(BootError, match="the drive has no RPDO2"):
        set_pdo(drive(), True, 2)


# An EDS from the device.


def test_the_stored_eds_is_plain_or_zipped():
    assert stored_eds(Store({})) is None
    plain = Store({(0x1021, 0): b"text"})
    assert stored_eds(plain) == b"text"
    plain.objects[0x1022, 0] = b"\0"
    assert stored_eds(plain) == b"text"
    assert stored_eds(Store({(0x1021, 0): zlib.compress(b"text"), (0x1022, 0): b"\1"})) == b"text"
    with pytest.raises(EdsError, match="a manufacturer-specific format") as caught:
        stored_eds(Store({(0x1021, 0): b"text", (0x1022, 0): b"\2"}))
    assert "is 2" in caught.value.observed


def answering(**more: bytes) -> Store:
    objects = {
        (0x1000, 0): little(0x00020192, 4),
        (0x1018, 0): b"\2",
        (0x1018, 1): little(0x29C, 4),
        (0x1018, 2): little(7, 4),
        (0x1018, 3): little(8, 4),  # beyond its count
        (0x1010, 0): b"\1",
        (0x1010, 1): little(1, 4),
        (0x1400, 0): b"\2",
        (0x1400, 1): little(0x205, 4),
        (0x1400, 2): b"\xff",
        (0x140F, 0): b"\0",
        (0x1410, 0): b"\0",  # beyond the range that is read
        (0x1600, 0): b"\x00",
        (0x1800, 0): b"\xc8",
        (0x1801, 0): b"",
        (0x6041, 0): b"\x37\2",
        (0x6064, 0): b"\1\2",  # two bytes of an INTEGER32
        (0x6502, 0): little(1, 4),
        (0x67FF, 0): little(0x00020192, 4),
    }
    return Store(objects)


def test_a_skeleton_has_answering_objects_with_size_and_constant_values():
    seen = []
    device = answering()
    device.refuse[0x607A, 0, None] = WRITE_ONLY
    device.refuse[0x1018, 2, None] = WRITE_ONLY
    made = skeleton(device, lambda done, of: seen.append((done, of)))
    assert sorted(made.objects) == [
        0x1000,
        0x1010,
        0x1018,
        0x1400,
        0x140F,
        0x1600,
        0x1800,
        0x1801,
        0x6041,
        0x6064,
        0x607A,
        0x6502,
        0x67FF,
    ]
    assert [done for done, _ in seen] == list(range(1, seen[0][1] + 1))
    assert {of for _, of in seen} == {len(seen)}
    assert made.get(0x1000).default.value == 0x00020192
    assert made.get(0x6502).default.value == 1
    assert made.get(0x67FF).default.value == 0x00020192
    assert made.get(0x6041).default is None
    assert made.get(0x6064).data_type is DataType.UNSIGNED16
    assert made.get(0x607A).data_type is DataType.INTEGER32
    assert sorted(made.objects[0x1018].subs) == [0, 1, 2]
    assert made.get(0x1018, 2).default is None
    assert made.get(0x1018, 0).default.value == 2
    assert sorted(made.objects[0x1801].subs) == [0]
    assert made.get(0x1801, 0).default.value == 0
    assert made.get(0x1400, 1).default is None  # a setting
    assert made.get(0x1800, 0).default.value == 64
    for index, entry in made.objects.items():
        assert [(sub, one.index, one.subindex) for sub, one in entry.subs.items()] == [
            (sub, index, sub) for sub in entry.subs
        ]
    assert made.get(0x1010, 1).object_flags == 1
    assert made.get(0x1000).object_flags == 0
    names = [made.objects[index].name for index in (0x1400, 0x140F, 0x1800, 0x1801)]
    assert [name.rsplit(" ", 1)[1] for name in names] == ["1", "16", "1", "2"]
    assert made.info["deviceinfo"] == {"vendornumber": str(0x29C), "nrofrxpdo": "2", "nroftxpdo": "2"}
    assert "node 5" in made.info["fileinfo"]["description"]


def test_each_element_of_a_skeleton_has_the_access_of_its_own_row():
    """The buffer of an interpolated path: entries that are read, set, and only written are next to each other."""
    device = Store({(0x60C4, 0): b"\6", **{(0x60C4, sub): little(1, 4) for sub in range(1, 7)}})
    buffer = skeleton(device).objects[0x60C4].subs
    assert [number for number in buffer if buffer[number].pdo_mapping] == []
    assert [buffer[sub].access for sub in range(7)] == ["const", "ro", "rw", "rw", "rw", "wo", "wo"]


@pytest.mark.parametrize(
    ("index", "data", "data_type"),
    [
        (0x607A, bytes(4), DataType.INTEGER32),
        (0x607A, b"\1", DataType.UNSIGNED8),
        (0x607A, bytes(2), DataType.UNSIGNED16),
        (0x607A, bytes(3), DataType.OCTET_STRING),
        (0x607A, bytes(8), DataType.UNSIGNED64),
        (0x6060, b"\1", DataType.INTEGER8),
        (0x6071, bytes(2), DataType.INTEGER16),
        (0x1008, b"a drive", DataType.VISIBLE_STRING),
        (0x1022, b"\1", DataType.UNSIGNED8),  # the standard leaves its size open
        (0x1022, b"\1\0", DataType.UNSIGNED16),
    ],
)
def test_a_type_in_a_skeleton_has_the_received_size(index, data, data_type):
    assert skeleton(Store({(index, 0): data})).get(index).data_type is data_type


@pytest.mark.parametrize(("data_type", "size"), [(DataType.BOOLEAN, 1), (DataType.INTEGER64, 8)])
def test_a_type_of_the_file_applies_in_a_skeleton_if_its_size_agrees(data_type, size):
    variable = Variable(0x60F4, 0, "v", data_type, "ro")
    file = Eds("x", {0x60F4: Object(0x60F4, "o", ObjectType.VAR, {0: variable})}, {})
    assert skeleton(Store({(0x60F4, 0): bytes(size)}, file)).get(0x60F4).data_type is data_type
    other = skeleton(Store({(0x60F4, 0): bytes(2)}, file)).get(0x60F4)
    assert other.data_type is DataType.UNSIGNED16


def test_a_skeleton_contains_the_known_identity():
    numbers = {(0x1018, 1): little(0x29C, 4), (0x1018, 2): little(7, 4), (0x1018, 3): little(0x10002, 4)}
    made = skeleton(Store({(0x1018, 0): b"\4", **numbers, (0x1018, 4): little(4711, 4)}))
    assert made.info["deviceinfo"] == {
        "vendornumber": "668",
        "productnumber": "7",
        "revisionnumber": "65538",
        "nrofrxpdo": "0",
        "nroftxpdo": "0",
    }


def test_a_skeleton_becomes_a_file_with_its_time_and_rate():
    made = as_file(skeleton(answering()), "a.eds", datetime(2024, 3, 25, 14, 38), 500_000)
    info = made.info["fileinfo"]
    assert (info["filename"], info["creationtime"], info["creationdate"]) == (
        "a.eds",
        "02:38PM",
        "03-25-2024",
    )
    assert (info["fileversion"], info["filerevision"], info["edsversion"], info["createdby"]) == (
        "1",
        "0",
        "4.0",
        "axisbus",
    )
    rates = {key: value for key, value in made.info["deviceinfo"].items() if key.startswith("baudrate")}
    assert rates == {"baudrate_500": "1"}
    none = as_file(skeleton(answering()), "a.eds", datetime(2024, 3, 25, 14, 38))
    assert not any(key.startswith("baudrate") for key in none.info["deviceinfo"])


# Error frames (Linux can/error.h).


@pytest.mark.parametrize(
    ("error_class", "data", "words"),
    [
        (0x40, "00" * 8, "bus-off"),
        (0x20, "00" * 8, "no acknowledge: no other node receives at this bitrate"),
        (0x01, "00" * 8, "transmit time-out"),
        (0x02, "00" * 8, "lost arbitration"),
        (0x08, "00" * 8, "protocol violation: another bitrate on the bus, or bad wiring"),
        (0x10, "00" * 8, "transceiver: a line is broken or shorted"),
        (0x80, "00" * 8, "bus error"),
        (0x100, "00" * 8, "controller restarted"),
        (0x00, "00" * 8, "error frame"),
        (0x04, "0001000000000000", "receive buffer overflow"),
        (0x04, "0002000000000000", "transmit buffer overflow"),
        (0x04, "0004000000000000", "receive errors (warning)"),
        (0x04, "0008000000000000", "transmit errors (warning)"),
        (0x04, "0010000000000000", "receive errors (passive)"),
        (0x04, "0020000000000000", "transmit errors (passive)"),
        (0x04, "0040000000000000", "back to error active"),
        (0x04, "0080000000000000", "error frame"),
        (0x04, "00", "error frame"),
        (
            0x0C,
            "0030000000000000",
            "protocol violation: another bitrate on the bus, or bad wiring, receive errors (passive), transmit errors (passive)",
        ),
    ],
)
def test_an_error_frame_in_words(error_class, data, words):
    assert controller.kind(error_class, bytes.fromhex(data)) == words
    assert controller.describe(error_class, bytes.fromhex(data)) == words


@pytest.mark.parametrize("error_class", [0x01, 0x02, 0x08, 0x10, 0x20, 0x80])
def test_data_byte_1_is_read_of_the_class_controller_only(error_class):
    data = bytes([0, 0x7F, 0, 0, 0, 0, 0x60, 0x5F])
    assert controller.describe(error_class, data) == controller.describe(error_class, bytes(8))
    assert controller.condition(error_class, data) is None
    assert controller.error_counters(error_class, data) is None


@pytest.mark.parametrize("length", [0, 1])
def test_a_frame_that_ends_before_data_byte_1_does_not_show_the_controller_state(length):
    assert controller.condition(0x04, bytes(length)) is None
    assert controller.condition(0x104, bytes(length)) is CanErrorState.ACTIVE
    assert controller.kind(0x04, bytes(length)) == "error frame"


@pytest.mark.parametrize(
    ("error_class", "status", "expected"),
    [
        (0x40, 0x40, CanErrorState.OFF),
        (0x04, 0x10, CanErrorState.PASSIVE),
        (0x04, 0x20, CanErrorState.PASSIVE),
        (0x04, 0x2C, CanErrorState.PASSIVE),
        (0x04, 0x04, CanErrorState.WARNING),
        (0x04, 0x08, CanErrorState.WARNING),
        (0x04, 0x48, CanErrorState.WARNING),
        (0x04, 0x40, CanErrorState.ACTIVE),
        (0x04, 0x03, None),
        (0x08, 0x30, None),
        (0x100, 0x00, CanErrorState.ACTIVE),
        (0x104, 0x10, CanErrorState.PASSIVE),
        (0x104, 0x01, CanErrorState.ACTIVE),
    ],
)
def test_the_state_of_a_controller_by_its_error_frame(error_class, status, expected):
    assert controller.condition(error_class, bytes([0, status, 0, 0, 0, 0, 0, 0])) is expected
    assert controller.is_restart(error_class) is bool(error_class & 0x100)


@pytest.mark.parametrize(
    ("error_class", "data", "counters"),
    [
        (0x200, "0000000000000000", (0, 0)),
        (0x200, "000000000000605F", (0x60, 0x5F)),
        (0x004, "000000000000605F", (0x60, 0x5F)),
        (0x004, "0000000000000000", None),
        (0x004, "0000000000000001", (0, 1)),
        (0x008, "000000000000605F", None),
        (0x200, "00000000000060", None),
    ],
)
def test_the_error_counters_of_a_frame(error_class, data, counters):
    found = controller.error_counters(error_class, bytes.fromhex(data))
    assert (None if found is None else tuple(found)) == counters
    text = controller.describe(error_class, bytes.fromhex(data))
    assert ("transmit errors" in text.split("(")[-1]) is (counters is not None)


# The report of a failed transfer.

ENTRY = DictionaryEntry(0x6081, 0, "Profile velocity", DataType.UNSIGNED32)


@pytest.mark.parametrize(
    ("data", "doing"),
    [
        (None, "node 5: reading "),
        (bytes(8), "= 00 00 00 00 00 00 00 00 "),
        (bytes(9), "= 9 bytes "),
        (b"\x0a", "= 0a "),
    ],
)
def test_a_short_value_is_reported_with_the_request(data, doing):
    request = SdoTransferRequest(0x6081, 0, data, 0.5, 3)
    silent = SimpleNamespace(failure=None, strays=[], answers_others=False)
    error = sdo_errors.failed(5, ENTRY, request, silent, "")
    assert isinstance(error, SdoTimeout)
    assert doing in error.message
    assert error.message.endswith("got no answer in 3 attempts of 0.5 s")
    assert (error.node, error.index, error.subindex) == (5, 0x6081, 0)
    assert error.observed == "no frame from its SDO server"
    assert sdo_errors.failed(5, ENTRY, request, silent, "3 error frames").observed == "3 error frames"
    other = SimpleNamespace(failure=None, strays=[b"\1", b"\2\3"], answers_others=False)
    assert (
        sdo_errors.failed(5, ENTRY, request, other, "x").observed
        == "2 frames that answer another request, the last: 02 03"
    )
    assert "a more urgent transfer" in sdo_errors.cancelled(5, ENTRY, request).observed


# An EDS against its device.


def held_against(
    index: int,
    subindex: int,
    access: str,
    default: int,
    data: bytes | None,
    code: int | None = None,
    flags: int = 0,
):
    """Verify one entry of 4 bytes; return the differences."""
    variable = Variable(
        index, subindex, "v", DataType.UNSIGNED32, access, Number(default), object_flags=flags
    )
    device = Store({} if data is None else {(index, subindex): data})
    if code is not None:
        device.refuse[index, subindex, None] = code
    return verify(device, Eds("x", {index: Object(index, "o", ObjectType.RECORD, {subindex: variable})}, {}))


@pytest.mark.parametrize(
    ("index", "subindex", "access", "kind", "severity"),
    [
        (0x1018, 1, "ro", VerifiedAspect.IDENTITY, Severity.ERROR),
        (0x1018, 2, "ro", VerifiedAspect.IDENTITY, Severity.ERROR),
        (0x13FF, 1, "ro", VerifiedAspect.DEFAULT, Severity.NOTE),
        (0x1400, 1, "ro", VerifiedAspect.PDO, Severity.ERROR),
        (0x15FF, 1, "ro", VerifiedAspect.PDO, Severity.ERROR),
        (0x1600, 1, "rw", VerifiedAspect.PDO, Severity.NOTE),
        (0x17FF, 1, "const", VerifiedAspect.PDO, Severity.ERROR),
        (0x1800, 1, "ro", VerifiedAspect.PDO, Severity.ERROR),
        (0x1BFF, 1, "ro", VerifiedAspect.PDO, Severity.ERROR),
        (0x1C00, 1, "ro", VerifiedAspect.DEFAULT, Severity.NOTE),
        (0x2000, 1, "const", VerifiedAspect.DEFAULT, Severity.WARNING),
        (0x2000, 1, "rw", VerifiedAspect.DEFAULT, Severity.NOTE),
    ],
)
def test_how_bad_another_value_is(index, subindex, access, kind, severity):
    found = held_against(index, subindex, access, 7, little(0x1234, 4))
    [difference] = found.differences
    assert (difference.kind, difference.severity, difference.index, difference.subindex) == (
        kind,
        severity,
        index,
        subindex,
    )
    assert "is 0x1234, the EDS has 7" in difference.message
    assert found.agrees is (severity is Severity.NOTE)
    assert (found.read, found.left_out) == (1, 0)
    assert held_against(index, subindex, access, 7, little(7, 4)).differences == ()


@pytest.mark.parametrize(("value", "shown"), [(0xFF, "255"), (0x100, "0x100"), (0x101, "0x101")])
def test_a_number_of_more_than_two_digits_is_shown_in_hex(value, shown):
    [difference] = held_against(0x2000, 1, "rw", 7, little(value, 4)).differences
    assert difference.message == f"is {shown}, the EDS has 7"


@pytest.mark.parametrize(
    ("access", "data", "code", "kind"),
    [
        ("ro", b"\1\2", None, VerifiedAspect.TYPE),
        ("ro", None, None, VerifiedAspect.EXISTENCE),
        ("ro", b"\1", MISSING, VerifiedAspect.EXISTENCE),
        ("ro", b"\1", NO_SUB, VerifiedAspect.EXISTENCE),
        ("ro", b"\1", WRITE_ONLY, VerifiedAspect.ACCESS),
        ("wo", b"\1", WRITE_ONLY, None),
        ("wo", little(7, 4), None, VerifiedAspect.ACCESS),
        ("ro", b"\1", 0x08000000, VerifiedAspect.UNREAD),
    ],
)
def test_differences_between_a_device_and_its_file(access, data, code, kind):
    found = held_against(0x2000, 1, access, 7, data, code)
    assert [difference.kind for difference in found.differences] == ([] if kind is None else [kind])


def test_objects_that_must_not_be_read_are_left_out():
    found = held_against(0x2000, 1, "ro", 7, little(9, 4), flags=2)
    assert (found.read, found.left_out, found.differences) == (0, 1, ())
