"""``axisbus lss set-bitrate``: set another bit rate in slaves, and activate it."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING, Any

import click

from axisbus.cli.lss.common import NumberType, Where, lss_options, open_master, slave_option
from axisbus.cli.shared.buses import opening_of
from axisbus.cli.shared.common import FAILURE, OK, say, say_error, say_json, say_next
from axisbus.cli.shared.numbers import Seconds

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
    "--all", "everybody", is_flag=True, help="Every LSS slave at once (one that refuses may go unheard)."
)
@click.option(
    "--activate", is_flag=True, help="Change over now, all together (else at the next power-up, if stored)."
)
@click.option(
    "--delay",
    type=Seconds(0.01),
    default=1.0,
    show_default=True,
    metavar="SECONDS",
    help="Silence before and after the change-over, 0.01 to 65.",
)
@click.option("--store", is_flag=True, help="Keep it without power.")
@click.option("--yes", is_flag=True, help="I know what a bit rate does to the other nodes.")
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
    """Tell LSS slaves the bit rate RATE (bit/s), and with --activate change over to it.

    Nothing changes on the bus without --activate; with --store alone the slaves come up at the new rate when they are switched on
    next. A change over is begun only when every slave named has answered. Our own adapter is then opened again at the new rate, and
    the slaves are asked at it; where the rate is the system's (SocketCAN), the lines to type are printed. Needs --yes. Exit code 3
    when a slave does not answer at the new rate.
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
        raise click.UsageError(f"{_WARNING}\nIf that is so, say it with --yes.")
    addresses = None if everybody else [LssAddress(*each) for each in slave]
    done = None
    with open_master(where) as master:
        master.set_bit_rate(addresses, rate, store=store)
        if activate:
            done = _change_over(master, addresses, rate, delay, where)
    if as_json:
        told = {"bitrate": rate, "slaves": [list(each) for each in slave] or "all", "stored": store}
        say_json({**told, "activated": activate, **({} if done is None else _as_json(done))})
    elif done is None:
        _show_told(rate, where, store)
    else:
        _show_changed(done, where, store)
    return FAILURE if done is not None and done.asked and not done.complete else OK


def _change_over(
    master: LssMaster, addresses: list[LssAddress] | None, rate: int, delay: float, where: Where
) -> ChangedOver:
    from axisbus.bus.link.bitrate_change import change_over

    opening = opening_of(*where.bus)
    try:
        with ExitStack() as stack:
            return change_over(master, addresses, rate, delay, opening, stack)
    except KeyboardInterrupt:
        say_error(
            f"the slaves may be changing over to {rate} bit/s all the same: look with axisbus scan {where.words} -b {rate}"
        )
        raise


def _as_json(done: ChangedOver) -> dict[str, Any]:
    return {
        "adapter": done.adapter.name.lower(),
        "asked": done.asked,
        "answered": [list(each.parts) for each in done.answered],
        "silent": [list(each.parts) for each in done.silent],
        "nodes": list(done.nodes),
        "commands": list(done.commands),
    }


def _show_told(rate: int, where: Where, store: bool) -> None:
    say(f"told: {rate} bit/s{', stored' if store else ''}")
    if not store:
        say("nothing has changed yet, and at the next power-up they will have forgotten it")
        say_next("the same command with --activate, --store or both")
        return
    say(
        "nothing has changed yet: the new rate holds from their next power-up; switch all of them off and on together"
    )
    say_next(f"{_adapter(where, rate)}axisbus scan {where.words} -b {rate}")


def _show_changed(done: ChangedOver, where: Where, store: bool) -> None:
    say(
        f"told: {done.bitrate} bit/s{', stored' if store else ''}, changed over; our adapter {done.adapter.value}"
    )
    if not store:
        say("not stored: at the next power-up they are back at the old rate")
    scan = f"axisbus scan {where.words} -b {done.bitrate}"
    if not done.asked:
        say(
            "THE BUS IS HALF CHANGED OVER: this computer still has the old rate, and would destroy the slaves' frames"
        )
        say(
            "type, in this order:"
            if done.commands
            else "set our own rate where it is set: on the computer that the link belongs to, or by timing among the options"
        )
        for line in done.commands:
            say(f"  {line}")
        say_next(scan)
        return
    for each in done.answered:
        say(f"  answers at {done.bitrate} bit/s: {each}")
    for each in done.silent:
        say(f"  DOES NOT ANSWER at {done.bitrate} bit/s: {each}")
    if done.nodes:
        say(f"  answer at {done.bitrate} bit/s: node {', '.join(map(str, done.nodes))}")
    if done.others:
        say(f"  a slave without a node-ID answers at {done.bitrate} bit/s")
    if not done.complete:
        say(
            "THE BUS IS HALF CHANGED OVER: switch the silent ones off and on (the old rate holds then, where it was not stored)"
        )
    say_next(scan)


def _adapter(where: Where, rate: int) -> str:
    """Return the command that sets the bit rate of the local adapter, if -b cannot set it."""
    if where.interface != "socketcan" or where.channel is None:
        return ""
    from axisbus.bus.link.socketcan import change_command

    return f"{change_command(where.channel, rate)}; "
