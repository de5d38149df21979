"""The module that a command of ``params`` is for: its bus, its list of endpoints, and itself, opened and proven."""

from __future__ import annotations

import functools
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from axisbus.cli.gim6010.looking import Line
from axisbus.cli.shared.buses import open_bus
from axisbus.cli.shared.options import Decorated, bus_options
from axisbus.cli.shared.paths import PATH
from axisbus.errors import UserError

if TYPE_CHECKING:
    from axisbus.bus.dialogue.endpoints import CanSimpleParameters
    from axisbus.drives.gim6010.can_simple.endpoints import EndpointList
    from axisbus.drives.gim6010.can_simple.fitted import Firmware
    from axisbus.drives.gim6010.parameters.backup import Backup


@dataclass(frozen=True, slots=True)
class Asked:
    """Which module was asked for, and by which list."""

    line: Line
    node: int | None
    listed: Path | None
    made_for: str | None

    @property
    def words(self) -> str:
        """The module as typed, to be repeated in a hint."""
        return f"{self.line.words} --node {self.node} --list {self.listed}"


def module_options(function: Decorated) -> Decorated:
    """Add the bus options, --node, --list and --made-for; the command gets them together as ``asked``."""

    command = function

    @functools.wraps(command)
    def packed(
        interface: str | None,
        channel: str | None,
        bitrate: int | None,
        option: tuple[str, ...],
        node: int | None,
        listed: Path | None,
        made_for: str | None,
        **rest: Any,
    ) -> Any:
        line = Line(interface, channel, bitrate, option)
        return command(asked=Asked(line, node, listed, made_for), **rest)

    function = packed
    for decorate in (
        click.option(
            "--made-for", metavar="VERSION", help="The list's firmware, where its name does not have it."
        ),
        click.option(
            "--list", "listed", type=PATH, help="The firmware's list of endpoints, as endpoints_0.5.13.json."
        ),
        click.option("--node", type=click.IntRange(0, 63), help="The module's node ID."),
    ):
        function = decorate(function)
    return bus_options(function)


@contextmanager
def opened(asked: Asked) -> Iterator[CanSimpleParameters]:
    """Open the module; blocks some 1.5 s.

    Raises:
        UsageError: bus, node ID, list or the list's version is not given.
        UserError, ArgumentError: the list cannot be read, or does not fit.
        AdapterError, NodeError: the bus cannot be opened, or the module does not answer.
    """
    listed, made_for = list_of(asked)
    if asked.node is None:
        raise click.UsageError("give the module's node ID with --node (axisbus gim6010 find tells it)")
    asked.line.check()
    from axisbus.bus.dialogue.endpoints import CanSimpleParameters
    from axisbus.bus.dialogue.simple_line import SimpleLine

    with ExitStack() as stack:
        line = SimpleLine(open_bus(stack, None, *asked.line), asked.node)
        module = CanSimpleParameters(line)
        stack.enter_context(line)
        module.open(listed, made_for)
        yield module


def list_of(asked: Asked) -> tuple[EndpointList, Firmware]:
    """Return the list of endpoints that was given, and the firmware that it is for.

    Raises:
        UsageError: it is not given, or for which firmware it is. UserError, ArgumentError: it cannot be read, or is none.
    """
    from axisbus.drives.gim6010.can_simple.endpoints import parse
    from axisbus.drives.gim6010.can_simple.fitted import Firmware, proposed_version

    if asked.listed is None:
        raise click.UsageError("give the firmware's list of endpoints with --list (the maker has it)")
    listed = parse(text_of(asked.listed), asked.listed.name)
    named = proposed_version(asked.listed.name)
    if asked.made_for is None and named is None:
        raise click.UsageError(
            f"{asked.listed.name} does not say for which firmware it is: give --made-for 0.5.13, if it is for that"
        )
    made_for = Firmware.parse(asked.made_for or str(named))
    if named is not None and named != made_for:
        raise click.UsageError(
            f"{asked.listed.name} is for firmware {named} by its name, and --made-for says {made_for}"
        )
    return listed, made_for


def text_of(path: Path) -> bytes:
    """Return what is in a file.

    Raises:
        UserError: it cannot be read.
    """
    try:
        return path.read_bytes()
    except OSError as error:
        raise UserError(f"{path} cannot be read", observed=str(error.strerror)) from error


def backup_of(path: Path) -> Backup:
    """Return the backup in a file.

    Raises:
        UserError, ArgumentError: it cannot be read, or is none.
    """
    from axisbus.drives.gim6010.parameters import backup

    return backup.read(text_of(path).decode("utf-8", "replace"), path.name)
