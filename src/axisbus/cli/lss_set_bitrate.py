"""``axisbus lss set-bitrate``: tell slaves another bit rate, and change over to it."""

from __future__ import annotations

import click

from axisbus.cli.common import OK, say, say_json, say_next
from axisbus.cli.lss_common import NumberType, Where, lss_options, open_master, slave_option

_WARNING = """\
A bus has one bit rate. A slave that changes over loses every node that does not, and you lose the slave until the adapter is set to
the new rate too: name every node of the bus. A node without LSS must be set by its switches or its own tool."""


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
    type=float,
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
    next. A change over is begun only when every slave named has answered. Needs --yes.
    """
    from axisbus.cia301.lss import LssAddress, bit_timing_index
    from axisbus.cia301.lss_master import require_delay

    bit_timing_index(rate)
    require_delay(delay)
    if bool(slave) == everybody:
        raise click.UsageError(
            "name the slaves by -s VENDOR PRODUCT REVISION SERIAL, once for each, or all with --all"
        )
    if not yes:
        raise click.UsageError(f"{_WARNING}\nIf that is so, say it with --yes.")
    addresses = None if everybody else [LssAddress(*each) for each in slave]
    with open_master(where) as master:
        master.set_bit_rate(addresses, rate, store=store)
        if activate:
            master.activate(addresses, delay)
    if as_json:
        say_json(
            {
                "bitrate": rate,
                "slaves": [list(each) for each in slave] or "all",
                "stored": store,
                "activated": activate,
            }
        )
        return OK
    _show(rate, where, store, activate)
    return OK


def _show(rate: int, where: Where, store: bool, activate: bool) -> None:
    say(f"told: {rate} bit/s{', stored' if store else ''}{', changed over' if activate else ''}")
    if activate:
        if not store:
            say("not stored: at the next power-up they are back at the old rate")
        say_next(f"{_adapter(where, rate)}axisbus scan {where.words} -b {rate}")
    elif store:
        say(
            "nothing has changed yet: the new rate holds from their next power-up; switch all of them off and on together"
        )
        say_next(f"{_adapter(where, rate)}axisbus scan {where.words} -b {rate}")
    else:
        say("nothing has changed yet, and at the next power-up they will have forgotten it")
        say_next("the same command with --activate, --store or both")


def _adapter(where: Where, rate: int) -> str:
    """Return the line that sets our own side, where the adapter cannot be told by -b."""
    if where.interface != "socketcan" or where.channel is None:
        return ""
    from axisbus.bus.socketcan import change_command

    return f"{change_command(where.channel, rate)}; "
