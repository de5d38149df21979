"""Emergency messages: short ones are read, none is lost between two looks, and nothing grows without bound."""

from __future__ import annotations

import time

from axisbus.bus.link.channel import Channel
from axisbus.bus.node.node import EmcyMonitor
from axisbus.cia301.dropped_frames import DropReason
from axisbus.cia301.incident import IncidentState
from kit.bus.fake_bus import FakeBus, eventually


def test_a_message_of_three_bytes_is_read(channel: Channel, fake: FakeBus) -> None:
    """canopen needs exactly eight and loses the message."""
    monitor = EmcyMonitor(channel, 5)
    feed = monitor.feed()
    fake.inject(0x085, "11 86 20")
    eventually(lambda: monitor.history)
    (emcy,) = feed.take()
    assert (emcy.code, emcy.register, emcy.data) == (0x8611, 0x20, bytes(5))
    assert feed.take() == ()
    assert channel.failure is None


def test_a_message_without_an_error_code_is_only_counted(channel: Channel, fake: FakeBus) -> None:
    monitor = EmcyMonitor(channel, 5)
    began = time.monotonic()
    fake.inject(0x085, "")
    fake.inject(0x085, "11")
    fake.inject(0x085, "10 32 04 01 02 03 04 05")
    eventually(lambda: monitor.history)
    assert monitor.malformed == 2
    (dropped,) = channel.drops.found
    assert (dropped.fault, dropped.node, dropped.count) == (DropReason.EMCY, 5, 2)
    assert (dropped.can_id, dropped.data) == (0x085, b"\x11")
    assert began <= dropped.last <= monitor.history[0].stamp <= time.monotonic()
    assert monitor.history[0].code == 0x3210
    assert monitor.history[0].data == b"\x01\x02\x03\x04\x05"


def test_each_axis_of_a_node_gets_every_message(channel: Channel, fake: FakeBus) -> None:
    monitor = EmcyMonitor(channel, 5)
    one, two = monitor.feed(), monitor.feed()
    fake.inject(0x085, "11 86 20")
    fake.inject(0x085, "00 00 00")
    eventually(lambda: len(monitor.history) == 2)
    assert [emcy.code for emcy in one.take()] == [0x8611, 0]
    assert [emcy.code for emcy in two.take()] == [0x8611, 0]


def test_the_emergency_history_of_a_drive_that_sends_hundreds_is_bounded(
    channel: Channel, fake: FakeBus
) -> None:
    monitor = EmcyMonitor(channel, 5)
    feed = monitor.feed()
    for number in range(300):
        fake.inject(0x085, number.to_bytes(2, "little"))
    eventually(lambda: monitor.history and monitor.history[-1].code == 299)
    waiting = feed.take()
    assert len(waiting) == 64
    assert waiting[-1].code == 299
    assert feed.lost == 300 - 64
    assert len(monitor.history) == 64


def test_messages_are_grouped_and_a_boot_up_ends_the_open_incident(channel: Channel, fake: FakeBus) -> None:
    monitor = EmcyMonitor(channel, 5)
    fake.inject(0x085, "10 23 03")
    fake.inject(0x085, "20 32 07")
    fake.inject(0x705, "05")  # a heartbeat says nothing
    eventually(lambda: len(monitor.history) == 2)
    (incident,) = monitor.incidents
    assert incident.codes == (0x2310, 0x3220)
    assert incident.outcome is IncidentState.UNRESOLVED
    booted = time.monotonic()
    fake.inject(0x705, "00")
    eventually(lambda: not monitor.incidents.open)
    (incident,) = monitor.incidents
    assert incident.rebooted
    assert incident.ended is not None
    assert booted <= incident.ended <= time.monotonic()


def test_a_closed_monitor_receives_nothing(channel: Channel, fake: FakeBus) -> None:
    monitor = EmcyMonitor(channel, 5, 0x0F5)
    monitor.close()
    assert channel._receivers == {}
    monitor.close()


def test_a_node_with_another_identifier_in_1014h_is_received_there(channel: Channel, fake: FakeBus) -> None:
    monitor = EmcyMonitor(channel, 5)
    monitor.listen_to(0x0F5)
    fake.inject(0x085, "10 23 03")
    fake.inject(0x0F5, "20 32 07")
    eventually(lambda: monitor.history)
    assert [emcy.code for emcy in monitor.history] == [0x3220]
    monitor.close()
    assert channel._receivers == {}
