"""NMT commands from the command line: the confirmation of each node, and forbidden requests. The slave is typed from CiA 301."""

from __future__ import annotations

import pytest

from axisbus.bus.link.channel import Channel
from axisbus.bus.node import nmt_commands
from axisbus.bus.node.nmt import Confirmation
from axisbus.bus.node.node import CanopenNode
from axisbus.cia301.nmt import NmtCommand, NmtState

U16 = 2


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(nmt_commands, "LISTEN", 0.1)
    monkeypatch.setattr(nmt_commands, "PATIENCE", 0.6)
    monkeypatch.setattr(nmt_commands, "BOOT_PATIENCE", 0.6)


def give(channel: Channel, node: CanopenNode, command: NmtCommand) -> nmt_commands.Outcome:
    confirmations = nmt_commands.confirmations([node])
    return nmt_commands.command(channel, [node], command, confirmations, to_all=False)[0]


def test_guarding_confirms_if_life_guarding_is_off(fake, channel, slave, node):
    slave.answers_guarding = True
    outcome = give(channel, node, NmtCommand.START)
    assert (outcome.ok, outcome.confirmation.by, outcome.state) == (
        True,
        Confirmation.GUARDING,
        NmtState.OPERATIONAL,
    )
    assert slave.commands == [1]


def test_life_guarding_is_never_armed_by_asking(fake, channel, slave, node):
    slave.answers_guarding = True
    slave.objects[0x100C, 0] = (100).to_bytes(U16, "little")
    slave.objects[0x100D, 0] = b"\3"
    outcome = give(channel, node, NmtCommand.START)
    assert (outcome.ok, outcome.confirmation.by) == (True, Confirmation.SDO)
    assert fake.remote == []


def test_a_node_that_answers_no_remote_frame_is_seen_by_its_sdo_server(channel, slave, node):
    started = give(channel, node, NmtCommand.START)
    assert (started.ok, started.confirmation.by) == (True, Confirmation.SDO)
    stopped = give(channel, node, NmtCommand.STOP)
    assert (stopped.ok, stopped.state) == (True, NmtState.STOPPED)


def test_a_heartbeat_confirms_and_reports_the_state_before(fake, channel, slave, node):
    fake.inject(0x705, "7F")
    slave.objects[0x1017, 0] = (100).to_bytes(U16, "little")
    confirmations = nmt_commands.confirmations([node])
    assert confirmations[5] == nmt_commands.NmtConfirmation(
        Confirmation.HEARTBEAT, NmtState.PRE_OPERATIONAL, 0.1
    )
    fake.peers.append(lambda can_id, *_: [(0x705, b"\5")] if can_id == 0 else [])
    outcome = nmt_commands.command(channel, [node], NmtCommand.START, confirmations, to_all=False)[0]
    assert outcome.text.startswith("operational (was pre-operational), confirmed by its heartbeat")


def test_a_heartbeat_of_the_old_state_confirms_nothing(fake, channel, slave, node):
    fake.inject(0x705, "7F")
    confirmations = nmt_commands.confirmations([node])
    fake.peers.append(lambda can_id, *_: [(0x705, b"\x7f")] if can_id == 0 else [])
    outcome = nmt_commands.command(channel, [node], NmtCommand.START, confirmations, to_all=False)[0]
    assert not outcome.ok
    assert "it still reports pre-operational" in outcome.text


def test_a_reset_needs_a_boot_up_message_after_the_command(fake, channel, slave, node):
    fake.inject(0x705, "00")
    outcome = give(channel, node, NmtCommand.RESET_COMMUNICATION)
    assert (outcome.ok, outcome.confirmation.by) == (True, Confirmation.BOOT_UP)
    fake.peers.clear()
    assert not give(channel, node, NmtCommand.RESET_NODE).ok


def test_a_node_that_shows_nothing_is_an_outcome(fake, channel):
    with CanopenNode(channel, 9) as silent:
        outcome = give(channel, silent, NmtCommand.START)
    assert (outcome.ok, outcome.state) == (False, None)
    assert outcome.silent
    assert outcome.text.startswith("SILENT: nothing came from it in ")


def test_one_command_to_all_nodes_is_one_frame(fake, channel, slave, node):
    confirmations = nmt_commands.confirmations([node])
    nmt_commands.command(channel, [node], NmtCommand.START, confirmations, to_all=True)
    assert fake.frames(0) == [b"\1\0"]
