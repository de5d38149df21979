"""How SDO transfers are counted: each by the result that its caller got, and the attempts after the first."""

from __future__ import annotations

import threading

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.sdo.client import SdoClient
from axisbus.cia301.sdo_counts import SdoCount
from axisbus.errors import AdapterError, Interrupted, SdoAbort, SdoError, SdoTimeout
from kit.bus.fake_bus import FakeBus, Slave, eventually

SHORT = 0.05  # an answer time that tests of silence can afford


@pytest.fixture
def sdo(channel: Channel, slave: Slave) -> SdoClient:
    return SdoClient(channel, 5, timeout=SHORT)


def test_before_the_first_transfer_nothing_is_counted(channel: Channel) -> None:
    assert channel.sdo_counts.found == ()


def test_an_answer_that_is_lost_is_a_retry_and_the_transfer_is_done(
    sdo: SdoClient, slave: Slave, channel: Channel
) -> None:
    sdo.upload(0x1000)
    slave.ignore = 1
    sdo.upload(0x1000)
    assert channel.sdo_counts.found == (SdoCount(5, done=2, retries=1),)


def test_a_silent_node_is_unanswered_after_all_its_retries(
    sdo: SdoClient, slave: Slave, channel: Channel
) -> None:
    slave.ignore = 1000
    with pytest.raises(SdoTimeout):
        sdo.upload(0x1000)
    with pytest.raises(SdoTimeout):
        sdo.upload(0x1000, tries=1)
    assert channel.sdo_counts.found == (SdoCount(5, unanswered=2, retries=2),)


def test_a_refusal_is_an_abort_and_is_not_tried_again(sdo: SdoClient, channel: Channel) -> None:
    with pytest.raises(SdoAbort):
        sdo.upload(0x2345)
    assert channel.sdo_counts.found == (SdoCount(5, aborted=1),)


def test_a_dialogue_that_breaks_in_every_attempt_is_broken(
    sdo: SdoClient, slave: Slave, channel: Channel
) -> None:
    slave.objects[0x1008, 0] = b"A drive with a long name"
    slave.flip_toggle = 1000
    with pytest.raises(SdoError):
        sdo.upload(0x1008)
    assert channel.sdo_counts.found == (SdoCount(5, broken=1, retries=2),)


def test_a_transfer_that_is_cancelled_or_cannot_be_sent_counts_as_cut_short(
    channel: Channel, slave: Slave, fake: FakeBus
) -> None:
    patient = SdoClient(channel, 5, timeout=10.0)
    slave.hold = True
    ends: list[BaseException] = []

    def ask() -> None:
        with pytest.raises(Interrupted) as caught:
            patient.upload(0x1000)
        ends.append(caught.value)

    asking = threading.Thread(target=ask)
    asking.start()
    eventually(lambda: fake.frames(0x605))
    patient.cancel()
    asking.join()
    assert len(ends) == 1
    fake.full = True
    with pytest.raises(AdapterError):
        patient.upload(0x1000)
    assert channel.sdo_counts.found == (SdoCount(5, cut_short=2),)


def test_clients_of_several_nodes_and_channels_count_together_by_node(
    channel: Channel, slave: Slave, fake: FakeBus
) -> None:
    other = Slave(7)
    fake.peers.append(other)
    first, second, third = SdoClient(channel, 5), SdoClient(channel, 7), SdoClient(channel, 5)
    work = [
        threading.Thread(target=lambda one=one: [one.upload(0x1000) for _ in range(50)])
        for one in (first, second)
    ]
    for thread in work:
        thread.start()
    for thread in work:
        thread.join()
    third.upload(0x1000)
    assert channel.sdo_counts.found == (SdoCount(5, done=51), SdoCount(7, done=50))
