"""Frames that the scan reads itself: from a socket of their own, with the time at which the kernel had them."""

from __future__ import annotations

import socket
import struct
import time
from types import SimpleNamespace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from axisbus.bus.link import raw_sockets
from axisbus.bus.link.channel import Channel
from axisbus.bus.link.raw_sockets import CyclicSocket, all_but, cyclic_socket
from axisbus.errors import AdapterError
from kit.bus.can_frame import can_frame
from kit.bus.fake_bus import FakeBus

SO_TIMESTAMPNS = 35


class Line(CyclicSocket):
    """A pair of sockets instead of a CAN link; ``asked`` holds the requested identifiers."""

    def __init__(self, stamps: bool = True) -> None:
        self.far, near = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        near.setblocking(False)
        if stamps:
            near.setsockopt(socket.SOL_SOCKET, SO_TIMESTAMPNS, 1)
        super().__init__(near, None)
        self.asked: list[frozenset[int]] = []
        self.takes = True

    def listen(self, can_ids) -> bool:
        self.asked.append(frozenset(can_ids))
        return self.takes


@pytest.fixture
def line():
    made = Line()
    yield made
    made.far.close()
    made.close()


def test_each_frame_is_received_once_in_order_with_its_data(line):
    line.far.send(can_frame(0x181, b"\1\2\3"))
    line.far.send(can_frame(0x182, b""))
    line.far.send(can_frame(0x181, bytes(8)))
    assert [(can_id, data) for can_id, data, _ in line.drain()] == [
        (0x181, b"\1\2\3"),
        (0x182, b""),
        (0x181, bytes(8)),
    ]
    assert list(line.drain()) == []


def test_the_stamp_of_a_frame_is_its_reception_and_not_its_reading(line):
    list(line.drain())
    before = time.monotonic()
    line.far.send(can_frame(0x181, b""))
    after = time.monotonic()
    time.sleep(0.05)
    ((_, _, stamp),) = line.drain()
    assert before - 0.005 <= stamp <= after + 0.005


def test_without_the_kernels_time_it_is_that_of_reading():
    line = Line(stamps=False)
    line.far.send(can_frame(0x181, b""))
    before = time.monotonic()
    ((_, _, stamp),) = line.drain()
    assert before <= stamp <= time.monotonic()
    line.far.close()
    line.close()


@pytest.mark.parametrize(("set_by", "expected"), [(-3600.0, 11.0), (3600.0, 10.0)])
def test_a_clock_that_is_set_makes_no_frame_older_than_the_last_look_or_of_the_future(
    monkeypatch, line, set_by, expected
):
    clock = SimpleNamespace(now=10.0)
    real = time.time()
    monkeypatch.setattr(
        raw_sockets, "time", SimpleNamespace(monotonic=lambda: clock.now, time=lambda: real + set_by)
    )
    list(line.drain())
    line.far.send(can_frame(0x181, b""))
    clock.now = 11.0
    ((_, _, stamp),) = line.drain()
    assert stamp == expected


def test_a_short_frame_ends_the_look(line):
    line.far.send(b"\1\2")
    assert list(line.drain()) == []


def test_more_frames_than_one_call_returns_are_all_received(line):
    for number in range(200):
        line.far.send(can_frame(0x181, bytes((number,))))
    assert [data[0] for _, data, _ in line.drain()] == list(range(200))
    assert line.drain() == []


def test_the_frames_sent_before_the_other_end_of_a_pair_closed_are_the_last(line):
    line.far.send(can_frame(0x181, b"\1"))
    line.far.close()
    assert [data for _, data, _ in line.drain()] == [b"\1"]
    assert line.drain() == []


def test_each_frame_has_its_own_receive_time_and_not_that_of_the_frame_before(line):
    line.far.send(can_frame(0x181, b""))
    ((_, _, first),) = line.drain()
    time.sleep(0.02)
    line.far.send(can_frame(0x181, b""))
    ((_, _, second),) = line.drain()
    assert 0.015 <= second - first <= 1.0


# -- on a channel ---------------------------------------------------------------------------------------------------------


def channel_on(line: Line) -> Channel:
    return Channel(FakeBus(), "socketcan:fake", cyclic=line)


def test_a_channel_passes_drained_frames_to_subscribers_and_frame_listeners(line):
    heard: list[tuple[str, bytes]] = []
    with channel_on(line) as channel:
        channel.subscribe_cyclic(0x181, lambda data, _: heard.append(("slot", data)))
        channel.subscribe(0x181, lambda data, _: heard.append(("other", data)))
        line.far.send(can_frame(0x181, b"\5"))
        with channel.frames_to(lambda one: heard.append((f"ear {one.can_id:03X}", one.data))):
            channel.drain()
        line.far.send(can_frame(0x181, b"\6"))
        channel.drain()
        assert channel.counters.received == 2
    assert heard == [("ear 181", b"\5"), ("slot", b"\5"), ("other", b"\5"), ("slot", b"\6"), ("other", b"\6")]


def test_a_channel_listens_only_for_subscribed_identifiers(line):
    def receiver(_data, _stamp):
        raise AssertionError

    with channel_on(line) as channel:
        channel.subscribe_cyclic(0x181, receiver)
        channel.subscribe_cyclic(0x182, receiver)
        channel.subscribe_cyclic(0x1234_5678, receiver)  # 29 bits: the receive thread's
        channel.unsubscribe(0x181, receiver)
        channel.unsubscribe(0x182, receiver)
        line.far.send(can_frame(0x182, b""))
        channel.drain()
        channel.check()
    assert line.asked == [{0x181}, {0x181, 0x182}, {0x182}, set()]


def test_if_the_kernel_does_not_filter_nothing_is_drained(line):
    line.takes = False
    heard = []
    with channel_on(line) as channel:
        channel.subscribe_cyclic(0x181, lambda data, _: heard.append(data))
        line.far.send(can_frame(0x181, b""))
        channel.drain()
    assert heard == []


def test_a_lost_link_is_reported_by_the_next_check(line):
    with channel_on(line) as channel:
        channel.subscribe_cyclic(0x181, lambda *_: None)
        line._raw.close()
        channel.drain()
        with pytest.raises(AdapterError, match="stopped receiving"):
            channel.check()


def test_a_channel_that_is_being_closed_has_not_failed(line):
    told: list[object] = []
    channel = channel_on(line)
    channel.on_failure.append(told.append)
    channel.subscribe_cyclic(0x181, lambda *_: None)
    channel.close()
    channel.drain()
    assert told == []
    with pytest.raises(AdapterError, match="is closed"):
        channel.check()


# -- filters --------------------------------------------------------------------------------------------------------------


class Options:
    """A socket that takes options; ``refuses`` is the one that it does not."""

    def __init__(self, refuses: int | None = None) -> None:
        self.refuses = refuses
        self.set: list[tuple[int, int, object]] = []

    def setsockopt(self, level: int, option: int, value) -> None:
        if option == self.refuses:
            raise OSError
        self.set.append((level, option, value))


def pairs(value: bytes) -> list[tuple[int, int]]:
    return list(struct.iter_unpack("=II", value))


EXTENDED, REMOTE = 0x8000_0000, 0x4000_0000
MASK = EXTENDED | REMOTE | 0x7FF


def passes(filters, can_id: int) -> int:
    """How many filters a frame passes, as linux/can.h says: <received_can_id> & mask == can_id & mask."""
    return sum(can_id & mask == wanted & mask for wanted, mask in filters)


def test_the_kernel_filters_data_frames_of_these_cob_ids_to_one_socket_and_all_others_to_the_other():
    here, there = Options(), Options()
    assert CyclicSocket(here, there).listen([0x181, 0x282])
    assert [call[:2] for call in (*here.set, *there.set)] == [(101, 1), (101, 1)]
    assert pairs(here.set[0][2]) == [(0x181, MASK), (0x282, MASK)]
    others = pairs(there.set[0][2])
    assert [can_id for can_id in range(0x800) if passes(others, can_id) != 1] == [0x181, 0x282]
    for can_id in (0x181 | REMOTE, 0x181 | EXTENDED, 0x1234_5678 | EXTENDED, 0x181 | EXTENDED | REMOTE):
        assert passes(others, can_id) == 1
        assert passes(pairs(here.set[0][2]), can_id) == 0


@given(st.sets(st.integers(0, 0x7FF), max_size=60))
def test_every_frame_passes_exactly_one_of_the_two_filters(can_ids):
    others = all_but(can_ids)
    counts = {can_id: passes(others, can_id) for can_id in range(0x800)}
    assert {can_id for can_id, count in counts.items() if count != 1} == can_ids
    assert max(counts.values()) <= 1


def test_the_tpdos_of_many_drives_are_few_filters():
    tpdos = [base + node for base in (0x180, 0x280, 0x380) for node in range(1, 65)]
    assert len(all_but(tpdos)) < 60


def test_without_subscriptions_the_other_socket_receives_every_frame():
    here, there = Options(), Options()
    assert CyclicSocket(here, there).listen([])
    assert here.set[0][2] == b""
    others = pairs(there.set[0][2])
    assert all(passes(others, can_id) for can_id in (0, 0x181, 0x7FF, 0x181 | REMOTE, 0x181 | EXTENDED))


def test_an_unable_kernel_and_too_many_cob_ids_are_reported():
    assert not CyclicSocket(Options(refuses=1), Options()).listen([0x181])
    assert not CyclicSocket(Options(), Options(refuses=1)).listen([0x181])
    assert CyclicSocket(Options(), Options()).listen(range(0x100, 0x100 + 512))
    assert not CyclicSocket(Options(), Options()).listen(range(0x100, 0x100 + 513))
    assert not CyclicSocket(Options(), Options()).listen(range(0, 0x800, 3))


def test_an_adapter_without_a_can_socket_has_none(line):
    assert cyclic_socket(FakeBus(), "can0") is None
    assert cyclic_socket(SimpleNamespace(socket=line.far), "can0") is None
