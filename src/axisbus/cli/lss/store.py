"""``axisbus lss store``: store node-ID and bit rate in a slave's non-volatile memory."""

from __future__ import annotations

import click

from axisbus.cli.lss.common import (
    Where,
    as_numbers,
    choose,
    lss_options,
    open_master,
    require_one,
    slave_options,
)
from axisbus.cli.shared.common import OK, say, say_json, say_next


@click.command("store")
@lss_options
@slave_options
def command(where: Where, as_json: bool, slave: tuple[int, ...] | None, found: bool, only: bool) -> int:
    """Have one LSS slave store its node-ID and bit rate. Exit code 3 when it cannot."""
    require_one(slave, found, only)
    with open_master(where) as master:
        address = choose(master, slave, only)
        master.store(address)
    if as_json:
        say_json({"stored": True, **({} if address is None else as_numbers(address))})
        return OK
    say("stored: node-ID and bit rate survive a power-off")
    say_next(f"axisbus scan {where.words_and_rate}")
    return OK
