"""The connection to a module that is configured by messages alone, without a list of endpoints."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import click

from axisbus.cli.shared.buses import open_bus
from axisbus.drives.gim6010.cli.params.module import ModuleSelection, require_can

if TYPE_CHECKING:
    from axisbus.drives.gim6010.bus.can_simple_client import SimpleLine


def line_of(asked: ModuleSelection, stack: ExitStack) -> SimpleLine:
    """Open the bus, which ``stack`` closes, and return the connection to the module, not yet open.

    Raises:
        UsageError: bus or node ID is not given, or another connection is.
        AdapterError: the bus cannot be opened.
    """
    require_can(asked, "it is a message of CAN Simple")
    if asked.node is None:
        raise click.UsageError("give the module's node ID with --node (axisbus gim6010 find shows it)")
    asked.line.check()
    from axisbus.drives.gim6010.bus.can_simple_client import SimpleLine

    return SimpleLine(open_bus(stack, None, *asked.line), asked.node)
