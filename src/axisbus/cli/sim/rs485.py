"""Modules on RS485 for ``axisbus sim``: ``--modbus ID[:FIRMWARE]``, all on one pseudo-terminal."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import click

from axisbus.cli.shared.common import say
from axisbus.cli.sim.modules import CanSimple, Wanted
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.sim.modbus.station import Station


class Modbus(CanSimple):
    """A node ID from 1 to 63, and a firmware version: 1, 5:0.5.14."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Wanted:
        """Convert text to both."""
        found = super().convert(value, param, ctx)
        if not found[0]:
            self.fail("0 is the broadcast address of Modbus: give a node ID from 1 to 63", param, ctx)
        return found


@contextmanager
def on_terminal(wanted: Sequence[Wanted]) -> Iterator[None]:
    """Serve the modules on a pseudo-terminal during the block, and print its path; without modules, do nothing.

    Raises:
        UsageError: two modules have one node ID.
        AdapterError: this system has no pseudo-terminals.
    """
    if not wanted:
        yield
        return
    twice = [node_id for node_id, number in Counter(node_id for node_id, _ in wanted).items() if number > 1]
    if twice:
        raise click.UsageError(f"--modbus: two modules have node ID {twice[0]}")
    from axisbus.sim.modbus.terminal import served

    with served(*_stations(wanted)) as terminal:
        each = ", ".join(f"node {node_id} with firmware {firmware}" for node_id, firmware in wanted)
        say(f"{counted(len(wanted), 'simulated module')} GIM6010-8 on RS485: {each}; in another terminal:")
        say(f"  axisbus gim6010 modbus state --port {terminal.path} --node {wanted[0][0]}")
        yield


def _stations(wanted: Sequence[Wanted]) -> list[Station]:
    from axisbus.sim.modbus.station import Station

    return [Station(node_id, firmware=firmware) for node_id, firmware in wanted]
