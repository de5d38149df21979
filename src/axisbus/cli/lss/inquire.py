"""``axisbus lss inquire``: show a slave's identity and node-ID."""

from __future__ import annotations

import click

from axisbus.cli.lss.common import (
    Where,
    as_numbers,
    choose,
    lss_options,
    open_master,
    require_one,
    say_slave,
    slave_options,
)
from axisbus.cli.shared.common import OK, say, say_json, say_next


@click.command("inquire")
@lss_options
@slave_options
def command(where: Where, as_json: bool, slave: tuple[int, ...] | None, found: bool, only: bool) -> int:
    """Show the identity and the node-ID of one LSS slave; changes nothing."""
    require_one(slave, found, only)
    with open_master(where) as master:
        told = master.inquire(choose(master, slave, only))
    node_id = told.node_id if told.configured else None
    if as_json:
        say_json({**as_numbers(told.address), "node_id": node_id, "tells_node_id": told.node_id is not None})
        return OK
    say(say_slave(told.address))
    if told.configured:
        say(f"node-ID {told.node_id}")
        say_next(
            f"to change it: axisbus lss set-node-id NODE_ID {where.words_and_rate} -s {told.address} --store --reset"
        )
        return OK
    say("no node-ID" if told.node_id is not None else "does not report its node-ID")
    say_next(f"give it one: axisbus lss set-node-id NODE_ID {where.words_and_rate} -s {told.address} --store")
    return OK
