"""``axisbus lss set-node-id``: set the node-ID of a slave."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from axisbus.cli.lss.common import (
    NumberType,
    Where,
    as_numbers,
    choose,
    lss_options,
    open_master,
    require_one,
    say_slave,
    slave_options,
)
from axisbus.cli.shared.common import FAILURE, OK, say, say_json, say_next

if TYPE_CHECKING:
    from axisbus.bus.lss import NodeIdGiven


@click.command("set-node-id")
@click.argument("node_id", type=NumberType())
@lss_options
@slave_options
@click.option("--store", is_flag=True, help="Store it (otherwise it is lost at the next power-up).")
@click.option(
    "--reset",
    is_flag=True,
    help="Reset the communication of a slave that has a node-ID, or did not boot, so that it takes the new one.",
)
def command(
    node_id: int,
    where: Where,
    as_json: bool,
    slave: tuple[int, ...] | None,
    found: bool,
    only: bool,
    store: bool,
    reset: bool,
) -> int:
    """Give one LSS slave NODE_ID (1 to 127; 255 removes it), if no other node on the bus has it. Energises nothing.

    A slave without a node-ID uses the new one at once and boots. A slave with a node-ID takes the new one with a reset of its
    communication, which --reset sends: that stops the node. Some slaves without a node-ID need that reset, too. Exit code 3
    when the slave refuses, or does not boot under its new node-ID.
    """
    from axisbus.cia305.services import require_node_id

    require_one(slave, found, only)
    require_node_id(node_id)
    with open_master(where) as master:
        given = master.set_node_id(choose(master, slave, only), node_id, store=store, reset=reset)
    if as_json:
        done = given.set
        say_json(
            {
                **as_numbers(done.address),
                "old_node_id": done.old,
                "node_id": done.node_id,
                "stored": done.stored,
                "booted": given.booted,
            }
        )
    else:
        _show(given, where, reset)
    return FAILURE if given.booted is False else OK


def _show(given: NodeIdGiven, where: Where, reset: bool) -> None:
    done = given.set
    what = f"node-ID {done.node_id}" if done.node_id <= 127 else "no node-ID any more"
    say(f"{say_slave(done.address)}: {what}{', stored' if done.stored else ''}")
    if not done.stored:
        again = f"axisbus lss store {where.words_and_rate} -s {done.address}"
        say(f"not stored: it has the old one again after the next power-up (to store the new one: {again})")
    if given.booted:
        say(f"it booted as node {done.node_id}")
        say_next(f"axisbus scan {where.words_and_rate}")
    elif given.booted is False:
        say(
            f"it sent no boot-up message as node {done.node_id}; check with axisbus scan whether it is on the bus"
        )
        say(_without_boot(stored=done.stored, reset=reset))
    elif done.old is None:
        say(
            "it does not report its node-ID, so it was not reset: switch it off and on if the node-ID was stored, or reset "
            "the slave at the device"
        )
    elif not done.at_once and not reset:
        say("it takes effect when its communication is reset, or at the next power-up if stored")
        say_next("repeat the command with --reset, when the node may stop; or switch it off and on")


def _without_boot(*, stored: bool, reset: bool) -> str:
    """Return the next steps for a slave that did not boot under its new node-ID."""
    tried = (
        "a reset of its communication under this node-ID had no effect either"
        if reset
        else "repeat the command with --reset"
    )
    if stored:
        return f"some slaves need more: {tried}; or switch it off and on: the node-ID is stored"
    all_nodes = "axisbus nmt reset-communication all (it stops every node of the bus)"
    keeps = "do not switch it off, or the node-ID is lost (--store stores it)"
    return f"some slaves take it with a reset of their communication: {tried}, or {all_nodes}; {keeps}"
