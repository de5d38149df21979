"""The channel: a failure of its adapter is reported at once, and by every later call."""

from __future__ import annotations

import socket
import sys
import threading
import time

import can
import pytest

from axisbus.bus.link.channel import Channel
from axisbus.cia301.frame import CanFrame
from axisbus.errors import AdapterError, BusError
from kit.bus.fake_bus import FakeBus, eventually


def test_a_frame_has_its_monotonic_reception_time(channel: Channel, fake: FakeBus) -> None:
    got: list[tuple[bytes, float]] = []
    channel.subscribe(0x181, lambda data, stamp: got.append((data, stamp)))
    before = time.monotonic()
    fake.inject(0x181, "37 06")
    eventually(lambda: got)
    assert got[0][0] == b"\x37\x06"
    assert before <= got[0][1] <= time.monotonic()
    assert channel.counters.received == 1


def test_an_ended_subscription_gets_nothing_more(channel: Channel, fake: FakeBus) -> None:
    got: list[bytes] = []
    other: list[bytes] = []

    def receiver(data: bytes, _: float) -> None:
        got.append(data)

    channel.subscribe(0x181, receiver)
    channel.subscribe(0x181, lambda data, _: other.append(data))
    channel.unsubscribe(0x181, receiver)
    fake.inject(0x181, "01")
    eventually(lambda: other)
    assert got == []


def test_after_recv_has_raised_every_later_call_raises(channel: Channel, fake: FakeBus) -> None:
    """python-can's notifier thread would end and the master go on driving deaf."""
    told: list[BusError] = []
    channel.on_failure.append(told.append)
    fake.fail_receiving(can.CanOperationError("Failed to receive: Network is down", 100))
    eventually(lambda: channel.failure)
    with pytest.raises(AdapterError, match="stopped receiving") as caught:
        channel.send(0x201, b"\x0f\x00")
    assert "Network is down" in caught.value.observed
    with pytest.raises(AdapterError):
        channel.check()
    assert told == [channel.failure]
    assert fake.sent == []


def test_a_receiver_that_raises_is_not_only_a_line_in_a_log(channel: Channel, fake: FakeBus) -> None:
    good: list[bytes] = []

    def broken(data: bytes, _: float) -> None:
        raise ValueError("two bytes expected")

    channel.subscribe(0x181, broken)
    channel.subscribe(0x181, lambda data, _: good.append(data))
    fake.inject(0x181, "00")
    eventually(lambda: good)
    with pytest.raises(BusError, match="receiver of frame 181h") as caught:
        channel.check()
    assert caught.value.__cause__ is channel.failure
    assert isinstance(channel.failure.__cause__, ValueError)
    assert channel.failure.__cause__.__traceback__ is not None
    fake.inject(0x181, "01")
    eventually(lambda: len(good) == 2)  # the others are still served


def test_a_full_queue_is_waited_for(channel: Channel, fake: FakeBus) -> None:
    """A SocketCAN queue holds 10 frames and refuses the eleventh with ENOBUFS."""
    fake.refuse.extend(
        can.CanOperationError("Failed to transmit: No buffer space available", 105) for _ in range(3)
    )
    channel.send(0x201, b"\x06\x00", patience=5.0)
    assert fake.sent == [(0x201, b"\x06\x00")]
    assert channel.counters.full == 3


def test_a_queue_that_stays_full_is_an_error_with_its_remedy(fake: FakeBus) -> None:
    fake.full = True
    with Channel(fake, "socketcan:can0") as channel:
        with pytest.raises(AdapterError, match="refused frame 201h") as caught:
            channel.send(0x201, b"\x06\x00")
        assert "txqueuelen" in caught.value.remedy
        assert channel.failure is None  # it may be over in a moment
        fake.full = False
        channel.send(0x201, b"\x06\x00")


def test_a_link_that_goes_down_while_sending_is_final(fake: FakeBus) -> None:
    fake.refuse.append(can.CanOperationError("Failed to transmit: Network is down", 100))
    with Channel(fake, "socketcan:can0") as channel:
        with pytest.raises(AdapterError, match="failed while sending"):
            channel.send(0x201, b"")
        with pytest.raises(AdapterError, match="failed while sending"):
            channel.check()


def test_bus_off_is_noticed_and_error_frames_are_reported_in_words(fake: FakeBus) -> None:
    with Channel(fake, "socketcan:can0") as channel:
        fake.inject_error_frame(0x20)
        eventually(lambda: channel.counters.error_frames == 1)
        assert "no acknowledge" in channel.health()
        assert channel.failure is None
        fake.inject_error_frame(0x40)
        eventually(lambda: channel.off)
        with pytest.raises(AdapterError, match="bus-off") as caught:
            channel.send(0x80, b"")
        assert "terminations" in caught.value.remedy


def test_error_frames_of_other_adapters_are_only_counted(fake: FakeBus) -> None:
    """Their identifier is not Linux's error class: 40h there does not mean bus-off."""
    with Channel(fake, "kvaser:0") as channel:
        fake.inject_error_frame(0x40)
        eventually(lambda: channel.counters.error_frames == 1)
        channel.check()


def test_stop_frames_are_sent_in_a_failed_channel(channel: Channel, fake: FakeBus) -> None:
    fake.fail_receiving(OSError("unplugged"))
    eventually(lambda: channel.failure)
    assert channel.send_urgent([(0x201, b"\x02\x00"), (0x80, b"")]) == 2
    assert fake.sent == [(0x201, b"\x02\x00"), (0x80, b"")]


def test_one_stop_frame_that_fails_does_not_keep_back_the_others(channel: Channel, fake: FakeBus) -> None:
    def refuse_first(can_id: int, data: bytes, remote: bool) -> list[tuple[int, bytes]]:
        if can_id == 0x201:
            raise RuntimeError("driver trouble")
        return []

    fake.peers.append(refuse_first)
    assert channel.send_urgent([(0x201, b"\x02\x00"), (0x202, b"\x02\x00")]) == 1
    assert fake.frames(0x202) == [b"\x02\x00"]


def test_stop_frames_pass_a_thread_that_is_stuck_in_send(channel: Channel, fake: FakeBus) -> None:
    fake.stuck = threading.Event()
    thread = threading.Thread(target=channel.send, args=(0x123, b""), name="stuck sender")
    thread.start()
    eventually(lambda: channel._send_lock.locked())
    assert channel.send_urgent([(0x201, b"\x02\x00")]) == 1
    fake.stuck.set()
    thread.join()


def test_closing_is_quick_and_may_be_repeated(fake: FakeBus) -> None:
    channel = Channel(fake, "fake:0")
    begin = time.monotonic()
    channel.close()
    channel.close()
    assert time.monotonic() - begin < 0.9  # canopen's disconnect takes up to its notifier's second
    assert not fake.is_open
    with pytest.raises(AdapterError, match="closed"):
        channel.send(0x201, b"")


def test_canopen_features_work_on_the_channel(channel: Channel, fake: FakeBus) -> None:
    """LSS, TIME and the like come from canopen: its network sends and receives through the channel."""
    channel.network.lss.send_switch_state_global(1)
    assert fake.sent == [(0x7E5, bytes([4, 1, 0, 0, 0, 0, 0, 0]))]
    got: list[bytes] = []
    channel.network.subscribe(0x7E4, lambda _id, data, _stamp: got.append(bytes(data)))
    fake.inject(0x7E4, "11 00")
    eventually(lambda: got)
    assert got == [b"\x11\x00"]


def test_two_virtual_channels_receive_the_frames_of_each_other() -> None:
    with Channel.open("virtual", "axisbus-test") as one, Channel.open("virtual", "axisbus-test") as two:
        got: list[bytes] = []
        two.subscribe(0x80, lambda data, _: got.append(data))
        one.send(0x80, b"")
        eventually(lambda: got)
        assert got == [b""]


def test_a_frame_listener_gets_every_frame_with_remote_ones_until_the_block_ends(
    channel: Channel, fake: FakeBus
) -> None:
    heard: list[tuple[int, bytes, bool]] = []
    with channel.frames_to(lambda frame: heard.append((frame.can_id, frame.data, frame.remote))):
        fake.inject(0x77F, "05")
        fake.inbox.put(can.Message(arbitration_id=0x701, is_remote_frame=True, is_extended_id=False))
        eventually(lambda: len(heard) == 2)
    fake.inject(0x080, "")
    eventually(lambda: channel.counters.received == 2)
    assert heard == [(0x77F, b"\x05", False), (0x701, b"", True)]


def test_a_tap_gets_every_frame_in_both_directions_until_it_is_removed(
    channel: Channel, fake: FakeBus
) -> None:
    heard: list[tuple[int, bytes, bool]] = []

    def ear(frame: CanFrame) -> None:
        heard.append((frame.can_id, frame.data, frame.remote))

    channel.tap(ear)
    fake.inject(0x77F, "05")
    eventually(lambda: len(heard) == 1)
    channel.send(0x201, b"\x0f\x00")
    channel.send_remote(0x701, 1)
    channel.send_urgent([(0x202, b"\x02\x00")])
    assert heard == [
        (0x77F, b"\x05", False), (0x201, b"\x0f\x00", False), (0x701, b"", True), (0x202, b"\x02\x00", False),
    ]  # fmt: skip
    channel.untap(ear)
    channel.untap(ear)
    channel.send(0x201, b"")
    assert len(heard) == 4


def test_frames_and_octets_are_counted_in_both_directions(channel: Channel, fake: FakeBus) -> None:
    began = channel.carried
    fake.inject(0x77F, "05")
    channel.send(0x201, b"\x0f\x00")
    channel.send_remote(0x701, 1)
    channel.send_urgent([(0x202, b"\x02\x00\x00")])
    eventually(lambda: channel.carried.frames == 4)
    now = channel.carried
    assert (now.frames - began.frames, now.octets - began.octets) == (4, 6)
    assert now.time > began.time


class SocketcanBus(FakeBus):
    """As python-can's SocketCAN: frames go straight into its socket."""

    def __init__(self, end: socket.socket) -> None:
        super().__init__()
        self.socket = end


def test_on_socketcan_a_frame_is_sent_without_a_lock_and_counted() -> None:
    near, far = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with near, far, Channel(SocketcanBus(near), "socketcan:can0") as channel:
        channel._send_lock.acquire()  # by another thread, which is stuck
        channel.send(0x201, b"\x0f\x00\x01")
        channel._send_lock.release()
        far.settimeout(1.0)
        assert far.recv(64)[:4] == (0x201).to_bytes(4, sys.byteorder)
        assert (channel.counters.sent, channel.counters.octets) == (1, 3)


def test_a_frame_listener_that_raises_fails_the_channel(channel: Channel, fake: FakeBus) -> None:
    def ear(_: object) -> None:
        raise ValueError("broken")

    with channel.frames_to(ear):
        fake.inject(0x701, "05")
        eventually(lambda: channel.failure is not None)
    with pytest.raises(BusError, match="701h"):
        channel.check()
