"""The module of a command of ``params``: its bus, its list of endpoints, and the module itself, opened and verified."""

from __future__ import annotations

import functools
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from axisbus.cli.shared.buses import open_bus
from axisbus.cli.shared.options import Decorated
from axisbus.drives.gim6010.cli.discovery import BusOptions, line_options, require_node
from axisbus.drives.gim6010.cli.modbus.target_module import endpoint_options, read_list, text_of
from axisbus.drives.gim6010.cli.ports import modbus_options, on_usb, usb_options
from axisbus.drives.gim6010.cli.ports import modbus_words_of as words_of
from axisbus.drives.gim6010.cli.ports import usb_words_of as usb_words

if TYPE_CHECKING:
    from axisbus.drives.gim6010.bus.can_simple_client import SimpleLine
    from axisbus.drives.gim6010.bus.endpoints import CanSimpleParameters
    from axisbus.drives.gim6010.bus.settings_by_message import ModuleByMessage
    from axisbus.drives.gim6010.can_simple.endpoints import EndpointList, Firmware
    from axisbus.drives.gim6010.cli.modbus.target_module import ModbusTarget
    from axisbus.drives.gim6010.modbus.parameters import ModbusParameters
    from axisbus.drives.gim6010.parameters.backup import ParameterBackup
    from axisbus.drives.gim6010.parameters.interface import ModuleParameters

_Client = TypeVar("_Client")


@dataclass(frozen=True, slots=True)
class ModuleSelection:
    """The requested module, over CAN, by its ``serial`` port or by ``usb``, and its list."""

    line: BusOptions
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
            return usb_words(self.usb)
        listed = "" if self.listed is None else f" --list {self.listed}"
        return f"{words_of(self.serial, self.line, self.node)}{listed}"


def module_options(function: Decorated) -> Decorated:
    """Add the bus options, --modbus, --usb, --node, --list and --made-for; the command gets them together as ``asked``."""

    command = function

    @functools.wraps(command)
    def packed(
        line: BusOptions,
        node: int | None,
        listed: Path | None,
        made_for: str | None,
        serial: ModbusTarget | None,
        usb: str | None,
        **rest: Any,
    ) -> Any:
        return command(asked=ModuleSelection(line, node, listed, made_for, serial, usb), **rest)

    node_option = click.option("--node", type=click.IntRange(0, 63), help="The module's node ID.")
    return line_options(node_option(endpoint_options(modbus_options(usb_options(packed)))))


@contextmanager
def opened(asked: ModuleSelection) -> Iterator[ModuleParameters]:
    """Open the module; blocks some 1.5 s.

    Raises:
        UsageError: bus, node ID, list or the list's version is not given.
        UserError, ArgumentError: the list cannot be read, or does not fit the module.
        AdapterError, NodeError: bus or port cannot be opened, or the module does not answer.
    """
    if asked.usb is not None:
        with on_usb(asked.usb) as module:
            yield module
        return
    listed, made_for = list_of(asked)
    with _by_endpoints(asked) if asked.serial is None else _over_modbus(asked.serial) as listing:
        listing.open(listed, made_for)
        yield listing


@contextmanager
def _over_can(asked: ModuleSelection, make: Callable[[SimpleLine], _Client]) -> Iterator[_Client]:
    """Make a client of the module on its bus, before its connection is opened."""
    node = require_node(asked.node)
    asked.line.check()
    from axisbus.drives.gim6010.bus.can_simple_client import SimpleLine

    with ExitStack() as stack:
        line = SimpleLine(open_bus(stack, None, *asked.line), node)
        client = make(line)
        stack.enter_context(line)
        yield client


@contextmanager
def by_message(asked: ModuleSelection) -> Iterator[ModuleByMessage]:
    """Open the module to set it by messages alone, without a list of endpoints; raises as ``opened``."""
    require_can(asked, "it is a message of CAN Simple")
    from axisbus.drives.gim6010.bus.settings_by_message import ModuleByMessage

    with _over_can(asked, ModuleByMessage) as module:
        yield module


@contextmanager
def _by_endpoints(asked: ModuleSelection) -> Iterator[CanSimpleParameters]:
    from axisbus.drives.gim6010.bus.endpoints import CanSimpleParameters

    with _over_can(asked, CanSimpleParameters) as module:
        yield module


@contextmanager
def _over_modbus(serial: ModbusTarget) -> Iterator[ModbusParameters]:
    from axisbus.drives.gim6010.cli.modbus import target_module
    from axisbus.drives.gim6010.modbus.parameters import ModbusParameters

    with target_module.opened(serial) as module:
        yield ModbusParameters(module)


def require_can(asked: ModuleSelection, why: str) -> None:
    """Refuse another connection than CAN if a command works only over CAN.

    Raises:
        UsageError: another connection is given.
    """
    if not asked.over_can:
        way = "--modbus" if asked.usb is None else "--usb"
        raise click.UsageError(f"this cannot be done over {way}: {why}")


def require_list(asked: ModuleSelection) -> None:
    """Check the list of endpoints, if one is needed, before anything is opened; raises as ``read_list``."""
    if asked.usb is None:
        list_of(asked)


def list_of(asked: ModuleSelection) -> tuple[EndpointList, Firmware]:
    """Return the given list of endpoints, and its firmware; raises as ``read_list``."""
    return read_list(asked.listed, asked.made_for)


def backup_of(path: Path) -> ParameterBackup:
    """Return the backup in a file.

    Raises:
        UserError, ArgumentError: the file cannot be read, or is not a backup.
    """
    from axisbus.drives.gim6010.parameters import backup

    return backup.read(text_of(path).decode("utf-8", "replace"), path.name)
