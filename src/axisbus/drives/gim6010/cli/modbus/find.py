"""``axisbus gim6010 modbus find``: find the modules on an RS485 line."""

from __future__ import annotations

import sys
from dataclasses import replace

import click

from axisbus.cli.shared.common import FAILURE, OK, WRONG, say, say_error, say_next
from axisbus.drives.gim6010.cli.modbus.target_module import ModbusTarget, parity_option, port_option
from axisbus.drives.gim6010.modbus.registers import HIGHEST_DEVICE, RATES
from axisbus.wording import counted

_USUAL = 63
_TIMEOUT = 0.1  # s for an answer, which takes a few ms


@click.command("find")
@port_option
@click.option(
    "--rate",
    "rates",
    type=click.Choice([*map(str, RATES), "all"]),
    default=str(RATES[-1]),
    show_default=True,
    help="The line's rate in bit/s; all: one after another.",
)
@parity_option
@click.option(
    "--highest",
    type=click.IntRange(1, HIGHEST_DEVICE),
    default=_USUAL,
    show_default=True,
    help="The highest node ID to ask.",
)
def command(port: str, rates: str, parity: str, highest: int) -> int:
    """Ask one node ID after the other; show state, supply and errors of each module found, and the next command to type.

    Nothing is written. It asks at one rate, or at all of them with --rate all: no other program may use the line meanwhile.
    Exit code 0 if a module was found without an error, 1 if one has an error, 3 if no module answers.
    """
    asked = RATES[::-1] if rates == "all" else (int(rates),)
    good: list[bool] = []
    for rate in asked:
        good += _at(ModbusTarget(port, 1, rate, parity), highest)
    if not good:
        say_error(_nobody(port, highest, asked))
        return FAILURE
    return OK if all(good) else WRONG


def _at(line: ModbusTarget, highest: int) -> list[bool]:
    """Query all node IDs at one rate; return for each module whether it has no error."""
    from axisbus.drives.gim6010.modbus.module import Present, present

    good = []
    with line.wire(_TIMEOUT) as wire:
        for found in present(wire, range(1, highest + 1)):
            if not isinstance(found, Present):
                _show_progress(found, highest, line.rate)
                continue
            say(f"{found}, at {line.rate} bit/s" if not found.trouble else f"at {line.rate} bit/s {found}")
            verb = "errors" if found.trouble else "state"
            say_next(f"axisbus gim6010 modbus {verb} {replace(line, node=found.device).words}")
            good.append(not found.trouble)
    return good


def _show_progress(device: int, highest: int, rate: int) -> None:
    """Show the progress on a terminal."""
    if sys.stderr.isatty():
        end = "\r" if device < highest else "\n"
        click.echo(f"  {rate} bit/s: node ID {device} of {highest}", err=True, nl=False)
        click.echo(end, err=True, nl=False)


def _nobody(port: str, highest: int, rates: tuple[int, ...]) -> str:
    tried = "at all rates" if len(rates) > 1 else f"at {rates[0]} bit/s"
    return (
        f"no module answers on {port}\n  observed: {counted(highest, 'node ID')} asked {tried}\n"
        "  remedy:   check the supply, that A and B are not swapped, the ground, and that RS485 is the interface of the "
        "module (config.comm_intf_mux = 1 "
        "over USB); try --rate all, --parity even, --highest 247"
    )
