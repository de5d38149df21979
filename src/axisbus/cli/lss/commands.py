"""The commands ``axisbus lss find``, ``inquire``, ``set-node-id`` and ``store``."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from axisbus.cli.lss.common import (
    SlaveChoice,
    Where,
    as_numbers,
    lss_options,
    open_master,
    say_slave,
    slave_options,
)
from axisbus.cli.shared.common import FAILURE, OK, WRONG, say, say_json, say_next
from axisbus.cli.shared.options import NumberType

if TYPE_CHECKING:
    from axisbus.bus.lss import NodeIdGiven
    from axisbus.cia305.scan_result import Scanned, Unconfigured


# -- ``axisbus lss find``: find every slave without a node-ID ----------------------------------------------------------


@click.command("find")
@lss_options
@click.option("--vendor", type=NumberType(32), help="Only this vendor-ID (saves 32 bits of the search).")
@click.option("--product", type=NumberType(32), help="Only this product code.")
@click.option("--revision", type=NumberType(32), help="Only this revision number.")
@click.option("--serial", type=NumberType(32), help="Only this serial number.")
def find_command(
    where: Where,
    as_json: bool,
    vendor: int | None,
    product: int | None,
    revision: int | None,
    serial: int | None,
) -> int:
    """Find every LSS slave without a node-ID by fast scan: on the bus of CELL (a cell.toml), or with -i and -c on any bus.

    Takes 1 to 2 s for the first slave. It takes some seconds more if slaves continue to answer after they were found (against
    CiA 305): each of these is checked and excluded by its address, and the search continues. Changes nothing; refused while a
    machine is running. Slaves with a node-ID do not take part: see axisbus scan. Exit code 1 when no slave is found, when two
    have the same identity, or when the search could not be completed.
    """
    from axisbus.cia305.scan_result import KnownIdentity

    known = KnownIdentity(vendor, product, revision, serial)
    with open_master(where) as master:
        scanned = master.find(known)
    if as_json:
        slaves = [_as_json(each) for each in scanned.slaves]
        say_json({"slaves": slaves, "others": scanned.others, "incomplete": scanned.incomplete or None})
    else:
        _show(scanned, where)
    complete = scanned.slaves and not scanned.incomplete
    return OK if complete and not any(each.twins for each in scanned.slaves) else WRONG


def _as_json(slave: Unconfigured) -> dict[str, object]:
    facts = {"twins": slave.twins, "answers_on": slave.answers_on, "check": slave.check.name.lower()}
    return {**as_numbers(slave.address), **facts, "node_id": slave.node_id if slave.has_node_id else None}


def _show(scanned: Scanned, where: Where) -> None:
    if scanned.others:
        say("there are other slaves without a node-ID, which do not match the given identity")
    if scanned.incomplete:
        say(f"NOT ALL MAY HAVE BEEN FOUND: {scanned.incomplete}")
    if not scanned.slaves:
        if not scanned.incomplete:
            say(
                "no LSS slave without a node-ID answers: they have a node-ID, no LSS fast scan, or another bit rate"
            )
        say_next(f"to list nodes with a node-ID: axisbus scan {where.words_and_rate}")
        return
    without_id = [each for each in scanned.slaves if not each.has_node_id]
    say(f"{len(without_id)} without a node-ID:")
    for each in without_id:
        _show_slave(each)
    configured = [each for each in scanned.slaves if each.has_node_id]
    for each in configured:
        _show_slave(each)
    _show_next(without_id, where)


def _show_slave(slave: Unconfigured) -> None:
    note = f", has node-ID {slave.node_id} and answers fast scan nevertheless" if slave.has_node_id else ""
    say(f"  {say_slave(slave.address)}{note}")
    if slave.answers_on:
        say(
            "    continues to answer fast scan after it was found, against CiA 305: it was excluded by its address"
        )
        say(f"    address: {slave.check.sentence}")
    if slave.twins:
        say(
            "    several slaves have this same identity: connect one at a time, because LSS cannot distinguish them"
        )


def _show_next(without_id: list[Unconfigured], where: Where) -> None:
    from axisbus.cia305.scan_result import Check

    able = [each for each in without_id if each.check is not Check.UNSELECTABLE]
    if able:
        next_command = f"axisbus lss set-node-id NODE_ID {where.words_and_rate} -s {able[0].address} --store"
        say_next(f"give each a node-ID: {next_command}")
    elif without_id:
        next_command = f"axisbus lss set-node-id NODE_ID {where.words_and_rate} --only --store"
        say_next(f"connect only this slave, and give it a node-ID: {next_command}")


# -- ``axisbus lss inquire``: show a slave's identity and node-ID ------------------------------------------------------


@click.command("inquire")
@lss_options
@slave_options
def inquire_command(where: Where, as_json: bool, choice: SlaveChoice) -> int:
    """Show the identity and the node-ID of one LSS slave; changes nothing."""
    choice.require_one()
    with open_master(where) as master:
        facts = master.inquire(choice.address(master))
    node_id = facts.node_id if facts.configured else None
    if as_json:
        say_json(
            {**as_numbers(facts.address), "node_id": node_id, "tells_node_id": facts.node_id is not None}
        )
        return OK
    say(say_slave(facts.address))
    if facts.configured:
        say(f"node-ID {facts.node_id}")
        say_next(
            f"to change it: axisbus lss set-node-id NODE_ID {where.words_and_rate} -s {facts.address} --store --reset"
        )
        return OK
    say("no node-ID" if facts.node_id is not None else "does not report its node-ID")
    say_next(
        f"give it one: axisbus lss set-node-id NODE_ID {where.words_and_rate} -s {facts.address} --store"
    )
    return OK


# -- ``axisbus lss set-node-id``: set the node-ID of a slave -----------------------------------------------------------


@click.command("set-node-id")
@click.argument("node_id", type=NumberType())
@lss_options
@slave_options
@click.option("--store", is_flag=True, help="Store the node-ID (otherwise it is lost at the next power-up).")
@click.option(
    "--reset",
    is_flag=True,
    help="If the slave has a node-ID, or does not boot, reset its communication, so that it uses the new one.",
)
def set_node_id_command(
    node_id: int,
    where: Where,
    as_json: bool,
    choice: SlaveChoice,
    store: bool,
    reset: bool,
) -> int:
    """Give one LSS slave NODE_ID (1 to 127; 255 removes it), if no other node on the bus has it. Energises nothing.

    A slave without a node-ID uses the new one at once and boots. A slave with a node-ID takes the new one with a reset of its
    communication, which --reset sends: that stops the node. Some slaves without a node-ID need that reset, too. Exit code 3
    when the slave refuses, or does not boot under its new node-ID.
    """
    from axisbus.cia305.services import require_node_id

    choice.require_one()
    require_node_id(node_id)
    with open_master(where) as master:
        given = master.set_node_id(choice.address(master), node_id, store=store, reset=reset)
    if as_json:
        result = given.set
        say_json(
            {
                **as_numbers(result.address),
                "old_node_id": result.old,
                "node_id": result.node_id,
                "stored": result.stored,
                "booted": given.booted,
            }
        )
    else:
        _set_node_id_show(given, where, reset)
    return FAILURE if given.booted is False else OK


def _set_node_id_show(given: NodeIdGiven, where: Where, reset: bool) -> None:
    result = given.set
    what = f"node-ID {result.node_id}" if result.node_id <= 127 else "no node-ID any more"
    say(f"{say_slave(result.address)}: {what}{', stored' if result.stored else ''}")
    if not result.stored:
        next_command = f"axisbus lss store {where.words_and_rate} -s {result.address}"
        say(
            f"not stored: it has the old one again after the next power-up (to store the new one: {next_command})"
        )
    if given.booted:
        say(f"it booted as node {result.node_id}")
        say_next(f"axisbus scan {where.words_and_rate}")
    elif given.booted is False:
        say(
            f"it sent no boot-up message as node {result.node_id}; check with axisbus scan whether it is on the bus"
        )
        say(_why_no_boot(stored=result.stored, reset=reset))
    elif result.old is None:
        say(
            "it does not report its node-ID, so it was not reset: switch it off and on if the node-ID was stored, or reset "
            "the slave at the device"
        )
    elif not result.at_once and not reset:
        say("it takes effect when its communication is reset, or at the next power-up if stored")
        say_next("repeat the command with --reset, when the node may stop; or switch it off and on")


def _why_no_boot(*, stored: bool, reset: bool) -> str:
    """Return the next steps for a slave that did not boot under its new node-ID."""
    resets = (
        "a reset of its communication under this node-ID had no effect either"
        if reset
        else "repeat the command with --reset"
    )
    if stored:
        return f"some slaves need more: {resets}; or switch it off and on: the node-ID is stored"
    all_nodes = "axisbus nmt reset-communication all (it stops every node of the bus)"
    warning = "do not switch it off, or the node-ID is lost (--store stores it)"
    return f"some slaves take it with a reset of their communication: {resets}, or {all_nodes}; {warning}"


# -- ``axisbus lss store``: store node-ID and bit rate in a slave's non-volatile memory --------------------------------


@click.command("store")
@lss_options
@slave_options
def store_command(where: Where, as_json: bool, choice: SlaveChoice) -> int:
    """Have one LSS slave store its node-ID and bit rate. Exit code 3 when it cannot."""
    choice.require_one()
    with open_master(where) as master:
        address = choice.address(master)
        master.store(address)
    if as_json:
        say_json({"stored": True, **({} if address is None else as_numbers(address))})
        return OK
    say("stored: node-ID and bit rate survive a power-off")
    say_next(f"axisbus scan {where.words_and_rate}")
    return OK
