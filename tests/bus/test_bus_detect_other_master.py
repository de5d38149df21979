"""Listening before the first frame: the received frames decide, each failure is reported with its cause, and nothing is sent."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager

import can
import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.link.detect_other_master import require_no_other_master
from axisbus.cia301.master_detection import ExpectedMasters
from axisbus.errors import AdapterError, SecondMasterError, StateError
from kit.bus.fake_bus import FakeBus, eventually

CAST = ExpectedMasters(frozenset({5}), frozenset({127}))


@contextmanager
def later(action: object, seconds: float = 0.03) -> Iterator[None]:
    timer = threading.Timer(seconds, action)  # type: ignore[arg-type]
    timer.start()
    try:
        yield
    finally:
        timer.join()


def test_a_quiet_bus_passes_the_check_for_another_master(channel: Channel, fake: FakeBus) -> None:
    require_no_other_master(channel, CAST, 0.05)
    assert fake.sent == []
    assert fake.remote == []


def test_the_error_is_reported_in_plain_fields_and_nothing_was_sent(channel: Channel, fake: FakeBus) -> None:
    with (
        later(lambda: fake.inject(0x605, "40 41 60 00 00 00 00 00")),
        pytest.raises(SecondMasterError) as caught,
    ):
        require_no_other_master(channel, CAST, 0.2)
    assert caught.value.heard == ("SDO requests to node 5 (605h): 1",)
    assert "it is not known which program" in caught.value.observed
    assert fake.sent == []


def test_a_remote_frame_of_guarding_is_reported_as_another_master_too(
    channel: Channel, fake: FakeBus
) -> None:
    guard = can.Message(arbitration_id=0x705, is_remote_frame=True, is_extended_id=False)
    with later(lambda: fake.inbox.put(guard)), pytest.raises(SecondMasterError, match="node guarding"):
        require_no_other_master(channel, CAST, 0.2)


def test_frames_from_before_or_after_listening_do_not_count(channel: Channel, fake: FakeBus) -> None:
    fake.inject(0x77F, "05")
    eventually(lambda: channel.counters.received == 1)
    require_no_other_master(channel, CAST, 0.05)
    fake.inject(0x77F, "05")
    eventually(lambda: channel.counters.received == 2)
    channel.check()


def test_an_adapter_that_fails_meanwhile_is_reported_as_that(channel: Channel, fake: FakeBus) -> None:
    fail = lambda: (fake.inject(0x77F, "05"), fake.fail_receiving(OSError("unplugged")))  # noqa: E731
    with later(fail), pytest.raises(AdapterError, match="stopped receiving"):
        require_no_other_master(channel, CAST, 0.2)


def test_a_controller_that_goes_bus_off_during_the_check_is_reported_as_bus_off(
    channel: Channel, fake: FakeBus
) -> None:
    fake.says = can.BusState.ERROR
    with pytest.raises(AdapterError, match="bus-off"):
        require_no_other_master(channel, CAST, 0.3)


def test_the_check_for_another_master_is_refused_in_the_receive_thread(
    channel: Channel, fake: FakeBus
) -> None:
    caught: list[StateError] = []

    def receiver(_data: bytes, _stamp: float) -> None:
        try:
            require_no_other_master(channel, CAST, 0.01)
        except StateError as error:
            caught.append(error)

    channel.subscribe(0x181, receiver)
    fake.inject(0x181, "00")
    eventually(lambda: caught)
