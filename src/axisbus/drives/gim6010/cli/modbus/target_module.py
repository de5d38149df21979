"""The module of a command of ``modbus``: its serial port, its node ID, and, if needed, its list of endpoints."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import AbstractContextManager, closing, contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.cli.shared.common import say_note
from axisbus.cli.shared.options import PATH, Decorated, packed
from axisbus.drives.gim6010.can_simple.endpoints import EndpointList, Firmware, with_version
from axisbus.drives.gim6010.modbus.module import ModbusModule
from axisbus.drives.gim6010.modbus.parameters import ModbusParameters
from axisbus.drives.gim6010.modbus.registers import HIGHEST_DEVICE, RATES
from axisbus.drives.gim6010.modbus.serial_wire import TIMEOUT, Parity, SerialWire
from axisbus.errors import UserError

if TYPE_CHECKING:
    from axisbus.drives.gim6010.bus.one_module_line import ModbusWatchdogProcess, OneModuleLine

PARITIES = ("none", "even", "odd")
_WATCHDOG_NOTE = (
    "if only this program is killed, its watchdog process stops the module; not if the computer or the cable fails, "
    "or the program hangs"
)


@dataclass(frozen=True, slots=True)
class ModbusTarget:
    """The requested module; the list only if the command takes one."""

    port: str
    node: int
    rate: int
    parity: str
    listed: Path | None = None
    made_for: str | None = None

    @property
    def words(self) -> str:
        """The module as typed, to be repeated in a hint."""
        return self.typed("--port", "--rate")

    def typed(self, port: str, rate: str) -> str:
        """Return the module as typed with these names of the options for port and bit rate."""
        at = "" if self.rate == RATES[-1] else f" {rate} {self.rate}"
        parity = "" if self.parity == PARITIES[0] else f" --parity {self.parity}"
        return f"{port} {self.port} --node {self.node}{at}{parity}"

    def wire(self, timeout: float = TIMEOUT) -> AbstractContextManager[SerialWire]:
        """Open the port; ``timeout`` in s for an answer. Sends nothing.

        Raises:
            UserError: the extra is not installed. AdapterError: the port cannot be opened.
        """
        parity = Parity[self.parity.upper()]
        return closing(SerialWire(self.port, rate=self.rate, parity=parity, timeout=timeout))


port_option = click.option(
    "--port", required=True, metavar="PORT", help="The serial port, such as /dev/ttyUSB0 or COM3."
)
parity_option = click.option(
    "--parity",
    type=click.Choice(PARITIES),
    default=PARITIES[0],
    show_default=True,
    help="The line's parity bit.",
)


def target_options(function: Decorated) -> Decorated:
    """Add --port, --node, --rate and --parity; the command gets them together as ``target``."""

    def target(port: str, node: int, rate: str, parity: str) -> ModbusTarget:
        return ModbusTarget(port, node, int(rate), parity)

    rate_option = click.option(
        "--rate",
        type=click.Choice(tuple(map(str, RATES))),
        default=str(RATES[-1]),
        show_default=True,
        help="Bit rate in bit/s.",
    )
    node_option = click.option(
        "--node", type=click.IntRange(1, HIGHEST_DEVICE), required=True, help="The module's node ID."
    )
    return port_option(node_option(rate_option(parity_option(packed(target, "target")(function)))))


def endpoint_options(function: Decorated) -> Decorated:
    """Add --list and --made-for, as ``listed`` and ``made_for``."""
    made_for = click.option(
        "--made-for", metavar="VERSION", help="The list's firmware, if its name does not contain it."
    )
    listed = click.option(
        "--list", "listed", type=PATH, help="The firmware's list of endpoints, as endpoints_0.5.13.json."
    )
    return listed(made_for(function))


def list_options(function: Decorated) -> Decorated:
    """Add --list and --made-for to a command with ``target_options``, as part of its ``target``."""

    def with_list(target: ModbusTarget, listed: Path | None, made_for: str | None) -> ModbusTarget:
        return replace(target, listed=listed, made_for=made_for)

    return target_options(endpoint_options(packed(with_list, "target")(function)))


@contextmanager
def opened(target: ModbusTarget) -> Iterator[ModbusModule]:
    """Open the port for the module; sends nothing; raises as ``ModbusTarget.wire``."""
    with target.wire() as wire:
        yield ModbusModule(wire, target.node)


def line_of(target: ModbusTarget) -> OneModuleLine:
    """Return the port as a line whose channel polls the registers of the module."""
    from axisbus.drives.gim6010.bus.one_module_line import OneModuleLine

    return OneModuleLine(target.port, target.node, target.rate, target.parity)


@contextmanager
def guard(target: ModbusTarget) -> Iterator[ModbusWatchdogProcess]:
    """Start a watchdog process that stops the module if this program is killed in the block; print its limitations.

    Raises:
        StateError: it cannot be started.
    """
    from axisbus.drives.gim6010.bus.one_module_line import ModbusWatchdogProcess

    with ModbusWatchdogProcess(line_of(target)) as watchdog:
        say_note(_WATCHDOG_NOTE)
        yield watchdog


def parameters(target: ModbusTarget, module: ModbusModule) -> ModbusParameters:
    """Return the module's parameters after checking that its list fits; blocks.

    Raises:
        UsageError: the list or its firmware is not given.
        UserError, ArgumentError: the list does not fit.
        NodeError: the module does not answer.
    """
    found = ModbusParameters(module)
    found.open(*read_list(target.listed, target.made_for))
    return found


# -- The given list of the firmware's endpoints, and the firmware that it belongs to -----------------------------------


def read_list(path: Path | None, made_for: str | None) -> tuple[EndpointList, Firmware]:
    """Return the list of endpoints in a file, and its firmware, by the file's name or by ``made_for``.

    Raises:
        UsageError: the list or its firmware is not given.
        UserError, ArgumentError: the file cannot be read, or is not a list.
    """
    if path is None:
        raise click.UsageError("give the firmware's list of endpoints with --list (available from the maker)")
    return with_version(text_of(path), path.name, made_for)


def text_of(path: Path) -> bytes:
    """Return the contents of a file. Raises UserError: the file cannot be read."""
    try:
        return path.read_bytes()
    except OSError as error:
        raise UserError(f"{path} cannot be read", observed=str(error.strerror)) from error
