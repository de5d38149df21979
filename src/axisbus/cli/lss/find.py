"""``axisbus lss find``: find every slave without a node-ID."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from axisbus.cli.lss.common import NumberType, Where, as_numbers, lss_options, open_master, say_slave
from axisbus.cli.shared.common import OK, WRONG, say, say_json, say_next

if TYPE_CHECKING:
    from axisbus.cia305.scan_result import Scanned, Unconfigured


@click.command("find")
@lss_options
@click.option("--vendor", type=NumberType(32), help="Only this vendor-ID (spares 32 bits).")
@click.option("--product", type=NumberType(32), help="Only this product code.")
@click.option("--revision", type=NumberType(32), help="Only this revision number.")
@click.option("--serial", type=NumberType(32), help="Only this serial number.")
def command(
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
    whole = scanned.slaves and not scanned.incomplete
    return OK if whole and not any(each.twins for each in scanned.slaves) else WRONG


def _as_json(slave: Unconfigured) -> dict[str, object]:
    told = {"twins": slave.twins, "answers_on": slave.answers_on, "check": slave.check.name.lower()}
    return {**as_numbers(slave.address), **told, "node_id": slave.node_id if slave.has_node_id else None}


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
    bare = [each for each in scanned.slaves if not each.has_node_id]
    say(f"{len(bare)} without a node-ID:")
    for each in bare:
        _show_slave(each)
    configured = [each for each in scanned.slaves if each.has_node_id]
    for each in configured:
        _show_slave(each)
    _show_next(bare, where)


def _show_slave(slave: Unconfigured) -> None:
    own = f", has node-ID {slave.node_id} and answers fast scan nevertheless" if slave.has_node_id else ""
    say(f"  {say_slave(slave.address)}{own}")
    if slave.answers_on:
        say(
            "    continues to answer fast scan after it was found, against CiA 305: it was excluded by its address"
        )
        say(f"    address: {slave.check.sentence}")
    if slave.twins:
        say(
            "    several slaves have this same identity: connect one at a time, because LSS cannot distinguish them"
        )


def _show_next(bare: list[Unconfigured], where: Where) -> None:
    from axisbus.cia305.scan_result import Check

    able = [each for each in bare if each.check is not Check.UNSELECTABLE]
    if able:
        give = f"axisbus lss set-node-id NODE_ID {where.words_and_rate} -s {able[0].address} --store"
        say_next(f"give each a node-ID: {give}")
    elif bare:
        give = f"axisbus lss set-node-id NODE_ID {where.words_and_rate} --only --store"
        say_next(f"connect only this slave, and give it a node-ID: {give}")
