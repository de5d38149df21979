"""The options of ``axisbus sim`` for modules without CANopen: ``--can-simple ID[:FIRMWARE]`` and ``--modbus ID[:FIRMWARE]``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

import click

from axisbus.cli.shared.common import say
from axisbus.cli.shared.plugin_options import SimOption
from axisbus.drives.gim6010.sim.constants import EXTENDED, FACTORY, MOST_NODE_ID, Firmware
from axisbus.drives.gim6010.sim.module import Module
from axisbus.eds.builtin import PREFIX
from axisbus.eds.io.reader import load
from axisbus.wording import counted

_EDS = f"{PREFIX}gim6010-8"  # the EDS of such a module after switching it to CANopen
Wanted = tuple[int, Firmware]


class CanSimple(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A node ID from 0 to 63, and a firmware version: 0, 5:0.5.11."""

    name = "id[:firmware]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Wanted:
        node_id, _, firmware = str(value).partition(":")
        try:
            found = int(node_id), Firmware.read(firmware or str(FACTORY))
        except ValueError:
            found = -1, FACTORY
        if not 0 <= found[0] <= MOST_NODE_ID:
            self.fail(
                f"{value!r} is not a module: give a node ID from 0 to 63, or one with its firmware: 5:0.5.11",
                param,
                ctx,
            )
        return found


def modules(wanted: Sequence[Wanted]) -> list[Module]:
    """Create the modules; blocks to read their EDS for CANopen."""
    eds = load(_EDS)
    return [
        Module(node_id, firmware=firmware, eds=eds, serial=number)
        for number, (node_id, firmware) in enumerate(wanted, 1)
    ]


def told(wanted: Sequence[Wanted]) -> str:
    each = (
        f"node {node_id} with firmware {firmware}"
        + (", in its 29-bit protocol" if firmware >= EXTENDED else "")
        for node_id, firmware in wanted
    )
    return f"{counted(len(wanted), 'simulated module')} GIM6010-8: {'; '.join(each)}"


# -- Modules on RS485 for ``axisbus sim``: ``--modbus ID[:FIRMWARE]``, all on one pseudo-terminal ----------------------


class Modbus(CanSimple):
    """A node ID from 1 to 63, and a firmware version: 1, 5:0.5.14."""

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Wanted:
        found = super().convert(value, param, ctx)
        if not found[0]:
            self.fail("0 is the broadcast address of Modbus: give a node ID from 1 to 63", param, ctx)
        return found


@contextmanager
def on_terminal(wanted: Sequence[Wanted]) -> Iterator[None]:
    """Serve the modules on a pseudo-terminal during the block, and print its path.

    Raises:
        UsageError: two modules have one node ID.
        AdapterError: this system has no pseudo-terminals.
    """
    twice = [node_id for node_id, number in Counter(node_id for node_id, _ in wanted).items() if number > 1]
    if twice:
        raise click.UsageError(f"--modbus: two modules have node ID {twice[0]}")
    from axisbus.drives.gim6010.sim.modbus.station import Station
    from axisbus.drives.gim6010.sim.modbus.terminal import served

    with served(*(Station(node_id, firmware=firmware) for node_id, firmware in wanted)) as terminal:
        each = ", ".join(f"node {node_id} with firmware {firmware}" for node_id, firmware in wanted)
        say(f"{counted(len(wanted), 'simulated module')} GIM6010-8 on RS485: {each}; in another terminal:")
        say(f"  axisbus gim6010 modbus state --port {terminal.path} --node {wanted[0][0]}")
        yield


OPTIONS = (
    SimOption(
        "--can-simple",
        CanSimple(),
        "In addition, a GIM6010-8 that speaks CAN Simple, with this node ID (0 to 63) and firmware; repeat it for more.",
        "From firmware 0.6.8 on, such a module only sends heartbeats in its 29-bit protocol.",
        foreign_nodes=modules,
        text=told,
    ),
    SimOption(
        "--modbus",
        Modbus(),
        "In addition, a GIM6010-8 that speaks Modbus RTU on a pseudo-terminal, with this node ID (1 to 63) and firmware; repeat "
        "it for more.",
        serve=on_terminal,
    ),
)
