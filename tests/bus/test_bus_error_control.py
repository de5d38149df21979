"""Events of error control: losses, restarts and states with their reaction times, and the toggle bit of guarding."""

from __future__ import annotations

import time

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.node.events import NodeEvent, NodeEventKind, NodeEvents
from axisbus.bus.node.nmt import guarding_answer
from axisbus.bus.node.node import CanopenNode
from axisbus.cia301.nmt import NmtState
from kit.bus.fake_bus import FakeBus, Slave, eventually


def hear(fake: FakeBus, node: CanopenNode, data: str) -> float:
    """Have a message of error control arrive, and return when."""
    before = node.nmt.reports
    fake.inject(0x705, data)
    eventually(lambda: node.nmt.reports > before)
    assert node.nmt.stamp is not None
    return node.nmt.stamp


def test_no_event_is_reported_while_heartbeats_arrive(node: CanopenNode, fake: FakeBus) -> None:
    hear(fake, node, "05")
    node.nmt.watch(0.3)
    events = NodeEvents(node.nmt)
    events.look(hear(fake, node, "05") + 0.1)
    events.look(hear(fake, node, "05") + 0.2)
    assert not events.history


def test_a_loss_and_a_return_are_reported_once_each_with_times(node: CanopenNode, fake: FakeBus) -> None:
    hear(fake, node, "05")
    node.nmt.watch(0.3)
    events = NodeEvents(node.nmt)
    heard = hear(fake, node, "05")
    for late in (0.29, 0.302, 0.306):
        events.look(heard + late)
    (lost,) = events.history
    assert (lost.kind.name, lost.state) == ("LOST", NmtState.OPERATIONAL)
    assert lost.silent == pytest.approx(0.302)
    assert lost.reaction == pytest.approx(0.002)
    again = hear(fake, node, "05")
    events.look(again + 0.001)
    assert [event.kind.name for event in events.history] == ["LOST", "BACK"]
    assert events.history[1].reaction == pytest.approx(0.001)


def test_a_restart_between_two_looks_is_not_missed(node: CanopenNode, fake: FakeBus) -> None:
    hear(fake, node, "05")
    events = NodeEvents(node.nmt)
    hear(fake, node, "00")
    hear(fake, node, "05")
    events.look(time.monotonic())
    events.look(time.monotonic())
    assert [event.kind.name for event in events.history] == ["BOOT_UP", "OPERATIONAL"]


@pytest.mark.parametrize(("data", "state"), [("04", NmtState.STOPPED), ("7F", NmtState.PRE_OPERATIONAL)])
def test_another_state_is_reported_to_its_subscribers(
    node: CanopenNode, fake: FakeBus, data: str, state: int
) -> None:
    hear(fake, node, "05")
    events = NodeEvents(node.nmt)
    told: list[NodeEvent] = []
    events.subscribe(told.append)
    hear(fake, node, data)
    events.look(time.monotonic())
    assert [(event.kind.name, event.state) for event in told] == [("STATE", state)]
    assert "an NMT state other than operational" in str(told[0])


def test_a_guarding_answer_with_the_same_toggle_bit_does_not_count(node: CanopenNode, fake: FakeBus) -> None:
    """CiA 301 7.2.8.3.2.1: the toggle bit changes with each answer, and begins at 0 after the boot-up."""
    node.nmt.guard(1.0, 0.5)
    first = hear(fake, node, "05")
    fake.inject(0x705, "05")
    eventually(lambda: node.nmt.toggle_errors == 1)
    assert node.nmt.stamp == first
    assert hear(fake, node, "85") > first
    hear(fake, node, "00")
    hear(fake, node, "05")
    assert node.nmt.toggle_errors == 1


def test_heartbeats_have_no_toggle_bit(node: CanopenNode, fake: FakeBus) -> None:
    hear(fake, node, "05")
    hear(fake, node, "05")
    assert node.nmt.toggle_errors == 0


def test_a_node_is_asked_once_by_guarding(node: CanopenNode, slave: Slave, channel: Channel) -> None:
    assert guarding_answer(channel, node.nmt, 0.02) is None
    slave.answers_guarding, slave.nmt_state = True, 4
    assert guarding_answer(channel, node.nmt, 2.0) is NmtState.STOPPED
    assert not node.nmt.has_heartbeat


def test_a_node_that_restarts_again_and_again_is_reported_once_a_second_with_the_count(
    node: CanopenNode, fake: FakeBus
) -> None:
    heard = hear(fake, node, "05")
    events = NodeEvents(node.nmt)
    every = []
    events.subscribe(every.append)
    for look in range(250):  # a scan of 10 ms, and a state that changes in each
        hear(fake, node, "7f" if look % 2 == 0 else "05")
        events.look(heard + 0.01 * look)
    assert len([event for event in every if event.kind is not NodeEventKind.DUPLICATE]) == 250
    told = [event.kind.name for event in events.history]
    assert told.count("STATE") == told.count("OPERATIONAL") == 3
    assert told.count("DUPLICATE") == 1  # two devices that report in turn look the same
    assert sum(event.times for event in events.events) == 251
    assert "100 times" not in str(events.history[0])
    assert " times; " in str(events.history[-1])
    assert [event.stamp for event in events.events] == sorted(event.stamp for event in events.events)
