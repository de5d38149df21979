"""How long a channel retries, by a test clock, and its reports."""

from __future__ import annotations

import errno
from collections.abc import Iterator

import can
import pytest

from axisbus.bus.link import failures
from axisbus.bus.link.channel import Channel
from axisbus.bus.link.controller import CanErrorState, ErrorCounters
from axisbus.errors import AdapterError, BusOff, TransmitQueueFull
from kit.bus.fake_bus import FakeBus, eventually
from kit.manual_clock import HandClock


@pytest.fixture
def clock() -> HandClock:
    return HandClock(100.0)


@pytest.fixture
def open_channel(fake: FakeBus, clock: HandClock) -> Iterator[Channel]:
    with Channel(fake, "fake", clock=clock) as made:
        yield made


@pytest.mark.parametrize(
    ("patience", "least", "most"), [(None, 0.005, 0.0053), (0.5, 0.5, 0.5003), (0.0, 0.0, 0.0)]
)
def test_a_full_queue_is_tried_until_the_patience_is_over(
    open_channel: Channel, fake: FakeBus, clock: HandClock, patience, least, most
) -> None:
    fake.full = True
    began = clock.time
    with pytest.raises(AdapterError, match="refused frame 201h"):
        open_channel.send(0x201, b"", **({} if patience is None else {"patience": patience}))
    assert least <= clock.time - began <= most
    assert open_channel.counters.full == round((clock.time - began) / 0.0002) + 1
    assert open_channel.counters.sent == 0
    fake.full = False
    open_channel.send(0x201, b"")
    assert (open_channel.counters.sent, open_channel.counters.full) == (
        1,
        round((clock.time - began) / 0.0002) + 1,
    )


def test_a_remote_frame_waits_as_long(open_channel: Channel, fake: FakeBus, clock: HandClock) -> None:
    fake.full = True
    began = clock.time
    with pytest.raises(AdapterError):
        open_channel.send_remote(0x705)
    assert 0.005 <= clock.time - began <= 0.0053


def test_each_stop_frame_is_tried_and_all_together_take_a_tenth_of_a_second(
    open_channel: Channel, fake: FakeBus, clock: HandClock
) -> None:
    fake.full = True
    began = clock.time
    assert open_channel.send_urgent([(0x200 + number, b"") for number in range(50)]) == 0
    assert 0.1 <= clock.time - began <= 0.101
    assert "stop frame 231h" in open_channel.counters.errors[-1]
    fake.full = False
    assert open_channel.send_urgent([(0x201, b"a"), (0x202, b"b")]) == 2
    assert fake.sent[-2:] == [(0x201, b"a"), (0x202, b"b")]
    assert open_channel.counters.sent == 2
    fake.refuse.append(can.CanOperationError("once"))
    assert open_channel.send_urgent([(0x203, b"")]) == 1


def test_stop_frames_wait_for_a_full_queue_together_and_in_their_order(
    open_channel: Channel, fake: FakeBus, clock: HandClock
) -> None:
    frames = [(0x201, b"a"), (0x202, b"b"), (0x80, b""), (0x601, b"c")]
    began, send, tries = clock.time, fake.send, []

    def full_for_a_while(msg: can.Message, timeout: float | None = None) -> None:
        tries.append(msg)
        fake.full = len(tries) < 150  # room comes in between two tries
        send(msg, timeout)

    fake.send = full_for_a_while
    assert open_channel.send_urgent(frames) == 4
    assert fake.sent == frames
    assert clock.time - began == pytest.approx(0.03, abs=0.001)


@pytest.mark.parametrize(
    ("error", "full"),
    [
        (can.CanOperationError("Failed to transmit: No buffer space available", errno.ENOBUFS), True),
        (can.CanOperationError("Transmit buffer full"), True),
        (can.CanOperationError("The transmit queue is full", 0x80), True),
        (can.CanOperationError("Function canWriteWait failed - Transmit buffer overflow", -13), True),
        (can.CanTimeoutError("timed out"), True),
        (BlockingIOError(), True),
        (type("SerialTimeoutException", (OSError,), {})("Write timeout"), True),
        (can.CanOperationError("the channel is closed"), False),
        (OSError(errno.EIO, "device gone"), False),
    ],
)
def test_driver_errors_that_mean_a_full_queue(error: Exception, full: bool) -> None:
    assert failures.is_full(error) is full


def test_a_serial_adapter_that_takes_nothing_for_a_while_has_not_failed(
    open_channel: Channel, fake: FakeBus, clock: HandClock
) -> None:
    slow = type("SerialTimeoutException", (OSError,), {})
    fake.refuse.extend([slow("Write timeout"), slow("Write timeout")])
    open_channel.send(0x201, b"a")
    assert fake.sent == [(0x201, b"a")]
    fake.refuse.extend([slow("Write timeout")] * 100)
    with pytest.raises(TransmitQueueFull, match="its transmit queue is full"):
        open_channel.send(0x201, b"b")
    fake.refuse.clear()
    open_channel.check()
    fake.refuse.append(OSError(errno.EIO, "device gone"))
    with pytest.raises(AdapterError, match="failed while sending"):
        open_channel.send(0x201, b"c")


def test_stop_frames_are_sent_in_any_state_of_the_channel(open_channel: Channel, fake: FakeBus) -> None:
    open_channel.fail(AdapterError("broken"))
    with pytest.raises(AdapterError, match="broken"):
        open_channel.send(0x201, b"")
    assert open_channel.send_urgent([(0x201, b"")]) == 1
    open_channel.disown()
    assert open_channel.send_urgent([(0x201, b"")]) == 0
    fake.shutdown()


@pytest.mark.parametrize(
    ("can_id", "extended"), [(0x000, False), (0x7FF, False), (0x800, True), (0x1FFFFFFF, True)]
)
def test_an_identifier_above_7ff_has_29_bits(
    open_channel: Channel, fake: FakeBus, can_id: int, extended: bool
) -> None:
    sent: list[can.Message] = []
    fake.send = lambda message, _timeout=None: sent.append(message)
    open_channel.send(can_id, b"\1\2")
    open_channel.send_remote(can_id, 5)
    open_channel.send_remote(can_id)
    data, remote, plain = sent
    assert (plain.is_remote_frame, plain.dlc) == (True, 0)
    assert (data.arbitration_id, data.is_extended_id, data.is_remote_frame, bytes(data.data)) == (
        can_id,
        extended,
        False,
        b"\1\2",
    )
    assert (remote.arbitration_id, remote.is_extended_id, remote.is_remote_frame, remote.dlc) == (
        can_id,
        extended,
        True,
        5,
    )


def test_the_health_of_the_channel_names_error_frames_and_controller_state(open_channel: Channel) -> None:
    assert open_channel.health() == ""
    open_channel.controller.condition = CanErrorState.PASSIVE
    assert open_channel.health() == "the CAN controller is error passive"
    open_channel.counters.error_frames = 3
    assert open_channel.health() == "3 error frames on fake, the CAN controller is error passive"
    open_channel.counters.errors.append("bus error")
    assert (
        open_channel.health()
        == "3 error frames on fake, the last: bus error, the CAN controller is error passive"
    )
    open_channel.controller.condition = CanErrorState.ACTIVE
    assert open_channel.health() == "3 error frames on fake, the last: bus error"


def test_a_bus_off_is_reported_once_and_ends_with_a_restart(open_channel: Channel, fake: FakeBus) -> None:
    told: list[Exception] = []

    def fails(error: Exception) -> None:
        raise RuntimeError("a listener's own mistake")

    open_channel.on_failure += [fails, told.append]
    for _ in range(2):
        open_channel._follow(open_channel.controller.error_frame(0x40, bytes(8), 1.0))
    assert [type(error) for error in told] == [BusOff]
    assert (
        open_channel.bus_off_count,
        open_channel.off is told[0],
        open_channel.last_bus_off is told[0],
    ) == (
        1,
        True,
        True,
    )
    assert "a listener's own mistake" in open_channel.counters.errors[-1]
    with pytest.raises(BusOff):
        open_channel.send(0x201, b"")
    open_channel._follow(open_channel.controller.error_frame(0x100, bytes(8), 2.0))
    assert (open_channel.off, open_channel.bus_off_count) == (None, 1)
    open_channel._follow(open_channel.controller.error_frame(0x100, bytes(8), 3.0))
    assert (open_channel.off, open_channel.bus_off_count, len(told)) == (None, 2, 2)  # it went unheard
    open_channel._follow(open_channel.controller.error_frame(0x04, bytes([0, 8, 0, 0, 0, 0, 97, 0]), 4.0))
    assert (open_channel.bus_off_count, open_channel.controller.counters) == (2, ErrorCounters(97, 0))


def test_a_driver_that_cannot_report_its_state_is_not_asked_again(fake: FakeBus, clock: HandClock) -> None:
    asked: list[float] = []

    class CountingBus(FakeBus):
        @property
        def state(self) -> can.BusState:
            asked.append(clock.time)
            if len(asked) > 2:
                raise NotImplementedError("no state")
            return can.BusState.ACTIVE

    with Channel(CountingBus(), "fake", clock=clock) as made:
        made._state_due = clock.time
        eventually(lambda: len(asked) == 1)
        assert made._state_due == pytest.approx(clock.time + 0.1)
        clock.time += 0.09
        made.bus.inject(0x999 & 0x7FF, b"")
        eventually(lambda: made.counters.received == 1)
        assert len(asked) == 1
        clock.time += 0.02
        eventually(lambda: len(asked) == 2)
        clock.time += 0.2
        eventually(lambda: len(asked) == 3)
        eventually(lambda: made.counters.errors)
        clock.time += 1000.0
        made.bus.inject(0x123, b"")
        eventually(lambda: made.counters.received == 2)
        assert len(asked) == 3
        assert "on asking for the state: no state" in made.counters.errors[-1]
        assert made.failure is None


def test_a_driver_is_not_asked_for_its_state_while_it_is_opened(fake: FakeBus) -> None:
    """It may raise anything then, and whether it does must not depend on how a process orders names."""

    class CountingBus(FakeBus):
        asked = False

        @property
        def state(self) -> can.BusState:
            self.asked = True
            raise NotImplementedError("no state")

    bus = CountingBus()
    with Channel(bus, "fake", clock=HandClock(-1.0)) as made:  # no time for the receive thread to ask
        assert not bus.asked
        assert made.failure is None


def test_an_error_of_the_driver_on_closing_is_stored(fake: FakeBus, clock: HandClock) -> None:
    made = Channel(fake, "fake", clock=clock)
    shutdown = fake.shutdown

    def fails() -> None:
        shutdown()
        raise OSError("gone already")

    fake.shutdown = fails
    made.close()
    assert made.counters.errors[-1] == "on closing: gone already"


def test_a_closed_channel_refuses_to_send_and_names_itself(fake: FakeBus, clock: HandClock) -> None:
    made = Channel(fake, "fake", clock=clock)
    made.check()
    made.close()
    made.close()
    with pytest.raises(AdapterError, match="the CAN channel fake is closed"):
        made.send(0x201, b"")
    assert not fake.is_open


class Held:
    """A lock that another thread keeps, for so long each time that one waits for it."""

    def __init__(self, clock: HandClock, slice_: float) -> None:
        self.clock, self.slice, self.asked = clock, slice_, []

    def acquire(self, blocking: bool = True, timeout: float = -1.0) -> bool:
        if not blocking:
            return False
        self.asked.append(timeout)
        self.clock.time += self.slice
        return False

    def release(self) -> None:
        raise AssertionError("it is not ours")


@pytest.mark.parametrize(
    ("slice_", "tries", "words"),
    [
        (0.02, 51, "has not accepted a frame"),  # a second in which both run: the send is stuck
        (0.04, 26, "has not accepted a frame"),
        (
            3.0,
            4,
            "hardly ran for 12 s",
        ),  # ten seconds in which this program hardly ran: only the program is to blame
        (9.0, 2, "hardly ran for 18 s"),
    ],
)
def test_a_send_that_another_thread_is_stuck_in_is_waited_for_while_both_run(
    open_channel: Channel, clock: HandClock, slice_, tries, words
) -> None:
    held = Held(clock, slice_)
    free, open_channel._send_lock = open_channel._send_lock, held
    with pytest.raises(AdapterError) as caught:
        open_channel.send(0x201, b"")
    open_channel._send_lock = free
    assert set(held.asked) == {0.02}
    assert abs(len(held.asked) - tries) <= 1
    assert words in str(caught.value)
    assert open_channel.failure is not None
