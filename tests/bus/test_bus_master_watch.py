"""Another master in operation, by its frames alone: one event at once and then one per second, and the commanded nodes."""

from __future__ import annotations

from typing import Any

import can
import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.node.events import NodeEventKind
from axisbus.bus.node.master_watch import STOP_PERIOD, Echoes, MasterWatch
from axisbus.cia301.master_detection import ExpectedMasters
from kit.bus.fake_bus import FakeBus, eventually

CAST = ExpectedMasters(frozenset({1, 5}), frozenset({127}), rpdos={0x1A5: 5}, produced=0x80)


class Subscriptions:
    """The part of a channel that the watch needs; frames are received at the times of the test."""

    def __init__(self) -> None:
        self.receivers: dict[int, Any] = {}

    def subscribe(self, can_id: int, receiver: Any) -> None:
        assert can_id not in self.receivers
        self.receivers[can_id] = receiver

    def unsubscribe(self, can_id: int, receiver: Any) -> None:
        assert self.receivers.pop(can_id) is receiver

    def hear(self, can_id: int, data: str, stamp: float) -> None:
        if can_id in self.receivers:
            self.receivers[can_id](bytes.fromhex(data), stamp)


@pytest.fixture
def bus() -> Subscriptions:
    return Subscriptions()


@pytest.fixture
def stopped() -> list[tuple[float, set[int]]]:
    return []


@pytest.fixture
def watch(bus: Subscriptions, stopped: list[Any]) -> MasterWatch:
    made = MasterWatch(bus, stops=True)  # type: ignore[arg-type]
    made.on_command = lambda error, nodes: stopped.append((str(error), set(nodes)))
    made.begin(CAST)
    return made


def test_a_flood_is_one_event_at_once_and_then_one_per_second_and_no_frame_of_it_is_lost(bus, watch):
    for tick in range(500):
        bus.hear(0x205, "0F 00", 10.0 + tick / 200)
    events = watch.events
    assert [event.times for event in events] == [1, 200, 200, 99]
    assert [event.node for event in events] == [5] * 4
    assert {event.kind for event in events} == {NodeEventKind.MASTER}
    assert str(events[1]) == (
        "another master, or a tool that acts as one, is on the bus: RPDOs to node 5 (205h): 200 frames in 1.0 s; "
        "the axes of node 5 are stopped"
    )


def test_the_nodes_of_another_master_are_stopped_at_once_and_again_as_long_as_it_continues(
    bus, watch, stopped
):
    for tick in range(100):
        bus.hear(0x205, "0F 00", 10.0 + tick / 200)
    assert 1 + int(0.49 / STOP_PERIOD) <= len(stopped) <= 2 + int(0.5 / STOP_PERIOD)
    assert all(nodes == {5} for _, nodes in stopped)
    assert "RPDOs to node 5 (205h)" in stopped[0][0]


@pytest.mark.parametrize(
    ("can_id", "data", "nodes"),
    [
        (0x201, "", {1}),
        (0x1A5, "00", {5}),  # an RPDO at a COB-ID of the cell's own
        (0x202, "0F 00", None),  # of no node of the cell
        (0x080, "", {1, 5}),
        (0x000, "80 00", {1, 5}),
        (0x000, "01 05", {5}),
        (0x000, "01 32", set()),
        (0x000, "01", set()),
        (0x000, "01 00 00", set()),
        (0x601, "2B 40 60 00 0F 00 00 00", {1}),
        (0x601, "21 7A 60 00 04 00 00 00", {1}),
        (0x601, "C2 00 14 01 04 00 00 00", {1}),
        (0x601, "C1 00 14 01 04 00 00 00", set()),  # the end of a block
        (0x601, "2B 00 20 00 0F 00 00 00", set()),  # the maker's own
        (0x601, "40 41 60 00 00 00 00 00", set()),
        (0x601, "A0 41 60 00 7F 00 00 00", set()),
        (0x601, "60 00 00 00 00 00 00 00", set()),
        (0x601, "80 40 60 00 00 00 00 00", set()),
        (0x601, "2B", set()),
        (0x632, "2B 40 60 00 0F 00 00 00", set()),
        (0x77F, "05", set()),
        (0x77F, "00", None),  # a boot-up message
        (0x7E5, "04 01", set()),
        (0x100, "00 00 00 00 00 00", None),  # we send no TIME
        (0x181, "00", None),
        (0x701, "05", None),
    ],
)
def test_the_nodes_that_each_frame_commands(bus, watch, stopped, can_id, data, nodes):
    bus.hear(can_id, data, 10.0)
    assert [set(found) for _, found in stopped] == ([nodes] if nodes else [])
    assert len(watch.events) == (0 if nodes is None else 1)


def test_a_write_after_many_reads_is_reported_at_once(bus, watch, stopped):
    for tick in range(5):
        bus.hear(0x601, "40 41 60 00 00 00 00 00", 10.0 + tick / 100)
    bus.hear(0x601, "2B 40 60 00 0F 00 00 00", 10.06)
    assert len(stopped) == 1
    assert "SDO requests that write to node 1 (601h): 1 frame; the axes of node 1 are stopped" in str(
        watch.events[-1]
    )


def test_time_is_a_sign_if_we_send_it_and_sync_commands_no_node_if_we_do_not(bus, stopped):
    watch = MasterWatch(bus, stops=True)
    watch.on_command = lambda _, nodes: stopped.append(nodes)
    watch.begin(ExpectedMasters(frozenset({1}), frozenset(), times=frozenset({0x100})))
    bus.hear(0x100, "00 00 00 00 00 00", 10.0)
    bus.hear(0x080, "", 10.1)
    assert ["TIME (100h)" in str(watch.events[0]), "SYNC (080h)" in str(watch.events[1])] == [True, True]
    assert stopped == []


def test_nodes_added_later_are_watched_too_and_closing_ends_all_subscriptions(bus, watch):
    watch.begin(ExpectedMasters(frozenset({1, 5, 9}), frozenset({127}), produced=0x80))
    bus.hear(0x209, "00", 10.0)
    assert [event.node for event in watch.events] == [9]
    watch.close()
    watch.close()
    assert bus.receivers == {}


@pytest.mark.parametrize("returns", [True, False])
def test_an_adapter_that_returns_our_own_frames_is_detected(
    channel: Channel, fake: FakeBus, returns: bool
) -> None:
    echoes = Echoes(channel)
    for tick in range(5):
        channel.send(0x601, bytes((0x40, tick, 0x10, 0, 0, 0, 0, 0)))
        fake.inject(0x601 if returns else 0x581, f"40 {tick:02X} 10 00 00 00 00 00")
    eventually(lambda: channel.counters.received == 5)
    echoes.end()
    assert echoes.detected is returns


def test_another_tool_that_reads_is_no_echo(channel: Channel, fake: FakeBus) -> None:
    echoes = Echoes(channel)
    for tick in range(8):
        channel.send(0x601, bytes((0x40, tick, 0x10, 0, 0, 0, 0, 0)))
    for _ in range(3):
        fake.inject(0x605, "40 41 60 00 00 00 00 00")
    eventually(lambda: channel.counters.received == 3)
    echoes.end()
    assert not echoes.detected


def test_our_own_frames_are_not_asked_of_an_adapter() -> None:
    with (
        Channel.open("virtual", "axisbus-own-frames", receive_own_messages=True) as channel,
        can.Bus(interface="virtual", channel="axisbus-own-frames") as other,
    ):
        channel.send(0x123, b"ours")
        other.send(can.Message(arbitration_id=0x123, data=b"other", is_extended_id=False))
        eventually(lambda: channel.counters.received > 0)
        assert channel.counters.received == 1
