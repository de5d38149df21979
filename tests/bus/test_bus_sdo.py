"""The SDO client against a slave written frame by frame: each trap of the protocol is one scenario."""

from __future__ import annotations

import gc
import threading
import time
from collections.abc import Callable
from types import SimpleNamespace

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.sdo import client
from axisbus.bus.sdo.client import SdoClient
from axisbus.bus.sdo.transfer import SdoConnection
from axisbus.errors import AdapterError, AxisbusError, Interrupted, SdoAbort, SdoError, SdoTimeout, StateError
from kit.bus.fake_bus import FakeBus, Frame, Slave, eventually

NODE = 5
SHORT = 0.05  # an answer time that tests of silence can afford


@pytest.fixture
def slave(fake: FakeBus) -> Slave:
    slave = Slave(
        NODE,
        {
            (0x6081, 0): (1000).to_bytes(4, "little"),
            (0x6083, 0): (2000).to_bytes(4, "little"),
            (0x6060, 0): b"\x01",
            (0x6041, 0): b"\x37\x06",
            (0x1008, 0): b"A drive with a long name",
            (0x2000, 1): b"",
        },
    )
    fake.peers.append(slave)
    return slave


@pytest.fixture
def sdo(channel: Channel, slave: Slave) -> SdoClient:
    return SdoClient(channel, NODE)


@pytest.fixture
def hasty(channel: Channel, slave: Slave) -> SdoClient:
    return SdoClient(channel, NODE, timeout=SHORT)


def in_thread(work: Callable[[], object]) -> tuple[threading.Thread, list[object]]:
    """Run ``work`` in a thread of its own; the list gets its result or its exception."""
    result: list[object] = []

    def run() -> None:
        try:
            result.append(work())
        except AxisbusError as error:
            result.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    return thread, result


def give(fake: FakeBus, frames: list[Frame]) -> None:
    for can_id, data in frames:
        fake.inject(can_id, data)


# -- the dialogue of frames


def test_an_expedited_upload_frame_by_frame(sdo: SdoClient, fake: FakeBus) -> None:
    assert sdo.upload(0x6041) == b"\x37\x06"
    assert fake.sent == [(0x605, bytes.fromhex("40 41 60 00 00 00 00 00"))]


@pytest.mark.parametrize(
    ("answer", "index", "taken"),
    [
        ("42 41 60 00 37 06 AA AA", 0x6041, "37 06"),  # as long as the object's type
        ("42 60 60 00 FF AA AA AA", 0x6060, "FF"),
        ("42 7A 60 00 01 02 03 04", 0x607A, "01 02 03 04"),
        ("42 00 20 00 01 02 AA AA", 0x2000, "01 02 AA AA"),  # its type is not known
        ("43 41 60 00 37 06 00 00", 0x6041, "37 06 00 00"),  # it announces four bytes
    ],
)
def test_an_answer_without_a_size_has_the_size_of_the_type(
    fake: FakeBus, channel: Channel, answer: str, index: int, taken: str
) -> None:
    fake.peers.append(lambda can_id, *_: [(0x585, bytes.fromhex(answer))] if can_id == 0x605 else [])
    assert SdoClient(channel, NODE).upload(index) == bytes.fromhex(taken)


@pytest.mark.parametrize(
    ("data", "frame"),
    [
        (b"\x01", "2F 60 60 00 01 00 00 00"),
        (b"\x34\x12", "2B 60 60 00 34 12 00 00"),
        (b"\x56\x34\x12", "27 60 60 00 56 34 12 00"),
        (b"\x78\x56\x34\x12", "23 60 60 00 78 56 34 12"),
    ],
)
def test_an_expedited_download_contains_its_size(
    sdo: SdoClient, fake: FakeBus, data: bytes, frame: str
) -> None:
    sdo.download(0x6060, 0, data)
    assert fake.sent == [(0x605, bytes.fromhex(frame))]


def test_a_segmented_upload(sdo: SdoClient, fake: FakeBus) -> None:
    assert sdo.upload(0x1008) == b"A drive with a long name"
    assert [data[0] for data in fake.frames(0x605)] == [0x40, 0x60, 0x70, 0x60, 0x70]


def test_a_segmented_download(sdo: SdoClient, fake: FakeBus, slave: Slave) -> None:
    sdo.download(0x1008, 0, b"another name of it")
    assert slave.objects[0x1008, 0] == b"another name of it"
    assert [data.hex(" ") for data in fake.frames(0x605)] == [
        "21 08 10 00 12 00 00 00",
        "00 61 6e 6f 74 68 65 72",
        "10 20 6e 61 6d 65 20 6f",
        "07 66 20 69 74 00 00 00",
    ]


def test_an_empty_value_is_read_and_written(sdo: SdoClient, slave: Slave) -> None:
    assert sdo.upload(0x2000, 1) == b""
    slave.objects[0x2000, 1] = b"x"
    sdo.download(0x2000, 1, b"")
    assert slave.objects[0x2000, 1] == b""


# -- cases that canopen's client handles wrongly ----


def test_the_late_answer_of_a_timed_out_write_is_not_accepted_for_the_next(
    hasty: SdoClient, slave: Slave, fake: FakeBus
) -> None:
    """The same object is written twice; the answer to the first write comes while the second one waits."""
    hasty.tries = 1
    slave.hold = True
    with pytest.raises(SdoTimeout):
        hasty.download(0x6081, 0, (1).to_bytes(4, "little"))
    late = slave.release()
    slave.abort_on[0x6081, 0] = 0x0609_0031
    hasty.timeout = 5.0
    give(fake, late)  # 60 81 60 00: would pass for the success of the second write
    with pytest.raises(SdoAbort) as caught:
        hasty.download(0x6081, 0, (2).to_bytes(4, "little"))
    assert caught.value.code == 0x0609_0031


def test_a_late_answer_received_after_the_next_request_is_drained(
    hasty: SdoClient, slave: Slave, fake: FakeBus
) -> None:
    """The server is slow, not dead: it answers everything in order, once the second transfer has begun."""
    hasty.tries = 1
    slave.hold = True
    with pytest.raises(SdoTimeout):
        hasty.upload(0x6081)
    hasty.timeout = 5.0
    thread, result = in_thread(lambda: hasty.upload(0x6081))
    eventually(lambda: len(slave.held) == 2)  # the barrier has been asked for
    slave.objects[0x6081, 0] = (7).to_bytes(4, "little")
    give(fake, slave.release())
    thread.join(5)
    assert result == [(7).to_bytes(4, "little")]


def test_the_late_answer_of_the_barriers_own_object_is_drained_too(
    hasty: SdoClient, slave: Slave, fake: FakeBus
) -> None:
    hasty.tries = 1
    slave.hold = True
    with pytest.raises(SdoTimeout):
        hasty.upload(0x1000)
    slave.release()
    hasty.timeout = 5.0
    hasty.upload(0x1000)
    assert fake.frames(0x605)[2:] == [
        bytes.fromhex("40 01 10 00 00 00 00 00"),
        bytes.fromhex("40 00 10 00 00 00 00 00"),
    ]


def test_two_threads_make_600_transfers_without_a_failure(sdo: SdoClient, slave: Slave) -> None:
    def read_many(index: int, expected: bytes) -> int:
        return sum(sdo.upload(index) == expected for _ in range(300))

    one, first = in_thread(lambda: read_many(0x6081, (1000).to_bytes(4, "little")))
    two, second = in_thread(lambda: read_many(0x1008, b"A drive with a long name"))
    one.join(50)
    two.join(50)
    assert first == [300]
    assert second == [300]


def test_our_abort_names_the_object(hasty: SdoClient, slave: Slave) -> None:
    hasty.tries = 1
    slave.ignore = 1
    with pytest.raises(SdoTimeout):
        hasty.upload(0x6081)
    assert slave.aborts_received == [(0x6081, 0, 0x0504_0000)]


def test_one_lost_answer_is_repaired_by_another_attempt(hasty: SdoClient, slave: Slave) -> None:
    slave.ignore = 1
    hasty.timeout = 0.5
    assert hasty.upload(0x6081) == (1000).to_bytes(4, "little")


def test_a_silent_node_costs_the_tries_and_no_more(hasty: SdoClient, slave: Slave) -> None:
    slave.ignore = 1000
    begin = time.monotonic()
    with pytest.raises(SdoTimeout) as caught:
        hasty.upload(0x6081)
    assert time.monotonic() - begin >= 3 * SHORT
    assert (caught.value.node, caught.value.index, caught.value.subindex) == (NODE, 0x6081, 0)
    assert "6081h:00 (Profile velocity)" in str(caught.value)
    assert isinstance(caught.value, TimeoutError)


def test_an_abort_for_another_object_is_ignored(sdo: SdoClient, slave: Slave, fake: FakeBus) -> None:
    slave.hold = True
    thread, result = in_thread(lambda: sdo.upload(0x6081))
    eventually(lambda: slave.held)
    fake.inject(0x585, "80 64 60 00 00 00 02 06")
    give(fake, slave.release())
    thread.join(5)
    assert result == [(1000).to_bytes(4, "little")]


def test_an_abort_without_multiplexer_ends_our_transfer(sdo: SdoClient, slave: Slave, fake: FakeBus) -> None:
    """Some servers leave the multiplexer of their aborts empty."""
    slave.hold = True
    thread, result = in_thread(lambda: sdo.upload(0x6081))
    eventually(lambda: slave.held)
    fake.inject(0x585, "80 00 00 00 00 00 00 08")
    thread.join(5)
    assert isinstance(result[0], SdoAbort)
    assert result[0].code == 0x0800_0000


def test_the_answer_to_another_master_is_ignored(hasty: SdoClient, slave: Slave, fake: FakeBus) -> None:
    hasty.tries = 1
    slave.hold = True
    hasty.timeout = 0.3
    thread, result = in_thread(lambda: hasty.upload(0x6081))
    eventually(lambda: slave.held)
    fake.inject(0x585, "43 64 60 00 01 02 03 04")
    thread.join(5)
    assert isinstance(result[0], SdoTimeout)
    assert "43 64 60 00" in result[0].observed


def noted_trips(sdo: SdoClient) -> list[tuple[float, float]]:
    """The round trips that its transfers note from now on."""
    noted: list[tuple[float, float]] = []
    sdo._line.trips = SimpleNamespace(note=lambda asked, heard: noted.append((asked, heard)))
    return noted


def test_each_answer_is_a_round_trip_from_its_own_request(sdo: SdoClient) -> None:
    noted, began = noted_trips(sdo), time.monotonic()
    sdo.upload(0x6081)
    sdo.upload(0x1008)  # in four segments, the first request included
    assert len(noted) == 1 + 5
    times = [moment for trip in noted for moment in trip]
    assert times == sorted(times)
    assert began <= times[0]


def test_the_answer_after_a_lost_one_is_a_round_trip_from_the_request_behind_the_barrier(
    hasty: SdoClient, slave: Slave
) -> None:
    noted = noted_trips(hasty)
    slave.ignore, hasty.timeout = 1, 0.5
    hasty.upload(0x6081)
    ((asked, heard),) = noted
    assert heard - asked < 0.5


def test_the_answer_to_another_master_is_no_round_trip(sdo: SdoClient, slave: Slave, fake: FakeBus) -> None:
    noted = noted_trips(sdo)
    slave.hold = True
    thread, _ = in_thread(lambda: sdo.upload(0x6081))
    eventually(lambda: slave.held)
    fake.inject(0x585, "43 64 60 00 01 02 03 04")
    eventually(lambda: sdo._line.heard and not sdo._line.inbox)
    give(fake, slave.release())
    thread.join(5)
    assert len(noted) == 1


def test_a_toggle_error_is_aborted_and_tried_again(sdo: SdoClient, slave: Slave) -> None:
    slave.flip_toggle = 1
    assert sdo.upload(0x1008) == b"A drive with a long name"
    assert slave.aborts_received == [(0x1008, 0, 0x0503_0000)]


def test_a_toggle_that_never_alternates_is_an_error(sdo: SdoClient, slave: Slave) -> None:
    slave.flip_toggle = 1000
    with pytest.raises(SdoError, match="failed in 3 attempts") as caught:
        sdo.upload(0x1008)
    assert "oggle" in caught.value.observed


def test_a_given_up_download_sends_no_segment_from_the_grave(
    hasty: SdoClient, slave: Slave, fake: FakeBus
) -> None:
    """canopen's stream sends a last segment when the garbage collector closes it."""
    hasty.tries = 1
    slave.ignore = 1
    with pytest.raises(SdoTimeout):
        hasty.download(0x1008, 0, b"more than four bytes")
    gc.collect()
    assert [data[0] for data in fake.frames(0x605)] == [0x21, 0x80]  # the request and our abort


def test_the_servers_abort_is_raised_with_its_words(sdo: SdoClient) -> None:
    with pytest.raises(SdoAbort) as caught:
        sdo.upload(0x60FE, 1)
    error = caught.value
    assert (error.node, error.index, error.subindex, error.code) == (NODE, 0x60FE, 1, 0x0602_0000)
    assert "Object does not exist" in error.observed
    assert "EDS" in error.remedy


@pytest.mark.parametrize(
    "transfer",
    [
        lambda sdo: sdo.upload(0x6081),
        lambda sdo: sdo.download(0x6060, 0, b"\x01"),
        lambda sdo: sdo.download_urgent(0x6060, 0, b"\x01"),
    ],
    ids=["read", "write", "urgent write"],
)
def test_a_call_in_the_receive_thread_is_an_error_not_a_time_out(
    sdo: SdoClient, channel: Channel, fake: FakeBus, transfer: Callable[[SdoClient], object]
) -> None:
    caught: list[Exception] = []
    sdo.timeout = SHORT

    def receiver(data: bytes, _: float) -> None:
        try:
            transfer(sdo)
        except (StateError, SdoTimeout) as error:
            caught.append(error)

    channel.subscribe(0x185, receiver)
    fake.inject(0x185, "00")
    eventually(lambda: caught)
    assert "an SDO transfer was called in the receive thread" in str(caught[0])
    assert fake.sent == []


def test_a_channel_that_fails_ends_the_waiting_at_once(sdo: SdoClient, slave: Slave, fake: FakeBus) -> None:
    sdo.timeout = 60.0
    slave.hold = True
    thread, result = in_thread(lambda: sdo.upload(0x6081))
    eventually(lambda: slave.held)
    fake.fail_receiving(OSError("unplugged"))
    thread.join(5)
    assert isinstance(result[0], AdapterError)


# -- behind the end


def test_an_answer_after_the_end_of_a_transfer_is_counted_as_unexpected_at_once(
    sdo: SdoClient, fake: FakeBus, channel: Channel
) -> None:
    assert sdo.upload(0x6041) == b"\x37\x06"
    fake.inject(0x585, "4B 41 60 00 37 06 00 00")
    eventually(lambda: channel.drops.found)
    assert [str(drop) for drop in channel.drops.found] == [
        "1 SDO answer that nothing was waiting for (node 5)"
    ]


def test_answers_left_from_a_transfer_are_dropped_and_counted_when_the_next_one_begins(
    channel: Channel, fake: FakeBus
) -> None:
    line = SdoConnection(channel, NODE)
    line.open()
    for _ in range(2):
        fake.inject(0x585, "4B 41 60 00 37 06 00 00")
    eventually(lambda: len(line.inbox) == 2)
    line.wake()
    line.finish()
    line.open()
    assert len(line.inbox) == 0
    assert [drop.count for drop in channel.drops.found] == [2]
    line.close()


# -- yielding ----


def test_cancel_ends_the_running_transfer_and_aborts_it_at_the_node(sdo: SdoClient, slave: Slave) -> None:
    sdo.timeout = 60.0
    slave.hold = True
    thread, result = in_thread(lambda: sdo.upload(0x6081))
    eventually(lambda: slave.held)
    sdo.cancel()
    thread.join(5)
    assert isinstance(result[0], Interrupted)
    assert slave.aborts_received == [(0x6081, 0, 0x0800_0000)]


def test_an_urgent_write_does_not_wait_for_a_silent_node(sdo: SdoClient, slave: Slave, fake: FakeBus) -> None:
    """The quick stop of a drive without a mapped controlword."""
    slave.objects[0x6040, 0] = b"\x0f\x00"
    sdo.timeout = 60.0
    slave.hold = True
    thread, result = in_thread(lambda: sdo.upload(0x6081))
    eventually(lambda: slave.held)
    slave.release()
    sdo.download_urgent(0x6040, 0, b"\x02\x00")
    thread.join(5)
    assert slave.objects[0x6040, 0] == b"\x02\x00"
    assert isinstance(result[0], Interrupted)
    kinds = [data[0] for data in fake.frames(0x605)]
    assert kinds == [0x40, 0x80, 0x2B]  # no barrier before it


def test_an_urgent_write_is_sent_while_a_transfer_holds_the_lock_and_the_transfer_then_continues(
    sdo: SdoClient, slave: Slave, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(client, "URGENT_LOCK", 0.03)
    slave.objects[0x6040, 0] = b"\x0f\x00"
    with sdo._lock:
        begin = time.monotonic()
        sdo.download_urgent(0x6040, 0, b"\x02\x00")
        assert time.monotonic() - begin > 0.025
        assert slave.objects[0x6040, 0] == b"\x02\x00"
        assert sdo._lock.locked()
    sdo.download_urgent(0x6040, 0, b"\x06\x00")
    assert not sdo._lock.locked()
    assert sdo.upload(0x6040) == b"\x06\x00"


def test_cancel_without_a_transfer_harms_nothing(sdo: SdoClient) -> None:
    sdo.cancel()
    assert sdo.upload(0x6041) == b"\x37\x06"
