"""All listeners of a channel, under any frames: the channel keeps working, and dropped frames are counted."""

from __future__ import annotations

import itertools
import threading
import time
import zlib
from collections.abc import Iterator
from contextlib import closing, contextmanager

import can
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from axisbus.bus.link import detect_other_master
from axisbus.bus.link.channel import Channel
from axisbus.bus.lss import LssMaster
from axisbus.bus.node import discover, from_device
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.pdo.plan import PdoChange, PlannedPdo
from axisbus.bus.pdo.tpdo_inputs import TpdoSlot
from axisbus.bus.sdo.client import SdoClient
from axisbus.bus.sync_and_time import SyncConsumer, TimeConsumer
from axisbus.cia301.datatypes import DataType
from axisbus.cia301.dropped_frames import DropReason, Drops, words
from axisbus.cia301.emcy import explain
from axisbus.cia301.master_detection import ExpectedMasters
from axisbus.cia301.nmt import NmtState
from axisbus.cia301.pdo import MappedObject, PdoConfiguration
from axisbus.cia305.dialogue import LssTiming
from axisbus.errors import AxisbusError, EdsError, SdoError
from kit import fuzz_frames as fuzz
from kit.bus.fake_bus import FakeBus, Slave

ID = fuzz.NODE
MAPPING = (MappedObject(0x6041, 0, 16), MappedObject(0x6064, 0, 32), MappedObject(0x6061, 0, 8))
TPDO = PdoConfiguration(1, 0x180 + ID, True, 1, MAPPING)
PLANNED = PlannedPdo(
    False, TPDO, TPDO, PdoChange.KEEP, ("statusword", "position", "mode"), (False, True, True)
)
_RUNNING = itertools.count()

identifiers = st.one_of(
    st.sampled_from([0, 0x80, 0x100, 0x80 + ID, 0x180 + ID, 0x280 + ID, 0x580 + ID, 0x700 + ID, 0x7E4]),
    st.integers(0, 0x7FF),
    st.integers(0, 0x1FFF_FFFF),
)


@st.composite
def messages(draw: st.DrawFn) -> can.Message:
    kind = draw(st.sampled_from(["data", "data", "data", "data", "extended", "remote", "fd", "error"]))
    identifier = draw(identifiers)
    data = draw(fuzz.any_bytes | fuzz.sdo_answers.map(lambda each: each[:8]))
    return can.Message(
        arbitration_id=identifier,
        is_extended_id=kind == "extended" or identifier > 0x7FF,
        is_remote_frame=kind == "remote",
        is_error_frame=kind == "error",
        is_fd=kind == "fd",
        data=None if kind == "remote" else draw(fuzz.long_bytes) if kind == "fd" else data,
        dlc=len(data) if kind == "remote" else None,
        check=False,
    )


@contextmanager
def opened() -> Iterator[tuple[FakeBus, Channel]]:
    fake = FakeBus()
    with Channel(fake, "socketcan:fake") as channel:
        yield fake, channel


def delivered(fake: FakeBus, channel: Channel) -> None:
    """Wait until all that was put in has been handed on."""
    mark = 0x10_0000 + next(_RUNNING)
    came = threading.Event()
    channel.subscribe(mark, lambda *_: came.set())
    fake.inbox.put(can.Message(arbitration_id=mark, is_extended_id=True))
    assert came.wait(10), "the receive thread is dead"


@given(st.lists(messages(), max_size=30))
@settings(max_examples=60)
def test_no_frame_fails_any_listener(frames):
    with opened() as (fake, channel), CanopenNode(channel, ID) as node:
        slot = TpdoSlot(PLANNED)
        feed = node.emcy.feed()
        channel.subscribe(slot.cob_id, slot.on_frame)
        sync, clock = SyncConsumer(channel, 0x80, 0.01), TimeConsumer(channel)
        for frame in frames:
            fake.inbox.put(frame)
        delivered(fake, channel)
        if channel.off is None:
            channel.check()
        assert channel.failure is None
        samples: dict = {}
        slot.read_into(samples, 0.0)
        for emcy in feed.take():
            assert explain(emcy.code)
        assert node.nmt.describe(time.monotonic())
        assert clock.at(time.monotonic()) is None or clock.latest is not None
        assert all(str(drop) for drop in channel.drops.found)
        assert len(sync._stamps) <= len(frames)


CASES = [
    (0x180 + ID, "37 02 00", {}, DropReason.SHORT_PDO, ID),
    (0x280 + ID, "37 02 00", {}, DropReason.UNKNOWN_PDO, ID),
    (0x80 + ID, "11", {}, DropReason.EMCY, ID),
    (0x80 + ID, "", {}, DropReason.EMCY, ID),
    (0x700 + ID, "", {}, DropReason.HEARTBEAT, ID),
    (0x580 + ID, "43 00 10 00 92 01 02 00", {}, DropReason.SDO, ID),
    (0x580 + ID, "", {}, DropReason.SDO, ID),
    (0x80, "01 02", {}, DropReason.SYNC, None),
    (0x100, "ff ff ff", {}, DropReason.TIME, None),
    (0x180 + ID, "37 02 00 00 00 00 08", {"is_extended_id": True}, DropReason.EXTENDED, ID),
    (0x180 + ID, "37 02 00 00 00 00 08", {"is_fd": True}, DropReason.FD, ID),
    (0x700 + ID, "", {"is_remote_frame": True}, DropReason.REMOTE, ID),
]


@pytest.mark.parametrize(("can_id", "data", "flags", "fault", "node_id"), CASES)
def test_a_dropped_frame_is_counted_with_its_node_and_has_no_effect(can_id, data, flags, fault, node_id):
    with opened() as (fake, channel), CanopenNode(channel, ID) as node:
        slot = TpdoSlot(
            PLANNED, lambda data, stamp: channel.drops.note(DropReason.SHORT_PDO, ID, stamp, 0x185, data)
        )
        channel.subscribe(slot.cob_id, slot.on_frame)
        sync, clock = SyncConsumer(channel, 0x80, 0.01), TimeConsumer(channel)
        for _ in range(3):
            fake.inbox.put(
                can.Message(
                    arbitration_id=can_id, data=bytes.fromhex(data), **{"is_extended_id": False, **flags}
                )
            )
        delivered(fake, channel)
        (drop,) = channel.drops.found
        assert (drop.fault, drop.node, drop.count, drop.can_id) == (fault, node_id, 3, can_id)
        assert drop.data == bytes.fromhex(data)
        assert (node.nmt.state, list(node.emcy.history), sync._stamps) == (NmtState.UNKNOWN, [], [])
        assert slot.stamp == float("-inf")
        assert clock.latest is None


def test_a_boot_up_with_more_than_its_byte_is_one_for_error_control_and_for_the_incidents_alike():
    with opened() as (fake, channel), CanopenNode(channel, ID) as node:
        fake.inject(0x80 + ID, "10 81 01 00 00 00 00 00")
        fake.inject(0x700 + ID, "00 00 00")
        delivered(fake, channel)
        assert node.nmt.bootups == 1
        assert not node.emcy.incidents.open


def test_the_counts_stay_bounded_for_any_senders():
    drops = Drops()
    for node in range(1000):
        drops.note(DropReason.SDO, node, 0.0, 0)
    assert len(drops.found) <= 257
    assert sum(drop.count for drop in drops.found) == 1000
    assert "other frames" in words(drops.found)


def test_dropped_frames_are_reported_in_one_line():
    drops = Drops()
    for _ in range(3):
        drops.note(DropReason.SHORT_PDO, 2, 0.0, 0x182)
    drops.note(DropReason.EMCY, 5, 0.0, 0x85, b"\x11")
    assert words(drops.found) == (
        "dropped: 3 PDOs too short for their mapping (node 2), 1 EMCY without an error code (node 5)"
    )
    assert words(()) == ""


# -- SDO ---------------------------------------------------------------------------------------------------------------


class MadServer:
    """Answers each request by the next frames of a script, with the object that was asked for where ``fitting``."""

    def __init__(self, script: list[tuple[bytes, bool, int]]) -> None:
        self.script = itertools.cycle(script)

    def __call__(self, can_id: int, data: bytes, remote: bool) -> list[tuple[int, bytes]]:
        if can_id != 0x600 + ID or data[0] == 0x80:
            return []
        frame, fitting, times = next(self.script)
        if fitting and len(frame) >= 4 and frame[0] >= 0x40:
            frame = frame[:1] + data[1:4] + frame[4:]
        return [(0x580 + ID, frame)] * times


@given(st.lists(st.tuples(fuzz.sdo_answers, st.booleans(), st.integers(0, 3)), min_size=1, max_size=6))
@settings(max_examples=40)
def test_a_client_ends_for_any_answers_and_the_next_call_is_independent(script):
    with opened() as (fake, channel), closing(SdoClient(channel, ID, timeout=0.004, tries=2)) as sdo:
        mad = MadServer(script)
        fake.peers.append(mad)
        for act in (
            lambda: sdo.read(0x1000),
            lambda: sdo.write_unchecked(0x1017, 0, 100),
            lambda: sdo.download(0x1F50, 1, bytes(300)),
            lambda: sdo.read(0x1008),
        ):
            with fuzz.within(20):
                assert str(fuzz.outcome(act)) is not None
        fake.peers[:] = [Slave(ID)]
        assert sdo.upload(0x1001, tries=3, timeout=1.0) == b"\0"


def test_a_size_beyond_any_object_is_refused_unless_the_requested_type_permits_it():
    with opened() as (fake, channel), CanopenNode(channel, ID) as node:
        fake.peers.append(Slave(ID, {(0x1018, 1): b"x" * 300}))
        with pytest.raises(SdoError, match="300 bytes announced, at most 256 are accepted"):
            node.sdo.read(0x1018, 1)
        assert node.sdo.read(0x1018, 1, data_type=DataType.VISIBLE_STRING) == "x" * 300
        assert node.sdo.upload(0x1018, 1, most=300) == b"x" * 300


def test_unrequested_answers_are_counted_and_not_stored():
    with opened() as (fake, channel), CanopenNode(channel, ID) as node:
        for _ in range(500):
            fake.inject(0x580 + ID, "43 01 10 00 ff ff ff ff")
        delivered(fake, channel)
        assert len(node.sdo._line.inbox) == 0
        fake.peers.append(Slave(ID))
        assert node.sdo.upload(0x1001) == b"\0"
        (drop,) = channel.drops.found
        assert (drop.fault, drop.node, drop.count) == (DropReason.SDO, ID, 500)


def test_answers_that_fit_nothing_during_a_transfer_are_counted():
    with opened() as (fake, channel), CanopenNode(channel, ID) as node:
        fake.peers += [
            lambda can_id, *_: (
                [(0x580 + ID, bytes.fromhex("4f05200001000000"))] * 2 if can_id == 0x600 + ID else []
            ),
            Slave(ID),
        ]
        assert node.sdo.upload(0x1001) == b"\0"
        (drop,) = channel.drops.found
        assert (drop.fault, drop.node, drop.count) == (DropReason.SDO, ID, 2)


# -- others that ask ---------------------------------------------------------------------------------------------------


@given(st.lists(messages(), max_size=20))
@settings(max_examples=8)
def test_no_frame_fails_listening_before_the_bus_is_opened(frames):
    with opened() as (fake, channel):
        for frame in frames:
            if not frame.is_error_frame:
                fake.inbox.put(frame)
        cast = ExpectedMasters(frozenset({1}), frozenset({127}))
        for look in (
            lambda: detect_other_master.require_no_other_master(channel, cast, 0.02),
            lambda: detect_other_master.bus_activity(channel, 0.01),
        ):
            assert str(fuzz.outcome(look))
        assert channel.failure is None


@given(
    st.lists(st.tuples(fuzz.sdo_answers, st.booleans(), st.integers(0, 2)), min_size=1, max_size=6),
    fuzz.any_bytes,
)
@settings(max_examples=4)
def test_a_scan_of_the_bus_ends_for_any_answers(script, heartbeat):
    with opened() as (fake, channel), fuzz.within(20):
        fake.peers.append(MadServer(script))
        fake.inject(0x700 + ID, heartbeat)
        for found in discover.scan(channel, ids=(ID,), listen=0.02):
            assert found.node_id == ID
            assert isinstance(found.kind, str)


def test_a_device_type_is_not_read_out_of_another_objects_answer():
    with opened() as (fake, channel):
        fake.peers.append(MadServer([(bytes.fromhex("4300200092010200"), False, 1)]))
        (found,) = discover.scan(channel, ids=(ID,), listen=0.05)
        assert found.identity.device_type is None


@pytest.mark.parametrize(
    ("stored", "seen"),
    [
        (b"no zip at all, and longer than four bytes", "incorrect header"),
        (zlib.compress(b"[FileInfo]\n" * 100)[:-6], "its end is missing"),
        (zlib.compress(bytes(40 << 20)), "more than"),
    ],
)
def test_a_stored_eds_that_cannot_be_unpacked_is_one_clear_error(stored, seen):
    with opened() as (fake, channel), CanopenNode(channel, ID) as node:
        fake.peers.append(Slave(ID, {(0x1021, 0): stored, (0x1022, 0): b"\x01"}))
        with pytest.raises(EdsError, match=seen):
            from_device.stored_eds(node.sdo)


@given(st.binary(max_size=40), st.binary(max_size=8))
@settings(max_examples=10)
def test_a_stored_eds_of_any_bytes_is_read_refused_or_missing(stored, kind):
    with opened() as (fake, channel), CanopenNode(channel, ID) as node:
        fake.peers.append(Slave(ID, {(0x1021, 0): stored, (0x1022, 0): kind}))
        found = fuzz.outcome(lambda: from_device.stored_eds(node.sdo))
        assert found is None or isinstance(found, (bytes, AxisbusError))


# -- LSS ---------------------------------------------------------------------------------------------------------------


class Endless:
    """A queue in which there is always another answer, as of a slave that talks faster than is read."""

    def take(self, until: float) -> tuple[bytes, float]:
        return b"\x4f" + bytes(7), time.monotonic()


def test_a_slave_that_sends_without_a_pause_delays_the_end_of_no_wait(monkeypatch):
    with opened() as (_, channel):
        master = LssMaster(channel, LssTiming(floor=0.002, first=0.01, ceiling=0.02), beside_operation=True)
        monkeypatch.setattr(master, "_inbox", Endless())
        with fuzz.within(10):
            assert not master.any_unconfigured()  # its answer has another meaning
        (drop,) = channel.drops.found
        assert drop.fault is DropReason.LSS
        assert drop.count > 10
