"""SYNC of another producer as the clock of the scan, and TIME: the begin of a cycle, the end of the scan, and its last frames."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from datetime import UTC, datetime

import pytest

from axisbus.bus.cycle import CanCycle
from axisbus.bus.link.channel import Channel
from axisbus.bus.sync_and_time import SyncConsumer, TimeConsumer, TimeProducer
from axisbus.cia301.sync import SyncWatch, fits, measured_period
from axisbus.cia402.port import Outputs
from axisbus.core.scan import Scan
from axisbus.errors import SyncError
from kit.bus.fake_bus import FakeBus, Slave, eventually
from kit.bus.ports import port_of, slave_of
from kit.manual_clock import HandClock

PERIOD = 0.004


# -- the rules, without a bus


def test_each_sync_begins_a_cycle_and_the_next_is_due_one_and_a_half_periods_later() -> None:
    watch = SyncWatch(PERIOD)
    assert watch.deadline is None
    assert watch.take(1.0)
    assert watch.deadline == pytest.approx(1.006)
    assert watch.take(1.004)
    assert watch.deadline == pytest.approx(1.010)


def test_a_longer_patience_is_the_users() -> None:
    watch = SyncWatch(PERIOD, patience=0.02)
    watch.take(1.0)
    assert watch.deadline == pytest.approx(1.02)


def test_syncs_close_together_begin_one_cycle() -> None:
    """Frames that the computer delivers late arrive in a burst; a cycle for each would move the axes by as much."""
    watch = SyncWatch(PERIOD)
    begun = [watch.take(stamp) for stamp in (1.0, 1.0201, 1.0202, 1.0203, 1.024)]
    assert begun == [True, True, False, False, True]
    assert watch.skipped == 2


def test_syncs_received_while_we_were_busy_are_counted() -> None:
    watch = SyncWatch(PERIOD)
    watch.take(1.0)
    watch.take(1.012, heard=3)
    assert watch.skipped == 2


@pytest.mark.parametrize(
    ("every", "too_fast"),
    [(0.0021, True), (0.003, True), (0.0035, True), (0.0039, False), (0.004, False), (0.005, False)],
)
def test_a_sync_producer_that_is_faster_than_configured_is_detected(every: float, too_fast: bool) -> None:
    """Motion advances 4 ms with each cycle: with SYNC every 3 ms the axes would be a third too fast."""
    watch = SyncWatch(PERIOD)
    for number in range(200):
        watch.take(number * every)
        if watch.too_fast is not None:
            break
    assert (watch.too_fast is not None) is too_fast


def test_at_half_the_period_every_second_sync_is_left_out() -> None:
    watch = SyncWatch(PERIOD)
    begun = [watch.take(number * 0.00199) for number in range(8)]
    assert begun == [True, False] * 4


def test_the_period_is_measured_when_listening_begins() -> None:
    stamps = [1.0 + number * 0.005 + (0.0005 if number % 2 else 0.0) for number in range(9)]
    assert measured_period(stamps) == pytest.approx(0.005)
    assert not fits(0.005, PERIOD)
    assert fits(0.0042, PERIOD)


# -- on the bus


class Producer:
    """Another device that sends SYNC, in a thread of its own."""

    def __init__(self, fake: FakeBus, period: float, cob_id: int = 0x80) -> None:
        self._fake, self._period, self._cob_id = fake, period, cob_id
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="producer", daemon=True)
        self._thread.start()

    def _run(self) -> None:
        while not self._stop.wait(self._period):
            self._fake.inject(self._cob_id, b"")

    def stop(self) -> None:
        self._stop.set()
        self._thread.join()


@pytest.fixture
def producer(fake: FakeBus) -> Iterator[Producer]:
    producer = Producer(fake, 0.02)
    yield producer
    producer.stop()


def test_the_scan_begins_its_cycles_with_the_other_producers_sync(
    channel: Channel, fake: FakeBus, producer: Producer
) -> None:
    """Ten cycles take ten SYNCs, and we send none of our own."""
    consumer = SyncConsumer(channel, 0x80, 0.02, patience=5.0)
    cycle = CanCycle(channel, [], sync_cob_id=None, sync_consumer=consumer)
    scan = Scan(cycle, {}, {}, 0.02)
    begun = time.monotonic()
    for _ in range(11):
        scan.once()
    assert time.monotonic() - begun >= 10 * 0.02 - 0.015
    assert fake.frames(0x80) == []
    assert scan.lateness.cycles == 11


def test_a_sync_on_another_identifier_is_not_consumed(
    channel: Channel, fake: FakeBus, producer: Producer
) -> None:
    consumer = SyncConsumer(channel, 0x90, 0.02)
    with pytest.raises(SyncError, match="no steady SYNC on 090h"):
        consumer.await_steady(0.2)


def test_a_producer_with_another_period_is_refused_before_anything_moves(
    channel: Channel, fake: FakeBus, producer: Producer
) -> None:
    consumer = SyncConsumer(channel, 0x80, 0.004)
    with pytest.raises(SyncError, match=r"SYNC comes every .* ms, but scan_period is 4 ms") as raised:
        consumer.await_steady(1.0)
    assert "scan_period = " in raised.value.remedy


def heard(consumer: SyncConsumer, stamp: float) -> None:
    consumer._on_frame(b"", stamp)


def test_a_missing_sync_is_an_error_after_one_and_a_half_periods(channel: Channel) -> None:
    clock = channel.clock = HandClock(100.0)
    consumer = SyncConsumer(channel, 0x80, PERIOD)
    heard(consumer, 100.0)
    assert consumer.wait() == 100.0
    clock.time = 100.0061
    with pytest.raises(SyncError, match="SYNC of the other producer is missing") as raised:
        consumer.wait()
    assert "none on 080h for 6.1 ms, expected within 6 ms" in raised.value.observed


def test_our_own_lateness_does_not_count_as_a_missing_sync(channel: Channel) -> None:
    """Half a second in which the process did not run: the frames received meanwhile are still unread."""
    clock = channel.clock = HandClock(100.0)
    consumer = SyncConsumer(channel, 0x80, PERIOD)
    heard(consumer, 100.0)
    consumer.wait()
    clock.time = 100.5
    late = threading.Timer(0.0, heard, (consumer, 100.5))
    consumer._take = _before(consumer._take, late.start, late.join)  # type: ignore[method-assign]
    assert consumer.wait() == 100.5


def _before(take, *works):  # type: ignore[no-untyped-def]
    """The first look finds nothing; the frame is handed over behind it."""
    looks = []

    def looking(*args, **kwargs):  # type: ignore[no-untyped-def]
        looks.append(1)
        found = take(*args, **kwargs)
        if len(looks) == 1:
            for work in works:
                work()
        return found

    return looking


def test_silence_after_our_own_lateness_still_counts_as_a_missing_sync(channel: Channel) -> None:
    clock = channel.clock = HandClock(100.0)
    consumer = SyncConsumer(channel, 0x80, PERIOD)
    heard(consumer, 100.0)
    consumer.wait()
    clock.time = 100.5
    with pytest.raises(SyncError):
        consumer.wait()


def test_after_the_last_sync_the_drives_are_stopped_by_sdo_without_sync(
    channel: Channel, fake: FakeBus
) -> None:
    """Their RPDOs wait for a SYNC that does not come; the SDO does not. And we send no SYNC: it is not ours."""
    clock = channel.clock = HandClock(100.0)
    slave: Slave = slave_of(fake, 5)
    port = port_of(channel, 5)
    consumer = SyncConsumer(channel, 0x80, PERIOD)
    cycle = CanCycle(channel, [port], sync_cob_id=None, sync_consumer=consumer)
    scan = Scan(cycle, {}, {}, PERIOD)
    heard(consumer, 100.0)
    scan.once()
    port.write(Outputs(controlword=0x0F, target_position=0))
    cycle.commit()
    fake.sent.clear()
    clock.time = 100.007
    scan.run()
    assert isinstance(scan.failure, SyncError)
    eventually(lambda: (0x6040, 0, b"\x02\0") in slave.writes)
    assert fake.frames(0x80) == []
    assert (0x205, bytes.fromhex("02 00 00 00 00 00")) in fake.sent
    port.close()
    port.node.close()


# -- TIME

NOON = datetime(2000, 1, 1, 12, tzinfo=UTC)


def test_time_is_sent_at_its_period(channel: Channel, fake: FakeBus) -> None:
    """Noon is 43200000 ms, 02932E00h; 1 January 2000 is day 5844, 16D4h."""
    clock = channel.clock = HandClock(50.0)
    cycle = CanCycle(channel, [], time_producer=TimeProducer(channel, 1.0, wall_clock=lambda: NOON))
    for _ in range(26):  # 2.5 s
        cycle.heartbeat()
        clock.time += 0.1
    assert fake.sent == [(0x100, bytes.fromhex("00 2e 93 02 d4 16"))] * 3


def test_time_has_the_identifier_of_the_cell_file(channel: Channel, fake: FakeBus) -> None:
    TimeProducer(channel, 1.0, 0x104, wall_clock=lambda: NOON).step(0.0)
    assert [can_id for can_id, _ in fake.sent] == [0x104]


def test_the_time_of_another_producer_is_received_and_extrapolated(channel: Channel, fake: FakeBus) -> None:
    consumer = TimeConsumer(channel)
    assert consumer.latest is None
    assert consumer.at(time.monotonic()) is None
    fake.inject(0x100, "00 2e 93")
    fake.inject(0x100, "00 2e 93 02 d4 16")
    eventually(lambda: consumer.latest)
    assert consumer.malformed == 1
    assert consumer.latest is not None
    _, stamp = consumer.latest
    assert consumer.at(stamp + 61.5) == datetime(2000, 1, 1, 12, 1, 1, 500_000, tzinfo=UTC)
    consumer.close()
