"""``axisbus lss set-bitrate``: set another bit rate in slaves, and activate it."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import click

from axisbus.cli.lss.common import Where, lss_options, open_master, slave_option
from axisbus.cli.shared.buses import opening_of
from axisbus.cli.shared.common import FAILURE, OK, say, say_error, say_json, say_next
from axisbus.cli.shared.options import NumberType, Seconds

if TYPE_CHECKING:
    from axisbus.bus.link.bitrate_change import ChangedOver
    from axisbus.bus.lss import LssMaster
    from axisbus.cia305.services import LssAddress

_WARNING = """\
A bus has one bit rate. A slave that changes over loses every node that does not: name every node of the bus.
A node without LSS must be set by its switches or its own tool."""


@click.command("set-bitrate")
@click.argument("rate", type=NumberType())
@lss_options
@slave_option(multiple=True)
@click.option(
    "--all",
    "everybody",
    is_flag=True,
    help="Address all LSS slaves at once (the master may not detect a refusal).",
)
@click.option(
    "--activate",
    is_flag=True,
    help="Switch all slaves to the new rate now (otherwise at the next power-up, if it is stored).",
)
@click.option(
    "--delay",
    type=Seconds(0.01),
    default=1.0,
    show_default=True,
    metavar="SECONDS",
    help="Silence before and after the change-over, 0.01 to 65 seconds.",
)
@click.option("--store", is_flag=True, help="Store the new bit rate.")
@click.option("--yes", is_flag=True, help="Confirm that you know how the change affects the other nodes.")
def command(
    rate: int,
    where: Where,
    as_json: bool,
    slave: tuple[tuple[int, ...], ...],
    everybody: bool,
    activate: bool,
    delay: float,
    store: bool,
    yes: bool,
) -> int:
    """Set the bit rate of LSS slaves to RATE (bit/s), and with --activate change over to it.

    Nothing changes on the bus without --activate; with --store alone the slaves use the new rate after their next power-up. The
    change-over begins only when every named slave has answered. The adapter of this computer is then opened again at the new
    rate, and the command checks that the slaves answer. If the system sets the adapter's rate (SocketCAN), the command prints
    the lines to type. Needs --yes. Exit code 3 when a slave does not answer at the new rate.
    """
    from axisbus.cia305.master import require_delay
    from axisbus.cia305.services import LssAddress, bit_timing_index

    bit_timing_index(rate)
    require_delay(delay)
    if bool(slave) == everybody:
        raise click.UsageError(
            "name the slaves by -s VENDOR PRODUCT REVISION SERIAL, once for each, or all with --all"
        )
    if not yes:
        raise click.UsageError(f"{_WARNING}\nTo confirm that, give --yes.")
    addresses = None if everybody else [LssAddress(*each) for each in slave]
    outcome = None
    with open_master(where) as master:
        master.set_bit_rate(addresses, rate, store=store)
        if activate:
            outcome = _change(master, addresses, rate, delay, where)
    if as_json:
        facts = {"bitrate": rate, "slaves": [list(each) for each in slave] or "all", "stored": store}
        say_json({**facts, "activated": activate, **({} if outcome is None else _as_json(outcome))})
    elif outcome is None:
        _show_activated(rate, where, store)
    else:
        _show_changed(outcome, where, store)
    return FAILURE if outcome is not None and outcome.asked and not outcome.complete else OK


def _change(
    master: LssMaster, addresses: list[LssAddress] | None, rate: int, delay: float, where: Where
) -> ChangedOver:
    from axisbus.bus.link.bitrate_change import change_over

    opening = opening_of(*where.bus)
    try:
        with ExitStack() as stack:
            return change_over(master, addresses, rate, delay, opening, stack)
    except KeyboardInterrupt:
        say_error(
            f"the slaves may nevertheless be changing over to {rate} bit/s: check with axisbus scan {where.words} -b {rate}"
        )
        raise


def _as_json(outcome: ChangedOver) -> dict[str, Any]:
    return {
        "adapter": outcome.adapter.name.lower(),
        "asked": outcome.asked,
        "answered": [list(each.parts) for each in outcome.answered],
        "silent": [list(each.parts) for each in outcome.silent],
        "nodes": list(outcome.nodes),
        "commands": list(outcome.commands),
    }


def _show_activated(rate: int, where: Where, store: bool) -> None:
    say(f"set: {rate} bit/s{', stored' if store else ''}")
    if not store:
        say("nothing has changed yet, and the new rate is lost at the next power-up")
        say_next("repeat the command with --activate, --store or both")
        return
    say(
        "nothing has changed yet: the new rate applies from their next power-up; switch all of them off and on together"
    )
    say_next(f"{_adapter(where, rate)}axisbus scan {where.words} -b {rate}")


def _show_changed(outcome: ChangedOver, where: Where, store: bool) -> None:
    say(
        f"set: {outcome.bitrate} bit/s{', stored' if store else ''}, changed over; "
        f"the adapter of this computer {outcome.adapter.value}"
    )
    if not store:
        say("not stored: after the next power-up they have the old rate again")
    scan = f"axisbus scan {where.words} -b {outcome.bitrate}"
    if not outcome.asked:
        say(
            "THE BUS IS HALF CHANGED OVER: this computer still has the old rate, and would destroy the slaves' frames"
        )
        say(
            "type, in this order:"
            if outcome.commands
            else "set the rate of this master's adapter: on the computer of the link, or with the option timing of the adapter"
        )
        for line in outcome.commands:
            say(f"  {line}")
        say_next(scan)
        return
    for each in outcome.answered:
        say(f"  answers at {outcome.bitrate} bit/s: {each}")
    for each in outcome.silent:
        say(f"  DOES NOT ANSWER at {outcome.bitrate} bit/s: {each}")
    if outcome.nodes:
        say(f"  answer at {outcome.bitrate} bit/s: node {', '.join(map(str, outcome.nodes))}")
    if outcome.others:
        say(f"  a slave without a node-ID answers at {outcome.bitrate} bit/s")
    if not outcome.complete:
        say(
            "THE BUS IS HALF CHANGED OVER: switch the silent slaves off and on (they then have the old rate, unless the new "
            "one was stored)"
        )
    say_next(scan)


def _adapter(where: Where, rate: int) -> str:
    """Return the command that sets the bit rate of the local adapter, if -b cannot set it."""
    if where.bus.interface != "socketcan" or where.bus.channel is None:
        return ""
    from axisbus.bus.link.socketcan import change_command

    return f"{change_command(where.bus.channel, rate)}; "
