"""Modules without CANopen for ``axisbus sim``: ``--can-simple ID[:FIRMWARE]``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from axisbus.eds.builtin import PREFIX, resolve
from axisbus.eds.io.reader import load
from axisbus.sim.can_simple.constants import MOST_NODE_ID
from axisbus.sim.can_simple.firmware import EXTENDED, FACTORY, Firmware
from axisbus.sim.can_simple.module import Module
from axisbus.wording import counted

_EDS = f"{PREFIX}gim6010-8"  # the EDS of such a module after switching it to CANopen
Wanted = tuple[int, Firmware]


class CanSimple(click.ParamType):  # type: ignore[type-arg,unused-ignore]
    """A node ID from 0 to 63, and a firmware version: 0, 5:0.5.11."""

    name = "id[:firmware]"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> Wanted:
        """Convert text to both."""
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
    eds = load(resolve(_EDS, Path())) if wanted else None
    return [
        Module(node_id, firmware=firmware, eds=eds, serial=number)
        for number, (node_id, firmware) in enumerate(wanted, 1)
    ]


def told(wanted: Sequence[Wanted]) -> str:
    """Return the text about the served modules."""
    each = (
        f"node {node_id} with firmware {firmware}"
        + (", in its 29-bit protocol" if firmware >= EXTENDED else "")
        for node_id, firmware in wanted
    )
    return f"{counted(len(wanted), 'simulated module')} GIM6010-8: {'; '.join(each)}"
