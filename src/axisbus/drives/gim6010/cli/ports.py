"""The options that reach a module by RS485 or by USB, for commands that otherwise use CAN."""

from __future__ import annotations

import functools
import string
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from axisbus.cli.shared.options import Decorated
from axisbus.drives.gim6010.cli.discovery import BusOptions
from axisbus.drives.gim6010.cli.modbus.target_module import PARITIES, ModbusTarget
from axisbus.drives.gim6010.modbus.registers import RATES

if TYPE_CHECKING:
    from axisbus.drives.gim6010.usb_parameters import UsbParameters


# -- The option --modbus: reach a module by a serial port (RS485), for commands that otherwise use CAN -----------------


def modbus_options(function: Decorated) -> Decorated:
    """Add --modbus and --parity to a command with bus options and --node; ``serial`` gets a ``ModbusTarget`` or None."""

    @functools.wraps(function)
    def packed(modbus: str | None, parity: str | None, **rest: Any) -> Any:
        return function(serial=_target(modbus, parity, rest), **rest)

    parity_option = click.option(
        "--parity", type=click.Choice(PARITIES), help="Parity bit of --modbus.  [default: none]"
    )
    port_option = click.option(
        "--modbus",
        metavar="PORT",
        help="Use RS485, by this serial port; -b is then the rate of the port.  [default: 115200]",
    )
    return port_option(parity_option(packed))


def _target(port: str | None, parity: str | None, given: dict[str, Any]) -> ModbusTarget | None:
    if port is None:
        if parity is not None:
            raise click.UsageError("--parity needs --modbus")
        return None
    line: BusOptions = given["line"]
    if line.interface is not None or line.channel is not None:
        raise click.UsageError("give a CAN bus with -i and -c, or a serial port with --modbus, not both")
    rate = line.bitrate or RATES[-1]
    if rate not in RATES:
        raise click.UsageError(f"-b {rate} with --modbus: give one of {', '.join(map(str, RATES))} bit/s")
    if not given["node"]:
        raise click.UsageError("give the module's node ID with --node, 1 or above with --modbus")
    return ModbusTarget(port, given["node"], rate, parity or PARITIES[0])


def modbus_words_of(serial: ModbusTarget | None, line: BusOptions, node: int | None) -> str:
    """Return the connection to the module as typed, to be repeated in a hint."""
    if serial is None:
        return f"{line.words} --node {node}"
    return serial.typed("--modbus", "-b")


# -- The options --usb and --serial: reach a module by USB, for commands that otherwise use CAN ------------------------


_DIGITS = 12  # digits of a serial number, as odrive writes it
ANY = ""  # any module that is connected
# Arguments of a command that select another connection to the module, and the options as typed.
_OTHERS = {"serial": "--modbus", "node": "--node", "listed": "--list"}


def usb_options(function: Decorated) -> Decorated:
    """Add --usb and --serial to a command, within ``modbus_options``.

    The command gets as ``usb`` the serial number, or ``ANY``, or None if USB is not used.
    """

    @functools.wraps(function)
    def packed(usb: bool, serial_number: str | None, **rest: Any) -> Any:
        return function(usb=_wanted(usb, serial_number, rest), **rest)

    serial_option = click.option(
        "--serial",
        "serial_number",
        metavar="HEX",
        help="With --usb: its serial number, if several are connected.",
    )
    usb_option = click.option(
        "--usb", is_flag=True, help="Use its USB port; the list of endpoints is read from the module."
    )
    return usb_option(serial_option(packed))


def _wanted(usb: bool, serial: str | None, given: dict[str, Any]) -> str | None:
    if not usb:
        if serial is not None:
            raise click.UsageError("--serial needs --usb")
        return None
    line: BusOptions = given["line"]
    others = [typed for typed, value in zip(("-i", "-c", "-b"), line, strict=False) if value is not None]
    others += [typed for name, typed in _OTHERS.items() if given.get(name) is not None]
    if others:
        raise click.UsageError(f"--usb needs no {' and no '.join(others)}: the module on the port is meant")
    if serial is not None and (not serial or set(serial) - set(string.hexdigits)):
        raise click.UsageError(f"--serial {serial!r}: give hexadecimal digits, as odrivetool shows them")
    return ANY if serial is None else serial.upper().zfill(_DIGITS)


def usb_words_of(usb: str) -> str:
    """Return the connection to the module as typed, to be repeated in a hint."""
    return "--usb" if usb == ANY else f"--usb --serial {usb}"


@contextmanager
def on_usb(usb: str) -> Iterator[UsbParameters]:
    """Find a module on USB and read its list; blocks some seconds.

    Raises:
        UserError: the extra ``usb`` is not installed.
        NodeError: the module is not found, or does not list its parameters.
    """
    from axisbus.drives.gim6010 import odrive_tree
    from axisbus.drives.gim6010.usb_parameters import UsbParameters

    module = UsbParameters(odrive_tree.open_tree(usb or None))
    module.open()
    yield module
