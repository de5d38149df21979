"""Bus-off and back again: nothing is given to the driver meanwhile, one error for each command, every node unknown afterwards.

Frames are typed off Linux's include/uapi/linux/can/error.h: class in the identifier, byte 1 the controller's status, bytes 6 and 7
its transmit and receive error counters.
"""

from __future__ import annotations

import threading
import time

import can
import pytest

from axisbus.bus.cycle import CanCycle
from axisbus.bus.link import controller as errorframe
from axisbus.bus.link.channel import Channel
from axisbus.bus.link.controller import CanController, CanErrorState
from axisbus.bus.node.events import NodeEventKind, NodeEvents
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.sync_and_time import SyncConsumer
from axisbus.cia301.nmt import NmtState
from axisbus.errors import AdapterError, BusOff
from kit.bus.fake_bus import FakeBus, Slave, eventually

CRTL, BUSOFF, RESTARTED, CNT = 0x04, 0x40, 0x100, 0x200
ZEROS = "00 00 00 00 00 00 00 00"


@pytest.fixture
def can0(fake: FakeBus):
    with Channel(fake, "socketcan:can0") as channel:
        yield channel


def go_off(fake: FakeBus, channel: Channel) -> None:
    fake.inject_error_frame(BUSOFF)
    eventually(lambda: channel.off)


def restart(fake: FakeBus, channel: Channel) -> None:
    fake.inject_error_frame(RESTARTED)
    eventually(lambda: channel.off is None)


# -- contents of error frames -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("error_class", "data", "words", "condition"),
    [
        (0x04, "00 08 00 00 00 00 60 00", "transmit errors (warning) (transmit errors 96, receive errors 0)", "error warning"),
        (0x204, "00 20 00 00 00 00 80 07", "transmit errors (passive) (transmit errors 128, receive errors 7)", "error passive"),
        (0x204, "00 18 00 00 00 00 60 80", "transmit errors (warning), receive errors (passive) "
         "(transmit errors 96, receive errors 128)", "error passive"),
        (0x204, "00 40 00 00 00 00 5F 00", "back to error active (transmit errors 95, receive errors 0)", "error active"),
        (0x240, "00 00 00 00 00 00 F8 00", "bus-off (transmit errors 248, receive errors 0)", "bus-off"),
        (0x40, ZEROS, "bus-off", "bus-off"),
        (0x100, ZEROS, "controller restarted", "error active"),
        (0x200, ZEROS, "error frame (transmit errors 0, receive errors 0)", None),
        (0x20, "00 00 00 00 00 00 80 00", "no acknowledge: no other node receives at this bitrate", None),
        (0x04, "00 01 00 00 00 00 00 00", "receive buffer overflow", None),
        (0x01, ZEROS, "transmit time-out", None),
        (0x04, "", "error frame", None),
    ],
)  # fmt: skip
def test_an_error_frame_in_words(error_class: int, data: str, words: str, condition: str | None) -> None:
    raw = bytes.fromhex(data)
    assert errorframe.describe(error_class, raw) == words
    found = errorframe.condition(error_class, raw)
    assert (None if found is None else found.value) == condition


def test_a_controller_reports_each_change_once_and_leaves_bus_off_by_a_restart() -> None:
    controller = CanController("socketcan:can0")
    passive = bytes.fromhex("00 20 00 00 00 00 80 00")
    told = [
        controller.error_frame(CRTL, passive, 1.0),
        controller.error_frame(CRTL, passive, 2.0),
        controller.error_frame(BUSOFF, bytes(8), 3.0),
        controller.error_frame(0x08, bytes(8), 3.1),  # bus errors that trail behind are no restart
        controller.state(False, 3.2),  # SocketCAN's own state is always "active": it says nothing
        controller.error_frame(RESTARTED, bytes(8), 4.0),
    ]
    assert [str(event) if event else "" for event in told] == [
        "the CAN controller of socketcan:can0 is error passive (transmit errors 128, receive errors 0)",
        "",
        "the CAN controller of socketcan:can0 is bus-off (transmit errors 128, receive errors 0)",
        "",
        "",
        "the CAN controller of socketcan:can0 has been restarted and takes part in the bus again: check every node again",
    ]
    assert [event.stamp for event in controller.events] == [1.0, 3.0, 4.0]


def test_a_restart_without_a_received_bus_off_counts_as_a_bus_off(can0: Channel, fake: FakeBus) -> None:
    fake.inject_error_frame(RESTARTED)
    eventually(lambda: can0.bus_off_count == 1)
    eventually(lambda: can0.off is None)
    assert can0.last_bus_off is not None


def test_a_driver_that_reports_no_restart_reports_the_new_condition(can0: Channel, fake: FakeBus) -> None:
    go_off(fake, can0)
    fake.inject_error_frame(CRTL, "00 40 00 00 00 00 00 00")
    eventually(lambda: can0.off is None)
    assert can0.controller.events[-1].restarted


# -- the channel --------------------------------------------------------------------------------------------------------------


def test_while_bus_off_nothing_is_given_to_the_driver_and_the_remedy_is_reported(
    can0: Channel, fake: FakeBus
) -> None:
    fake.inject_error_frame(0x204, "00 20 00 00 00 00 F8 00")
    go_off(fake, can0)
    with pytest.raises(BusOff) as caught:
        can0.send(0x201, b"\x0f\x00", patience=5.0)
    with pytest.raises(BusOff):
        can0.check()
    assert fake.sent == []
    assert can0.counters.sent == 0
    assert can0.failure is None
    assert (
        caught.value.message
        == "the CAN controller of socketcan:can0 went bus-off: it no longer takes part in the bus"
    )
    assert "transmit errors 248, receive errors 0" in caught.value.observed
    assert "sudo ip link set can0 type can restart" in caught.value.remedy
    assert "terminations" in caught.value.remedy
    assert "the CAN controller is bus-off" in can0.health()


def test_after_a_restart_the_channel_sends_again_and_nothing_of_before(can0: Channel, fake: FakeBus) -> None:
    go_off(fake, can0)
    with pytest.raises(BusOff):
        can0.send(0x201, b"\x1f\x00")
    restart(fake, can0)
    can0.send(0x202, b"\x06\x00")
    assert fake.sent == [(0x202, b"\x06\x00")]
    assert (can0.bus_off_count, can0.controller.condition) == (1, CanErrorState.ACTIVE)


def test_a_send_that_waits_for_a_full_queue_ends_with_the_bus_off_and_is_not_tried_again(
    can0: Channel, fake: FakeBus
) -> None:
    fake.full = True
    caught: list[Exception] = []

    def send() -> None:
        try:
            can0.send(0x201, b"\x0f\x00", patience=30.0)
        except AdapterError as error:
            caught.append(error)

    thread = threading.Thread(target=send)
    thread.start()
    eventually(lambda: can0.counters.full > 2)
    go_off(fake, can0)
    thread.join(5.0)
    fake.full = False
    assert [type(error) for error in caught] == [BusOff]
    assert fake.sent == []


def test_a_running_sdo_transfer_ends_at_once(fake: FakeBus, can0: Channel) -> None:
    slave = Slave(5)
    slave.ignore = 99
    fake.peers.append(slave)
    with CanopenNode(can0, 5, sdo_timeout=60.0, sdo_tries=1) as node:
        caught: list[Exception] = []

        def read() -> None:
            try:
                node.sdo.upload(0x1000)
            except AdapterError as error:
                caught.append(error)

        thread = threading.Thread(target=read)
        thread.start()
        eventually(lambda: fake.sent)
        go_off(fake, can0)
        thread.join(10.0)
        assert [type(error) for error in caught] == [BusOff]


def test_a_driver_that_reports_bus_off_only_by_its_state_is_polled_for_it(fake: FakeBus) -> None:
    with Channel(fake, "ixxat:0") as channel:
        fake.says = can.BusState.ERROR
        eventually(lambda: channel.off)
        with pytest.raises(BusOff) as caught:
            channel.send(0x80, b"")
        assert "open it again" in caught.value.remedy
        assert "ip link" not in caught.value.remedy
        fake.says = can.BusState.ACTIVE
        eventually(lambda: channel.off is None)
        channel.send(0x80, b"")
    assert fake.sent == [(0x80, b"")]


def test_a_driver_that_cannot_report_its_state_still_receives(fake: FakeBus) -> None:
    fake.says = NotImplementedError("state")
    with Channel(fake, "other:0") as channel:
        got: list[bytes] = []
        channel.subscribe(0x181, lambda data, _: got.append(data))
        eventually(lambda: channel.counters.errors)
        fake.inject(0x181, "37 06")
        eventually(lambda: got)
        channel.check()


def test_a_driver_that_raises_at_bus_off_has_failed_with_the_reason(fake: FakeBus) -> None:
    """PCAN's read fails with the words of its status; only opening it again resets it."""
    with Channel(fake, "pcan:PCAN_USBBUS1") as channel:
        fake.fail_receiving(can.CanOperationError("The CAN controller is in bus-off state. [Error Code 16]"))
        eventually(lambda: channel.failure)
        with pytest.raises(AdapterError, match="its controller went bus-off") as caught:
            channel.check()
        assert "terminations" in caught.value.remedy
        assert "open the machine again" in caught.value.remedy


# -- nodes and cycle ----------------------------------------------------------------------------------------------------------


def test_a_node_is_unknown_after_a_bus_off_until_it_reports_again(can0: Channel, fake: FakeBus) -> None:
    with CanopenNode(can0, 5) as node:
        fake.inject(0x705, "05")
        eventually(lambda: node.nmt.state is NmtState.OPERATIONAL)
        events = NodeEvents(node.nmt)
        go_off(fake, can0)
        events.look(time.monotonic())
        restart(fake, can0)
        assert not node.nmt.operational(time.monotonic())
        assert node.nmt.state is NmtState.UNKNOWN
        fake.inject(0x705, "05")
        eventually(lambda: node.nmt.operational(time.monotonic()))
        events.look(time.monotonic())
    assert [event.kind for event in events.history] == [NodeEventKind.UNKNOWN, NodeEventKind.OPERATIONAL]


def test_a_state_that_was_only_assumed_is_not_assumed_any_more(can0: Channel, fake: FakeBus) -> None:
    with CanopenNode(can0, 5) as node:
        node.nmt.assume(NmtState.OPERATIONAL)
        go_off(fake, can0)
        restart(fake, can0)
        assert not node.nmt.operational(time.monotonic())


def test_if_another_device_sends_sync_a_bus_off_ends_the_scan(can0: Channel, fake: FakeBus) -> None:
    consumer = SyncConsumer(can0, 0x80, 60.0)
    fake.inject(0x80, b"")
    cycle = CanCycle(can0, [], sync_cob_id=None, sync_consumer=consumer)
    cycle.wait_until(0.0)
    go_off(fake, can0)
    with pytest.raises(BusOff):
        cycle.wait_until(0.0)
    consumer.close()


def test_the_cycle_continues_without_a_frame_and_begins_again_with_heartbeat_and_sync(
    can0: Channel, fake: FakeBus
) -> None:
    cycle = CanCycle(can0, [], master_id=127, heartbeat=0.001)

    def once() -> None:
        cycle.wait_until(cycle.now() + 0.002)
        cycle.commit()
        cycle.sync()
        cycle.heartbeat()

    once()
    assert fake.sent == [(0x80, b""), (0x77F, b"\x05")]
    go_off(fake, can0)
    for _ in range(3):
        once()
    assert len(fake.sent) == 2
    restart(fake, can0)
    once()
    assert fake.sent[2:] == [(0x80, b""), (0x77F, b"\x05")]
