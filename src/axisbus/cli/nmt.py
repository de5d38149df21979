"""``axisbus nmt``: NMT commands, confirmed by the subsequent state of the nodes."""

from __future__ import annotations

import time
from collections.abc import Sequence
from contextlib import ExitStack
from typing import TYPE_CHECKING

import click

from axisbus.cell.other_protocols import canopen_nodes
from axisbus.cia301.nmt import NmtCommand
from axisbus.cli.shared.attach_or_open import take_option
from axisbus.cli.shared.attached_nodes import attach_to_nodes
from axisbus.cli.shared.common import FAILURE, OK, say, say_json, say_next
from axisbus.cli.shared.completion import complete_nodes_or_all
from axisbus.cli.shared.nodes import NodeOptions, NodeSession, node_options
from axisbus.errors import NodeTimeout, StateError
from axisbus.machine.machine_node import MachineNode

if TYPE_CHECKING:
    from axisbus.bus.node.nmt_commands import NodeReaction
    from axisbus.bus.node.node import CanopenNode

COMMANDS = {
    "start": NmtCommand.START,
    "stop": NmtCommand.STOP,
    "pre-operational": NmtCommand.ENTER_PRE_OPERATIONAL,
    "reset-node": NmtCommand.RESET_NODE,
    "reset-communication": NmtCommand.RESET_COMMUNICATION,
}
ALL = "all"
_COMMAND_TIMEOUT = 5.0  # seconds that a node of a running machine may take; a restart takes longest


@click.command("nmt")
@click.argument("wanted", metavar="COMMAND", type=click.Choice(list(COMMANDS)))
@click.argument("who", metavar="NODE...|all", nargs=-1, required=True, shell_complete=complete_nodes_or_all)
@node_options
@click.option(
    "--force",
    is_flag=True,
    help="Send the command even if a drive is energised: it may coast, or drop its load.",
)
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
@take_option
def command(
    wanted: str, who: tuple[str, ...], options: NodeOptions, force: bool, as_json: bool, take: bool
) -> int:
    """Send the NMT command start, stop, pre-operational, reset-node or reset-communication to nodes, and show the reaction of
    each.

    NODE is a node ID or an axis of --cell; "all" sends one command to all nodes, and checks the nodes of the cell, or without
    --cell the nodes that a scan finds. Starting energises nothing. The other commands cut a drive off from the bus: if a drive
    is energised, they are refused without --force. A node confirms by its heartbeat, by node guarding (never if that would arm
    its life guarding), by its boot-up message, or by its SDO server. Exit code 3 when a node does not confirm.

    If the machine of --cell is running, its core sends the command; the core loses the axes of a node that leaves operational.
    """
    from axisbus.bus.node import nmt_commands

    files = options.files()
    if ALL in who and len(who) > 1:
        raise click.UsageError('"all" excludes node names')
    to_all = who == (ALL,)
    ids = [] if to_all else list(dict.fromkeys(files.address(each).node_id for each in who))
    order = COMMANDS[wanted]
    with ExitStack() as stack:
        machine = attach_to_nodes(stack, options, command=True, take=take)
        if machine is not None:
            node_ids = ids or canopen_nodes(machine.machine.cell)
            return _report(_in_machine([machine.node(each) for each in node_ids], order, force), as_json)
        known = canopen_nodes(files.cell) if to_all and files.cell is not None else ids
        session = NodeSession(stack, options, files, known)
        nodes = [session.node(node_id) for node_id in known or _found_nodes(session)]
        found = nmt_commands.confirmations(nodes)
        if order is not NmtCommand.START and not force:
            _require_at_rest(nodes)
        outcomes = nmt_commands.command(session.bus, nodes, order, found, to_all=to_all)
        errors = {each.node_id: _errors(session.node(each.node_id)) for each in outcomes if each.disobeyed}
    failed = [each for each in outcomes if not each.ok]
    if as_json:
        say_json([{**_plain(each), "errors": errors.get(each.node_id)} for each in outcomes])
        return FAILURE if failed else OK
    for each in outcomes:
        say(f"node {each.node_id}: {each.text}")
        if each.node_id in errors:
            say(f"  {errors[each.node_id]}")
    _next(order, outcomes, failed)
    return FAILURE if failed else OK


def _in_machine(nodes: list[MachineNode], order: NmtCommand, force: bool) -> list[dict[str, object]]:
    if order is not NmtCommand.START and not force:
        _require_at_rest(nodes)
    return [_one_in_machine(each, order) for each in nodes]


def _one_in_machine(node: MachineNode, order: NmtCommand) -> dict[str, object]:
    before, begin, error = node.access.nmt, time.monotonic(), ""
    try:
        node.access.command(order, _COMMAND_TIMEOUT)
    except NodeTimeout as failure:
        error = f"{failure.message}; {failure.observed}"
    return {
        "node": node.node_id,
        "ok": not error,
        "before": before.text,
        "state": node.access.nmt.text,
        "seconds": round(time.monotonic() - begin, 3),
        "errors": error or None,
    }


def _report(outcomes: list[dict[str, object]], as_json: bool) -> int:
    if as_json:
        say_json(outcomes)
    for each in [] if as_json else outcomes:
        what = each["errors"] or f"{each['state']} (was {each['before']})"
        say(f"node {each['node']}: {what}")
    return OK if all(each["ok"] for each in outcomes) else FAILURE


def _found_nodes(session: NodeSession) -> list[int]:
    from axisbus.bus.node.discover import scan

    found = [each.node_id for each in scan(session.bus)]
    if not found:
        raise NodeTimeout(
            "no node answers on this bus; nothing was sent",
            node=0,
            remedy="check supply, cable, termination and bit rate",
        )
    return found


def _require_at_rest(nodes: Sequence[CanopenNode | MachineNode]) -> None:
    """Refuse if a drive is energised; ignore a node that does not answer SDO: the command may be meant to recover it."""
    from axisbus.configuration.guarded_write import energised

    for node in nodes:
        found = energised(node) if node.answers_sdo() else []
        if found:
            raise StateError(
                f"node {node.node_id} is energised; nothing was sent",
                observed="; ".join(found),
                remedy="stop it first (axisbus stop CELL), or add --force: it may coast, or drop its load",
            )


def _errors(node: CanopenNode) -> str:
    """Return the errors of a node that is present and does not follow the command."""
    from axisbus.boot import error_state

    last = node.emcy.history[-1] if node.emcy.history else None
    return error_state.read(node.sdo, last, 0.0 if last is None else time.monotonic() - last.stamp).words()


def _plain(outcome: NodeReaction) -> dict[str, object]:
    before, state = outcome.confirmation.before, outcome.state
    return {
        "node": outcome.node_id,
        "ok": outcome.ok,
        "before": None if before is None else before.text,
        "state": None if state is None else state.text,
        "silent": outcome.silent,
        "confirmed_by": outcome.confirmation.by.name.lower() if outcome.ok else None,
        "seconds": round(outcome.seconds, 3),
    }


def _next(order: NmtCommand, outcomes: list[NodeReaction], failed: list[NodeReaction]) -> None:
    if any(each.silent for each in failed):
        say_next(
            "check the supply, cable, node ID and bit rate of the silent nodes; to list the nodes: axisbus scan"
        )
    elif failed:
        say_next("to list the nodes and their states: axisbus scan")
    elif order is NmtCommand.START:
        say_next("this energises nothing; to see the frames of the nodes: axisbus trace")
    else:
        first = outcomes[0].node_id
        say_next(f"axisbus nmt start {first} ..., or boot the cell: axisbus boot CELL")
