"""Finding the nodes on the bus: quickly, without overrunning a short queue, and without waiting for absent nodes."""

from __future__ import annotations

import threading
import time
from itertools import pairwise

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.node import discover
from axisbus.bus.node.discover import scan
from axisbus.cia301.nmt import NmtState
from axisbus.errors import AdapterError
from kit.bus.fake_bus import FakeBus, Slave


def drive(node_id: int) -> Slave:
    return Slave(
        node_id,
        {
            (0x1018, 1): (0xC0B00).to_bytes(4, "little"),
            (0x1018, 2): (8).to_bytes(4, "little"),
            (0x1018, 3): (0x10002).to_bytes(4, "little"),
            (0x1018, 4): (4711).to_bytes(4, "little"),
            (0x1008, 0): b"GIM6010-8",
            (0x100A, 0): b"0.5.13",
        },
    )


def test_every_device_is_found_with_its_identity(channel: Channel, fake: FakeBus) -> None:
    fake.peers += [drive(1), drive(127), Slave(64)]
    begin = time.monotonic()
    found = scan(channel, listen=0.6)
    elapsed = time.monotonic() - begin
    assert [node.node_id for node in found] == [1, 64, 127]
    identity = found[0].identity
    assert (identity.vendor_id, identity.product_code, identity.serial) == (0xC0B00, 8, 4711)
    assert (identity.device_name, identity.hardware_version, identity.software_version) == (
        "GIM6010-8",
        None,
        "0.5.13",
    )
    assert found[0].kind == "servo drive (CiA 402)"
    assert found[1].identity.vendor_id is None  # it has no 1018h
    assert elapsed < 3.0


def test_a_stopped_node_is_found_by_its_heartbeat(channel: Channel, fake: FakeBus) -> None:
    stopped = drive(7)
    stopped.nmt_state = 4
    fake.peers.append(stopped)
    timer = threading.Timer(0.05, lambda: fake.inject(0x707, "04"))
    timer.start()
    (found,) = scan(channel, ids=range(1, 10), listen=0.3)
    timer.join()
    assert (found.node_id, found.answers_sdo, found.nmt) == (7, False, NmtState.STOPPED)
    assert found.kind == ""


def test_a_node_whose_first_answer_was_lost_is_found_all_the_same(channel: Channel, fake: FakeBus) -> None:
    slave = drive(3)
    slave.ignore = 1
    fake.peers.append(slave)
    assert [node.node_id for node in scan(channel, ids=(3,), listen=0.2)] == [3]


def test_a_node_that_refuses_its_device_type_is_there(channel: Channel, fake: FakeBus) -> None:
    slave = drive(3)
    del slave.objects[0x1000, 0]
    fake.peers.append(slave)
    (found,) = scan(channel, ids=(3,), listen=0.1)
    assert found.identity.device_type is None
    assert found.identity.serial == 4711


def test_a_queue_of_ten_frames_is_never_overrun(channel: Channel, fake: FakeBus) -> None:
    """At 125 kbit/s the wire takes about one frame per millisecond."""
    stamps: list[float] = []

    def note(can_id: int, data: bytes, remote: bool) -> list[tuple[int, bytes]]:
        stamps.append(time.monotonic())
        return []

    fake.peers.append(note)
    scan(channel, listen=0.5)
    queue = worst = 0.0
    for before, after in pairwise(stamps):
        queue = max(0.0, queue + 1 - (after - before) / 0.001)
        worst = max(worst, queue)
    assert len(stamps) == 2 * 127
    assert worst < 10


def test_an_empty_bus_is_an_empty_list(channel: Channel) -> None:
    assert scan(channel, ids=range(1, 10), listen=0.05) == []


def test_a_bus_on_which_no_node_acknowledges_is_reported(channel: Channel, fake: FakeBus) -> None:
    fake.full = True
    with pytest.raises(AdapterError, match="refused frame 601h") as caught:
        scan(channel)
    assert "acknowledges" in caught.value.remedy


def test_after_a_scan_there_is_no_subscription(channel: Channel, fake: FakeBus) -> None:
    fake.peers.append(drive(3))
    scan(channel, ids=(3, 4), listen=0.05)
    assert channel._receivers == {}
    assert channel.on_failure == []


def test_each_id_is_asked_for_its_device_type_and_the_silent_ones_once_more(
    channel: Channel, fake: FakeBus
) -> None:
    fake.peers.append(drive(3))
    scan(channel, ids=(2, 3), listen=0.2)
    asked = [(can_id, data.hex(" ")) for can_id, data in fake.sent]
    request = "40 00 10 00 00 00 00 00"
    assert asked[:3] == [(0x602, request), (0x603, request), (0x602, request)]
    assert [data for can_id, data in asked[3:] if can_id == 0x602] == []


def test_the_second_request_is_sent_in_the_middle_of_the_listening_time(
    channel: Channel, fake: FakeBus, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A slow node has as long to answer the one as the other."""
    until: list[float] = []
    monkeypatch.setattr(discover, "sleep_until", lambda _clock, t: until.append(t))
    asked: list[int] = []
    fake.peers.append(lambda *_: asked.append(len(until)) or [])
    assert scan(channel, ids=(3,), listen=9.0) == []
    assert asked == [1, 2]
    first, second, end = until
    assert end - second == pytest.approx(second - first)
    assert end - first == pytest.approx(9.0 * (1 - 0.33))


@pytest.mark.parametrize("answer", ["43 00 10 00", "43 00 10 00 92 01", "43 00 10 00 92 01 02"])
def test_an_answer_that_is_too_short_reports_no_device_type(
    channel: Channel, fake: FakeBus, answer: str
) -> None:
    answers = [bytes.fromhex(answer)]
    fake.peers.append(lambda can_id, *_: [(0x582, answers.pop())] if can_id == 0x602 and answers else [])
    (found,) = scan(channel, ids=(2,), listen=0.1)
    assert (found.node_id, found.answers_sdo, found.identity.device_type) == (2, True, None)


def test_a_node_that_aborts_its_device_type_is_found_without_a_kind(channel: Channel, fake: FakeBus) -> None:
    fake.peers.append(
        lambda can_id, *_: [(0x582, bytes.fromhex("80 00 10 00 00 00 02 06"))] if can_id == 0x602 else []
    )
    (found,) = scan(channel, ids=(1, 2, 3), listen=0.2)
    assert (found.node_id, found.answers_sdo, found.nmt, found.kind, found.identity.device_type) == (
        2,
        True,
        None,
        "",
        None,
    )


def test_a_node_that_stops_answering_after_its_device_type_is_found_with_that_alone(
    channel: Channel, fake: FakeBus
) -> None:
    answers = [bytes.fromhex("43 00 10 00 92 01 02 00")]
    fake.peers.append(lambda can_id, *_: [(0x582, answers.pop())] if can_id == 0x602 and answers else [])
    (found,) = scan(channel, ids=(2,), listen=0.1)
    assert (found.answers_sdo, found.identity.device_type, found.kind) == (
        True,
        0x00020192,
        "servo drive (CiA 402)",
    )
