"""The options that select the module of a command, over CAN, RS485 or USB, and the module itself, opened and verified."""

from __future__ import annotations

import functools
import string
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from axisbus.cli.shared.buses import open_bus
from axisbus.cli.shared.options import Decorated, GivenBus, bus_words, packed
from axisbus.drives.gim6010.cli.bus import line_options, require_bus, require_node
from axisbus.drives.gim6010.cli.modbus import target_module
from axisbus.drives.gim6010.cli.modbus.target_module import (
    PARITIES,
    ModbusTarget,
    endpoint_options,
    read_list,
    text_of,
)
from axisbus.drives.gim6010.modbus.registers import RATES
from axisbus.drives.gim6010.parameters import backup
from axisbus.drives.gim6010.parameters.backup import ParameterBackup
from axisbus.drives.gim6010.parameters.interface import ModuleParameters
from axisbus.drives.gim6010.usb_parameters import UsbParameters, connect

if TYPE_CHECKING:
    from axisbus.drives.gim6010.bus.can_simple_client import SimpleLine
    from axisbus.drives.gim6010.bus.settings_by_message import ModuleByMessage

_Client = TypeVar("_Client")


# -- The option --modbus: reach a module by a serial port (RS485), for commands that otherwise use CAN -----------------


def modbus_options(function: Decorated) -> Decorated:
    """Add --modbus and --parity to a command with bus options and --node; ``serial`` gets a ``ModbusTarget`` or None."""

    @functools.wraps(function)
    def call(modbus: str | None, parity: str | None, **rest: Any) -> Any:
        return function(serial=_target(modbus, parity, rest), **rest)

    parity_option = click.option(
        "--parity", type=click.Choice(PARITIES), help="Parity bit of --modbus.  [default: none]"
    )
    port_option = click.option(
        "--modbus",
        metavar="PORT",
        help="Use RS485, by this serial port; -b is then the rate of the port.  [default: 115200]",
    )
    return port_option(parity_option(call))


def _target(port: str | None, parity: str | None, given: dict[str, Any]) -> ModbusTarget | None:
    if port is None:
        if parity is not None:
            raise click.UsageError("--parity needs --modbus")
        return None
    line: GivenBus = given["line"]
    if line.interface is not None or line.channel is not None:
        raise click.UsageError("give a CAN bus with -i and -c, or a serial port with --modbus, not both")
    rate = line.bitrate or RATES[-1]
    if rate not in RATES:
        raise click.UsageError(f"-b {rate} with --modbus: give one of {', '.join(map(str, RATES))} bit/s")
    if not given["node"]:
        raise click.UsageError("give the module's node ID with --node, 1 or above with --modbus")
    return ModbusTarget(port, given["node"], rate, parity or PARITIES[0])


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
    def call(usb: bool, serial_number: str | None, **rest: Any) -> Any:
        return function(usb=_wanted(usb, serial_number, rest), **rest)

    serial_option = click.option(
        "--serial",
        "serial_number",
        metavar="HEX",
        help="With --usb: the module's serial number, if several are connected.",
    )
    usb_option = click.option(
        "--usb",
        is_flag=True,
        help="Use the module's USB port; the list of endpoints is read from the module.",
    )
    return usb_option(serial_option(call))


def _wanted(usb: bool, serial: str | None, given: dict[str, Any]) -> str | None:
    if not usb:
        if serial is not None:
            raise click.UsageError("--serial needs --usb")
        return None
    line: GivenBus = given["line"]
    others = [typed for typed, value in zip(("-i", "-c", "-b"), line[1:], strict=False) if value is not None]
    others += [typed for name, typed in _OTHERS.items() if given.get(name) is not None]
    if others:
        raise click.UsageError(f"--usb needs no {' and no '.join(others)}: the module on the port is meant")
    if serial is not None and (not serial or set(serial) - set(string.hexdigits)):
        raise click.UsageError(f"--serial {serial!r}: give hexadecimal digits, as odrivetool shows them")
    return ANY if serial is None else serial.upper().zfill(_DIGITS)


def usb_words_of(usb: str) -> str:
    """Return the connection to the module as typed, to be repeated in a hint."""
    return "--usb" if usb == ANY else f"--usb --serial {usb}"


def on_usb(usb: str) -> UsbParameters:
    """Find a module on USB and read its list; blocks for some seconds.

    Raises:
        UserError: the extra ``usb`` is not installed.
        NodeError: the module is not found, or does not list its parameters.
    """
    module = connect(usb or None)
    module.open()
    return module


# -- The module of a command: its bus, its list of endpoints, and the module itself, opened and verified ----------------


@dataclass(frozen=True, slots=True)
class ModuleSelection:
    """The requested module, over CAN, by its ``serial`` port or by ``usb``, and its list."""

    line: GivenBus
    node: int | None
    listed: Path | None
    made_for: str | None
    serial: ModbusTarget | None = None
    usb: str | None = None

    @property
    def over_can(self) -> bool:
        """Whether it is reached over CAN."""
        return self.serial is None and self.usb is None

    @property
    def words(self) -> str:
        """The module as typed, to be repeated in a hint."""
        if self.usb is not None:
            return usb_words_of(self.usb)
        listed = "" if self.listed is None else f" --list {self.listed}"
        if self.serial is not None:
            return self.serial.typed("--modbus", "-b") + listed
        return f"{bus_words(*self.line)} --node {self.node}{listed}"


def module_options(function: Decorated) -> Decorated:
    """Add the bus options, --modbus, --usb, --node, --list and --made-for; the command gets them together as ``asked``."""
    asked = packed(ModuleSelection, "asked")(function)
    node_option = click.option("--node", type=click.IntRange(0, 63), help="The module's node ID.")
    return line_options(node_option(endpoint_options(modbus_options(usb_options(asked)))))


@contextmanager
def opened(asked: ModuleSelection) -> Iterator[ModuleParameters]:
    """Open the module; blocks for about 1.5 s.

    Raises:
        UsageError: bus, node ID, list or the list's version is not given.
        UserError, ArgumentError: the list cannot be read, or does not fit the module.
        AdapterError, NodeError: bus or port cannot be opened, or the module does not answer.
    """
    if asked.usb is not None:
        yield on_usb(asked.usb)
        return
    listed = read_list(asked.listed, asked.made_for)
    if asked.serial is not None:
        target = replace(asked.serial, listed=asked.listed, made_for=asked.made_for)
        with target_module.opened(target) as module:
            yield target_module.parameters(target, module)
        return
    from axisbus.drives.gim6010.bus.endpoints import CanSimpleParameters

    with _over_can(asked, CanSimpleParameters) as client:
        client.open(*listed)
        yield client


@contextmanager
def _over_can(asked: ModuleSelection, make: Callable[[SimpleLine], _Client]) -> Iterator[_Client]:
    """Make a client of the module on its bus, before its connection is opened."""
    node = require_node(asked.node)
    require_bus(asked.line)
    from axisbus.drives.gim6010.bus.can_simple_client import SimpleLine

    with ExitStack() as stack:
        line = SimpleLine(open_bus(stack, *asked.line), node)
        client = make(line)
        stack.enter_context(line)
        yield client


def by_message(asked: ModuleSelection) -> AbstractContextManager[ModuleByMessage]:
    """Open the module to set it by messages alone, without a list of endpoints; raises as ``opened``."""
    require_can(asked, "it is a message of CAN Simple")
    from axisbus.drives.gim6010.bus.settings_by_message import ModuleByMessage

    return _over_can(asked, ModuleByMessage)


def require_can(asked: ModuleSelection, why: str) -> None:
    """Refuse a connection other than CAN if a command works only over CAN. Raises UsageError: another connection is given."""
    if not asked.over_can:
        way = "--modbus" if asked.usb is None else "--usb"
        raise click.UsageError(f"this cannot be done over {way}: {why}")


def require_list(asked: ModuleSelection) -> None:
    """Check the list of endpoints, if one is needed, before anything is opened; raises as ``read_list``."""
    if asked.usb is None:
        read_list(asked.listed, asked.made_for)


def backup_of(path: Path) -> ParameterBackup:
    """Return the backup in a file. Raises UserError, ArgumentError: the file cannot be read, or is not a backup."""
    return backup.read(text_of(path).decode("utf-8", "replace"), path.name)
