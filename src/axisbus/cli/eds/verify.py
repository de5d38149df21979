"""``axisbus eds verify``: compare a file with the real drive."""

from __future__ import annotations

from collections import Counter
from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus import eds
from axisbus.cli.shared.buses import open_bus
from axisbus.cli.shared.common import OK, WRONG, progress_bar, say, say_json, say_next
from axisbus.cli.shared.options import bus_options
from axisbus.cli.shared.paths import PATH
from axisbus.eds.builtin import resolve
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.bus.node.verify import Verification


@click.command("verify")
@click.argument("file")
@click.argument("node", type=click.IntRange(1, 127))
@bus_options
@click.option("--cell", type=PATH, help="Take the bus from this cell file instead.")
@click.option(
    "--notes", is_flag=True, help="Also show differences that are normal, such as configured values."
)
@click.option("--json", "as_json", is_flag=True, help="Print the differences as JSON.")
def command(
    file: str,
    node: int,
    interface: str | None,
    channel: str | None,
    bitrate: int | None,
    option: tuple[str, ...],
    cell: Path | None,
    notes: bool,
    as_json: bool,
) -> int:
    """Compare FILE (an EDS or DCF) with the drive NODE on a bus: identity, existence, access, size, PDO maps, defaults.

    Reads every object once, writes nothing. Exit code 1 when the drive does not agree with the file.
    """
    from axisbus.bus.node.node import CanopenNode
    from axisbus.bus.node.verify import verify

    dictionary = eds.load(resolve(file, Path()))
    with ExitStack() as stack:
        bus = open_bus(stack, cell, interface, channel, bitrate, option)
        device = stack.enter_context(CanopenNode(bus, node, dictionary))
        tell = stack.enter_context(progress_bar("reading objects", quiet=as_json))
        result = verify(device.sdo, dictionary, tell)
    if as_json:
        say_json(_plain(file, result))
    else:
        _show(file, node, result, notes)
    return OK if result.agrees else WRONG


def _plain(file: str, result: Verification) -> dict[str, object]:
    found = [
        {**asdict(each), "kind": each.kind.value, "severity": each.severity.value}
        for each in result.differences
    ]
    return {"file": file, "agrees": result.agrees, "read": result.read, "differences": found}


def _show(file: str, node: int, result: Verification, notes: bool) -> None:
    shown = [each for each in result.differences if notes or each.severity.value != "note"]
    for each in shown:
        where = f"{each.index:04X}h:{each.subindex:02X}"
        say(
            f"{file}:{each.line}: {each.severity.value}: {each.kind.value}: {where} {each.name} {each.message}"
        )
    counts = Counter(each.severity.value for each in result.differences)
    left_out = f", {result.left_out} could not be read" if result.left_out else ""
    say(
        f"{counted(result.read, 'entry', 'entries')} read from node {node}{left_out}: "
        + ", ".join(counted(counts[grade], grade) for grade in ("error", "warning", "note"))
        + ("" if notes or not counts["note"] else " (--notes shows them)")
    )
    if result.agrees:
        say_next("use the file in a cell.toml: axisbus check cell.toml")
    else:
        say_next(
            f"use the EDS of this firmware, or read the objects of the drive: axisbus eds from-device {node} ..."
        )
