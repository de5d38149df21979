"""NMT: the reports of a node are stored, and a command counts when it is confirmed."""

from __future__ import annotations

import math
import threading
import time

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.node import nmt
from axisbus.bus.node.nmt import Confirmation, NodeMonitor
from axisbus.bus.node.node import CanopenNode
from axisbus.bus.sdo import worker
from axisbus.cia301.nmt import NmtCommand, NmtState
from axisbus.errors import AdapterError, ArgumentError, Interrupted, NodeRefused, NodeTimeout, StateError
from kit.bus.fake_bus import FakeBus, Frame, Slave, eventually


def beat(fake: FakeBus, slave: Slave, node: CanopenNode) -> None:
    """Have one heartbeat arrive, and wait until it has been taken."""
    before = node.nmt.reports
    fake.inject(*slave.heartbeat())
    eventually(lambda: node.nmt.reports > before)


def answers_with_heartbeat(slave: Slave, fake: FakeBus) -> None:
    """From now on the slave sends a heartbeat right after each NMT command, as if its period had just passed."""

    def peer(can_id: int, data: bytes, remote: bool) -> list[Frame]:
        return [slave.heartbeat()] if can_id == 0 and data[0] < 129 else []

    fake.peers.append(peer)


def test_a_heartbeat_reports_the_state_and_its_age(node: CanopenNode, slave: Slave, fake: FakeBus) -> None:
    assert node.nmt.state == NmtState.UNKNOWN
    before = time.monotonic()
    beat(fake, slave, node)
    assert node.nmt.state is NmtState.PRE_OPERATIONAL
    assert node.nmt.stamp is not None
    assert before <= node.nmt.stamp <= time.monotonic()


def test_every_boot_up_is_counted_even_between_two_looks(node: CanopenNode, fake: FakeBus) -> None:
    for data in ("00", "05", "00", "7F"):
        fake.inject(0x705, data)
    eventually(lambda: node.nmt.reports == 4)
    assert node.nmt.bootups == 2
    assert node.nmt.bootup_stamp is not None
    node.nmt.wait_bootup(timeout=0.0, after=1)  # it has come: no waiting, no matter how long ago


def test_a_missing_boot_up_is_a_time_out_with_its_remedy(node: CanopenNode) -> None:
    with pytest.raises(NodeTimeout, match="no boot-up") as caught:
        node.nmt.wait_bootup(timeout=0.02)
    assert caught.value.node == 5
    assert "power" in caught.value.remedy


def test_an_overdue_heartbeat_ends_operational(node: CanopenNode, slave: Slave, fake: FakeBus) -> None:
    slave.nmt_state = 5
    beat(fake, slave, node)
    stamp = node.nmt.stamp
    assert stamp is not None
    assert node.nmt.operational(stamp + 1000)  # it is not monitored
    node.nmt.watch(0.3)
    beat(fake, slave, node)
    stamp = node.nmt.stamp
    assert stamp is not None
    assert node.nmt.operational(stamp + 0.29)
    assert not node.nmt.operational(stamp + 0.31)
    assert node.nmt.overdue(stamp + 0.31)
    assert node.nmt.deadline == stamp + 0.3
    assert not node.nmt.overdue(node.nmt.deadline)


def test_the_watch_counts_from_its_beginning(node: CanopenNode, slave: Slave, fake: FakeBus) -> None:
    """A heartbeat received long ago must not make the node overdue at once."""
    beat(fake, slave, node)
    time.sleep(0.05)
    node.nmt.watch(0.02)
    assert not node.nmt.overdue(time.monotonic())


def test_a_node_that_has_never_reported_is_overdue_after_its_time(node: CanopenNode) -> None:
    node.nmt.watch(0.3)
    now = time.monotonic()
    assert not node.nmt.overdue(now)
    assert node.nmt.overdue(now + 0.31)
    assert not node.nmt.overdue(node.nmt.deadline)
    assert now - 0.1 < node.nmt.deadline - 0.3 <= now
    node.nmt.watch(None)
    assert not node.nmt.overdue(now + 1000)
    assert node.nmt.deadline == math.inf


@pytest.mark.parametrize(
    ("data", "state"), [("04", NmtState.STOPPED), ("FF", NmtState.PRE_OPERATIONAL), ("50", 80)]
)
def test_toggle_bits_and_unknown_states_are_read(
    node: CanopenNode, fake: FakeBus, data: str, state: int
) -> None:
    fake.inject(0x705, data)
    eventually(lambda: node.nmt.reports)
    assert node.nmt.state == state


def test_a_command_is_confirmed_by_the_heartbeat(node: CanopenNode, slave: Slave, fake: FakeBus) -> None:
    beat(fake, slave, node)
    answers_with_heartbeat(slave, fake)
    assert node.command(NmtCommand.START) is Confirmation.HEARTBEAT
    assert node.nmt.state is NmtState.OPERATIONAL
    assert fake.frames(0) == [b"\x01\x05"]


def test_a_command_that_is_lost_is_sent_again(node: CanopenNode, slave: Slave, fake: FakeBus) -> None:
    beat(fake, slave, node)
    fake.peers.remove(slave)  # the first one does not reach it

    def second_time(can_id: int, data: bytes, remote: bool) -> list[Frame]:
        if can_id != 0 or len(fake.frames(0)) < 2:
            return []
        slave(can_id, data, remote)
        return [slave.heartbeat()]

    fake.peers.append(second_time)
    assert node.command(NmtCommand.START, timeout=0.3) is Confirmation.HEARTBEAT
    assert fake.frames(0) == [b"\x01\x05", b"\x01\x05"]


def test_a_heartbeat_from_before_the_command_does_not_confirm_it(
    node: CanopenNode, slave: Slave, fake: FakeBus
) -> None:
    slave.nmt_state = 5
    beat(fake, slave, node)
    with pytest.raises(NodeTimeout, match="'start'"):
        node.command(NmtCommand.START, timeout=0.02)


def test_a_node_that_keeps_its_state_is_named(node: CanopenNode, slave: Slave, fake: FakeBus) -> None:
    beat(fake, slave, node)
    answers_with_heartbeat(slave, fake)
    slave.nmt_state = 127
    fake.peers.remove(slave)  # it receives no command any more, but keeps sending heartbeats
    with pytest.raises(NodeTimeout) as caught:
        node.command(NmtCommand.START, timeout=0.05)
    assert "expected operational" in caught.value.observed
    assert "NMT state pre-operational" in caught.value.observed


def test_without_heartbeat_node_guarding_confirms(node: CanopenNode, slave: Slave, fake: FakeBus) -> None:
    slave.answers_guarding = True
    node.nmt.guard(1.0, 0.5)
    assert node.command(NmtCommand.START) is Confirmation.GUARDING
    assert fake.remote == [0x705]
    assert not node.nmt.has_heartbeat  # an answer is no heartbeat: the next command asks again
    assert node.command(NmtCommand.ENTER_PRE_OPERATIONAL) is Confirmation.GUARDING


def test_without_heartbeat_and_guarding_the_sdo_server_does(node: CanopenNode, slave: Slave) -> None:
    assert node.command(NmtCommand.START, timeout=0.5) is Confirmation.SDO
    assert node.nmt.state is NmtState.OPERATIONAL
    assert node.nmt.assumed
    assert node.nmt.operational(time.monotonic())
    assert node.command(NmtCommand.STOP, timeout=0.5) is Confirmation.SDO  # it no longer answers
    assert node.nmt.state is NmtState.STOPPED


def test_a_node_that_shows_nothing_is_a_time_out(node: CanopenNode, slave: Slave) -> None:
    slave.ignore = 100
    with pytest.raises(NodeTimeout, match="did not confirm") as caught:
        node.command(NmtCommand.START, timeout=0.3)
    assert "never reported" in caught.value.observed
    assert caught.value.remedy.startswith("check its power, node ID and wiring, and whether")


@pytest.mark.parametrize("reset", [NmtCommand.RESET_NODE, NmtCommand.RESET_COMMUNICATION])
def test_a_reset_is_confirmed_by_the_boot_up(node: CanopenNode, reset: NmtCommand) -> None:
    assert node.command(reset) is Confirmation.BOOT_UP
    assert node.nmt.bootups == 1


def test_the_command_of_another_master_is_seen_without_a_heartbeat(node: CanopenNode, fake: FakeBus) -> None:
    node.nmt.assume(NmtState.OPERATIONAL)
    fake.inject(0x000, "02 00")
    eventually(lambda: node.nmt.state is NmtState.STOPPED)
    assert not node.nmt.operational(time.monotonic())


def test_waiting_ends_when_the_channel_fails(node: CanopenNode, fake: FakeBus) -> None:
    caught: list[BaseException] = []

    def wait() -> None:
        try:
            node.nmt.wait_state(NmtState.OPERATIONAL, timeout=60)
        except AdapterError as error:
            caught.append(error)

    thread = threading.Thread(target=wait)
    thread.start()
    fake.fail_receiving(OSError("unplugged"))
    thread.join(5)
    assert len(caught) == 1


def test_waiting_in_the_receive_thread_is_an_error(
    node: CanopenNode, channel: Channel, fake: FakeBus
) -> None:
    caught: list[BaseException] = []

    def receiver(data: bytes, _: float) -> None:
        try:
            node.nmt.wait_state(NmtState.OPERATIONAL, timeout=60)
        except StateError as error:
            caught.append(error)

    channel.subscribe(0x185, receiver)
    fake.inject(0x185, "00")
    eventually(lambda: caught)


def test_a_closed_monitor_receives_nothing(channel: Channel, fake: FakeBus) -> None:
    monitor = NodeMonitor(channel, 5)
    monitor.close()
    seen: list[bytes] = []
    channel.subscribe(0x705, lambda data, _: seen.append(data))
    fake.inject(0x705, "05")
    eventually(lambda: seen)
    assert monitor.reports == 0


def test_a_closed_node_listens_to_nothing(channel: Channel) -> None:
    wakes = list(channel.on_failure)
    with CanopenNode(channel, 5) as node:
        assert set(channel._receivers) == {0x000, 0x085, 0x585, 0x705}
    assert channel._receivers == {}
    assert channel.on_failure == wakes
    node.close()


def test_a_node_is_closed_at_once_though_its_worker_waits_for_a_users_transfer(
    channel: Channel, slave: Slave, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(worker, "CLOSE_PATIENCE", 10.0)
    slave.hold = True
    ended: list[object] = []

    def read() -> None:
        try:
            node.sdo.upload(0x1000)
        except Interrupted as error:
            ended.append(error)

    with CanopenNode(channel, 5, sdo_timeout=60.0) as node:
        user = threading.Thread(target=read)
        user.start()
        eventually(lambda: slave.held)
        node.worker.submit(worker.SdoJob(1, 0x1001, 0, None, lambda *end: ended.append(end)))
        eventually(lambda: len(node.sdo._calls) == 2)
        began = time.monotonic()
    assert time.monotonic() - began < 5.0
    user.join(5)
    assert len(ended) == 2


@pytest.mark.parametrize("node_id", [0, 128])
def test_a_node_id_out_of_range_is_refused(channel: Channel, node_id: int) -> None:
    with pytest.raises(ArgumentError, match=f"{node_id} is not a node ID"):
        CanopenNode(channel, node_id)


def test_a_node_without_guarding_is_not_polled_by_remote_frames(
    channel: Channel, node: CanopenNode, slave: Slave, fake: FakeBus
) -> None:
    """That would arm its life guarding, and the polling would not be continued."""
    assert (
        nmt.command(channel, node.nmt, NmtCommand.START, timeout=0.05, answers_sdo=lambda: True)
        is Confirmation.SDO
    )
    assert fake.remote == []
    assert [frame for frame in fake.sent if frame[0] == 0] == [(0, b"\1\5")] * 2  # it may have been lost
    assert (node.nmt.state, node.nmt.assumed) == (NmtState.OPERATIONAL, True)
    with pytest.raises(NodeTimeout):
        nmt.command(channel, node.nmt, NmtCommand.START, timeout=0.05, answers_sdo=lambda: False)
    with pytest.raises(NodeTimeout):
        nmt.command(channel, node.nmt, NmtCommand.START, timeout=0.05)
    assert (
        nmt.command(channel, node.nmt, NmtCommand.STOP, timeout=0.05, answers_sdo=lambda: False)
        is Confirmation.SDO
    )


@pytest.mark.parametrize(("after", "error"), [(1, NodeTimeout), (2, NodeRefused)])
def test_one_report_may_have_crossed_the_command_and_two_of_another_state_refuse_it(
    fake, channel, node, after: int, error: type[NodeTimeout]
) -> None:
    fake.inject(0x705, "7F")
    eventually(lambda: node.nmt.has_heartbeat)
    left = [(0x705, b"\x7f")] * after
    fake.peers.append(lambda can_id, *_: [left.pop()] if can_id == 0 and left else [])
    with pytest.raises(NodeTimeout) as caught:
        nmt.command(channel, node.nmt, NmtCommand.START, timeout=0.3)
    assert type(caught.value) is error
    if after == 1:
        assert caught.value.remedy.startswith("it answers: check its error register (1001h), and")
