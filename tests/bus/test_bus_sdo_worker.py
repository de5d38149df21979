"""The SDO worker of a node: in order, never blocking the scan, and yielding to a quick stop."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.sdo.client import SdoClient
from axisbus.bus.sdo.worker import QUEUE_LIMIT, SdoJob, SdoWorker
from axisbus.errors import BusError, Interrupted
from kit.bus.fake_bus import FakeBus, Slave, eventually

TIMED_OUT = 0x0504_0000


@pytest.fixture
def slave(fake: FakeBus) -> Slave:
    slave = Slave(
        5,
        {
            (0x6040, 0): b"\x0f\x00",
            (0x6064, 0): b"\xfe\xff\xff\xff",
            (0x6081, 0): bytes(4),
            (0x6083, 0): bytes(4),
            (0x1008, 0): b"a name",
        },
    )
    fake.peers.append(slave)
    return slave


@pytest.fixture
def worker(channel: Channel, slave: Slave) -> Iterator[SdoWorker]:
    worker = SdoWorker(channel, SdoClient(channel, 5, timeout=60.0))
    yield worker
    worker.close()


class Ends:
    """Collects the ends of jobs: (key, value, abort)."""

    def __init__(self) -> None:
        self.all: list[tuple[object, int | None, int | None]] = []

    def job(self, key: object, index: int, value: int | None = None) -> SdoJob:
        return SdoJob(key, index, 0, value, lambda got, code: self.all.append((key, got, code)))


def test_jobs_are_carried_out_in_their_order(worker: SdoWorker, slave: Slave) -> None:
    ends = Ends()
    worker.submit(ends.job(1, 0x6081, 100))
    worker.submit(ends.job(2, 0x6083, 200))
    worker.submit(ends.job(3, 0x6064))
    worker.submit(ends.job(4, 0x6081, 300))
    eventually(lambda: len(ends.all) == 4)
    assert ends.all == [(1, None, None), (2, None, None), (3, -2, None), (4, None, None)]
    assert [write[0] for write in slave.writes] == [0x6081, 0x6083, 0x6081]
    eventually(lambda: worker.idle)


def test_a_failed_job_ends_with_an_abort_code(worker: SdoWorker, slave: Slave) -> None:
    slave.abort_on[0x6083, 0] = 0x0609_0031
    ends = Ends()
    worker.submit(ends.job("refused", 0x6083, 1))
    worker.submit(ends.job("missing", 0x60FE))
    worker.submit(ends.job("too big", 0x6081, 1 << 40))
    worker.submit(ends.job("no number", 0x1008))
    worker.submit(ends.job("fine", 0x6081, 1))
    eventually(lambda: len(ends.all) == 5)
    assert ends.all == [
        ("refused", None, 0x0609_0031),
        ("missing", None, 0x0602_0000),
        ("too big", None, 0x0609_0030),
        ("no number", None, 0x0607_0010),
        ("fine", None, None),
    ]


def test_limits_of_an_eds_keep_nothing_from_the_drive(worker: SdoWorker, slave: Slave) -> None:
    """They are often wrong, and a stop must be sent in any case; the drive itself refuses invalid values."""
    dictionary = worker._sdo.dictionary
    limited = replace(dictionary.entry(0x6040), low=0, high=1)
    worker._sdo.dictionary = SimpleNamespace(entry=lambda *_: limited)  # type: ignore[assignment]
    ends = Ends()
    worker.urgent(ends.job("stop", 0x6040, 2))
    eventually(lambda: len(ends.all) == 1)
    assert ends.all == [("stop", None, None)]
    assert slave.objects[0x6040, 0] == b"\x02\x00"


def test_a_quick_stop_never_waits_behind_sdo(worker: SdoWorker, slave: Slave) -> None:
    ends = Ends()
    slave.hold = True
    worker.submit(ends.job("running", 0x6064))
    worker.submit(ends.job("waiting", 0x6081, 5))
    eventually(lambda: slave.held)
    slave.release()
    worker.urgent(ends.job("stop", 0x6040, 2))
    eventually(lambda: len(ends.all) == 3)
    assert slave.objects[0x6040, 0] == b"\x02\x00"
    assert set(ends.all) == {
        ("running", None, TIMED_OUT),
        ("waiting", None, TIMED_OUT),
        ("stop", None, None),
    }
    assert slave.aborts_received == [(0x6064, 0, 0x0800_0000)]
    assert [write[0] for write in slave.writes] == [0x6040]


def test_a_quick_stop_ends_everything_that_waits(worker: SdoWorker, slave: Slave) -> None:
    ends = Ends()
    slave.hold = True
    worker.submit(ends.job("running", 0x6064))
    eventually(lambda: slave.held)
    slave.release()
    for key in ("one", "two"):
        worker.submit(ends.job(key, 0x6081, 5))
    worker.urgent(ends.job("stop", 0x6040, 2))
    eventually(lambda: len(ends.all) == 4)
    assert set(ends.all) == {
        ("stop", None, None),
        *((key, None, TIMED_OUT) for key in ("running", "one", "two")),
    }
    assert [write[0] for write in slave.writes] == [0x6040]


def test_a_quick_stop_may_be_the_first_job_of_all(worker: SdoWorker, slave: Slave) -> None:
    ends = Ends()
    worker.urgent(ends.job("stop", 0x6040, 2))
    eventually(lambda: ends.all)
    assert slave.objects[0x6040, 0] == b"\x02\x00"


def test_a_worker_with_a_pending_quick_stop_is_not_idle(
    worker: SdoWorker, monkeypatch: pytest.MonkeyPatch
) -> None:
    assert worker.idle
    monkeypatch.setattr(worker, "_start", lambda: None)  # nothing takes it
    worker.urgent(Ends().job("stop", 0x6040, 2))
    assert not worker.idle


def test_a_running_quick_stop_is_not_cut_short_by_another(
    worker: SdoWorker, slave: Slave, fake: FakeBus
) -> None:
    slave.objects[0x6840, 0] = b"\x0f\x00"
    ends = Ends()
    slave.hold = True
    worker.urgent(ends.job("axis 1", 0x6040, 2))
    eventually(lambda: slave.held)
    worker.urgent(ends.job("axis 2", 0x6840, 2))
    for can_id, data in slave.release():
        fake.inject(can_id, data)
    eventually(lambda: len(ends.all) == 2)
    assert ends.all == [("axis 1", None, None), ("axis 2", None, None)]
    assert slave.aborts_received == []


def test_quick_stops_of_both_axes_are_carried_out(worker: SdoWorker, slave: Slave) -> None:
    """An urgent job of the second axis must not drop that of the first."""
    slave.objects[0x6840, 0] = b"\x0f\x00"
    ends = Ends()
    slave.hold = True
    worker.submit(ends.job("running", 0x6064))
    eventually(lambda: slave.held)
    slave.release()
    worker.urgent(ends.job("axis 1", 0x6040, 2))
    worker.urgent(ends.job("axis 2", 0x6840, 2))
    eventually(lambda: len(ends.all) == 3)
    assert slave.objects[0x6040, 0] == b"\x02\x00"
    assert slave.objects[0x6840, 0] == b"\x02\x00"


def test_a_quick_stop_overtakes_a_transfer_of_the_user_too(
    worker: SdoWorker, slave: Slave, channel: Channel
) -> None:
    """The worker waits for the client's lock, which a user's transfer with a silent node holds."""
    ends = Ends()
    client = worker._sdo
    slave.hold = True
    user: list[BaseException] = []

    def read() -> None:
        try:
            client.upload(0x6064)
        except Interrupted as error:
            user.append(error)

    thread = threading.Thread(target=read)
    thread.start()
    eventually(lambda: slave.held)
    worker.submit(ends.job("behind the user", 0x6081, 5))
    eventually(lambda: worker._running is not None)
    slave.release()
    worker.urgent(ends.job("stop", 0x6040, 2))
    eventually(lambda: slave.objects[0x6040, 0] == b"\x02\x00")
    thread.join(5)
    assert len(user) == 1


def test_a_job_that_is_about_to_begin_yields_too(
    worker: SdoWorker, slave: Slave, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Between being taken from the queue and its first frame: it must not keep the stop waiting for a silent node."""
    client = worker._sdo
    real, begun, go_on = client.read, threading.Event(), threading.Event()

    def read_later(*args: Any, **kwargs: Any) -> Any:
        begun.set()
        go_on.wait(10)
        return real(*args, **kwargs)

    monkeypatch.setattr(client, "read", read_later)
    ends = Ends()
    worker.submit(ends.job("about to begin", 0x6064))
    begun.wait(10)
    worker.urgent(ends.job("stop", 0x6040, 2))
    go_on.set()
    eventually(lambda: len(ends.all) == 2)
    assert ends.all == [("about to begin", None, TIMED_OUT), ("stop", None, None)]
    assert slave.aborts_received == []  # it had asked nothing yet


def test_cancelled_jobs_never_run_and_are_not_answered(worker: SdoWorker, slave: Slave) -> None:
    ends = Ends()
    slave.hold = True
    worker.submit(ends.job(1, 0x6064))
    worker.submit(ends.job(2, 0x6081, 5))
    worker.submit(ends.job(3, 0x6083, 6))
    eventually(lambda: slave.held)
    slave.release()
    worker.cancel({1, 2})
    eventually(lambda: ends.all)
    assert ends.all == [(3, None, None)]
    assert slave.aborts_received == [(0x6064, 0, 0x0800_0000)]
    assert [write[0] for write in slave.writes] == [0x6083]


def test_forgetting_jobs_while_none_runs_harms_nothing(worker: SdoWorker) -> None:
    ends = Ends()
    worker.cancel({1})
    worker.submit(ends.job(1, 0x6064))
    eventually(lambda: ends.all)
    assert ends.all == [(1, -2, None)]


def test_an_internal_error_in_a_transfer_ends_only_its_job(
    worker: SdoWorker, channel: Channel, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(*_args: object, **_options: object) -> None:
        raise ValueError("a fault of ours")

    told: list[BusError] = []
    monkeypatch.setattr(worker._sdo, "read", broken)
    monkeypatch.setattr(channel, "fail", told.append)
    ends = Ends()
    worker.submit(ends.job("broken", 0x6064))
    worker.submit(ends.job("fine", 0x6081, 1))
    eventually(lambda: len(ends.all) == 2)
    assert ends.all == [("broken", None, 0x0800_0000), ("fine", None, None)]
    assert [error.observed for error in told] == ["ValueError: a fault of ours"]


def test_the_queue_is_bounded(worker: SdoWorker, slave: Slave) -> None:
    ends = Ends()
    slave.hold = True
    worker.submit(ends.job("running", 0x6064))
    eventually(lambda: slave.held)
    for number in range(QUEUE_LIMIT):
        worker.submit(ends.job(number, 0x6081, number))
    assert ends.all == []
    worker.submit(ends.job("one too many", 0x6081, 1))
    assert ends.all == [("one too many", None, 0x0504_0005)]


def test_closing_ends_everything_quickly(channel: Channel, slave: Slave) -> None:
    worker = SdoWorker(channel, SdoClient(channel, 5, timeout=60.0))
    ends = Ends()
    slave.hold = True
    worker.submit(ends.job("running", 0x6064))
    worker.submit(ends.job("waiting", 0x6081, 1))
    worker.submit(ends.job("last", 0x6083, 1))
    eventually(lambda: slave.held)
    worker.close()
    assert set(ends.all) == {
        ("running", None, TIMED_OUT),
        ("waiting", None, TIMED_OUT),
        ("last", None, TIMED_OUT),
    }
    worker.submit(ends.job("late", 0x6064))
    assert ends.all[-1] == ("late", None, 0x0504_0005)
    worker.urgent(ends.job("late stop", 0x6040, 2))
    assert ends.all[-1] == ("late stop", None, TIMED_OUT)


def test_closing_ends_a_quick_stop_that_waits_behind_another_and_does_not_send_it(
    worker: SdoWorker, slave: Slave, fake: FakeBus
) -> None:
    ends = Ends()
    slave.hold = True
    worker.urgent(ends.job("axis 1", 0x6040, 2))
    eventually(lambda: slave.held)
    worker.urgent(ends.job("axis 2", 0x6840, 2))
    closing = threading.Thread(target=worker.close)
    closing.start()
    eventually(lambda: ends.all)
    for can_id, data in slave.release():
        fake.inject(can_id, data)
    closing.join(5)
    assert ends.all == [("axis 2", None, TIMED_OUT), ("axis 1", None, None)]
    assert [write[0] for write in slave.writes] == [0x6040]


def test_the_callback_of_a_job_may_close_the_worker(worker: SdoWorker, channel: Channel) -> None:
    closed = threading.Event()

    def close(value: int | None, code: int | None) -> None:
        worker.close()
        closed.set()

    worker.submit(SdoJob(1, 0x6064, 0, None, close))
    assert closed.wait(5)
    channel.check()


def test_a_program_that_ends_does_not_wait_for_its_transfers(worker: SdoWorker, slave: Slave) -> None:
    slave.hold = True
    worker.submit(Ends().job("running", 0x6064))
    (thread,) = (thread for thread in threading.enumerate() if thread.name == "axisbus SDO node 5")
    assert thread.daemon


def test_a_callback_that_raises_is_known_to_the_channel(worker: SdoWorker, channel: Channel) -> None:
    def broken(value: int | None, code: int | None) -> None:
        raise ValueError("a fault of ours")

    worker.submit(SdoJob(1, 0x6064, 0, None, broken))
    eventually(lambda: channel.failure)
    with pytest.raises(BusError, match="SDO worker of node 5"):
        channel.check()
