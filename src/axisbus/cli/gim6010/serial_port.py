"""The option --modbus: reach a module by a serial port (RS485), for commands that otherwise use CAN."""

from __future__ import annotations

import functools
from typing import Any

import click

from axisbus.cli.gim6010.discovery import BusOptions
from axisbus.cli.gim6010.modbus.target_module import PARITIES, ModbusTarget
from axisbus.cli.shared.options import Decorated
from axisbus.drives.gim6010.modbus.registers import RATES


def modbus_options(function: Decorated) -> Decorated:
    """Add --modbus and --parity to a command with bus options and --node; ``serial`` gets a ``ModbusTarget`` or None."""
    command = function

    @functools.wraps(command)
    def packed(modbus: str | None, parity: str | None, **rest: Any) -> Any:
        return command(serial=_target(modbus, parity, rest), **rest)

    function = packed
    for decorate in (
        click.option(
            "--parity", type=click.Choice(PARITIES), help="Parity bit of --modbus.  [default: none]"
        ),
        click.option(
            "--modbus",
            metavar="PORT",
            help="Use RS485, by this serial port; -b is then the rate of the port.  [default: 115200]",
        ),
    ):
        function = decorate(function)
    return function


def _target(port: str | None, parity: str | None, given: dict[str, Any]) -> ModbusTarget | None:
    if port is None:
        if parity is not None:
            raise click.UsageError("--parity needs --modbus")
        return None
    if given["interface"] is not None or given["channel"] is not None:
        raise click.UsageError("give a CAN bus with -i and -c, or a serial port with --modbus, not both")
    rate = given["bitrate"] or RATES[-1]
    if rate not in RATES:
        raise click.UsageError(f"-b {rate} with --modbus: give one of {', '.join(map(str, RATES))} bit/s")
    if not given["node"]:
        raise click.UsageError("give the module's node ID with --node, 1 or above with --modbus")
    return ModbusTarget(port, given["node"], rate, parity or PARITIES[0])


def words_of(serial: ModbusTarget | None, line: BusOptions, node: int | None) -> str:
    """Return the connection to the module as typed, to be repeated in a hint."""
    if serial is None:
        return f"{line.words} --node {node}"
    rate = "" if serial.rate == RATES[-1] else f" -b {serial.rate}"
    parity = "" if serial.parity == PARITIES[0] else f" --parity {serial.parity}"
    return f"--modbus {serial.port} --node {serial.node}{rate}{parity}"
