"""``axisbus lss find``: every slave without a node-ID."""

from __future__ import annotations

from typing import TYPE_CHECKING

import click

from axisbus.cli.common import OK, WRONG, say, say_json, say_next
from axisbus.cli.lss_common import NumberType, Where, as_numbers, lss_options, open_master, say_slave

if TYPE_CHECKING:
    from axisbus.cia301.lss_scan import Scanned


@click.command("find")
@lss_options
@click.option("--vendor", type=NumberType(), help="Only this vendor-ID (spares 32 bits).")
@click.option("--product", type=NumberType(), help="Only this product code.")
@click.option("--revision", type=NumberType(), help="Only this revision number.")
@click.option("--serial", type=NumberType(), help="Only this serial number.")
def command(
    where: Where,
    as_json: bool,
    vendor: int | None,
    product: int | None,
    revision: int | None,
    serial: int | None,
) -> int:
    """Find every LSS slave without a node-ID by fast scan: on the bus of CELL (a cell.toml), or with -i and -c on any.

    Takes 1 to 2 s for the first slave. Changes nothing; refused while a machine is running. Slaves with a node-ID do not take part:
    see axisbus scan. Exit code 1 when there is none, or when two have the same identity.
    """
    from axisbus.cia301.lss_scan import Known

    with open_master(where) as master:
        scanned = master.find(Known(vendor, product, revision, serial))
    if as_json:
        slaves = [{**as_numbers(each.address), "twins": each.twins} for each in scanned.slaves]
        say_json({"slaves": slaves, "others": scanned.others})
    else:
        _show(scanned, where)
    return OK if scanned.slaves and not any(each.twins for each in scanned.slaves) else WRONG


def _show(scanned: Scanned, where: Where) -> None:
    if scanned.others:
        say("other slaves without a node-ID are there that are not as asked for")
    if not scanned.slaves:
        say(
            "no LSS slave without a node-ID answers: they have one, have no LSS fast scan, or another bit rate"
        )
        say_next(f"see who has a node-ID: axisbus scan {where.words_and_rate}")
        return
    say(f"{len(scanned.slaves)} without a node-ID:")
    for each in scanned.slaves:
        say(f"  {say_slave(each.address)}")
        if each.twins:
            say(
                "    several slaves have this same identity: connect one at a time, LSS cannot tell them apart"
            )
    first = scanned.slaves[0].address
    say_next(
        f"give each a node-ID: axisbus lss set-node-id NODE_ID {where.words_and_rate} -s {first} --store"
    )
