"""The commands that compare an EDS with a drive: ``axisbus eds verify`` and ``axisbus eds from-device``."""

from __future__ import annotations

from collections import Counter
from contextlib import ExitStack
from dataclasses import asdict
from datetime import datetime
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus import eds
from axisbus.cli.shared.buses import open_bus
from axisbus.cli.shared.common import OK, WRONG, progress_bar, say, say_json, say_next
from axisbus.cli.shared.options import PATH, GivenBus, bus_options, packed, together
from axisbus.cli.shared.output import force_option, output_option, require_free, write_whole
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.bus.node.verify import Verification


_given_bus = together(
    bus_options,
    click.option("--cell", type=PATH, help="Take the bus from this cell file instead."),
    packed(GivenBus, "given"),
)


# -- ``axisbus eds verify``: compare a file with the real drive --------------------------------------------------------


@click.command("verify")
@click.argument("file")
@click.argument("node", type=click.IntRange(1, 127))
@_given_bus
@click.option(
    "--notes", is_flag=True, help="Also show differences that are normal, such as configured values."
)
@click.option("--json", "as_json", is_flag=True, help="Print the differences as JSON.")
def verify_command(
    file: str,
    node: int,
    given: GivenBus,
    notes: bool,
    as_json: bool,
) -> int:
    """Compare FILE (an EDS or DCF) with the drive NODE on a bus: identity, existence, access, size, PDO maps, defaults.

    Reads every object once, writes nothing. Exit code 1 when the drive does not agree with the file.
    """
    from axisbus.bus.node.node import CanopenNode
    from axisbus.bus.node.verify import verify

    dictionary = eds.load(file)
    with ExitStack() as stack:
        bus = open_bus(stack, *given)
        device = stack.enter_context(CanopenNode(bus, node, dictionary))
        on_progress = stack.enter_context(progress_bar("reading objects", quiet=as_json))
        result = verify(device.sdo, dictionary, on_progress)
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


# -- ``axisbus eds from-device``: read an EDS from the drive -----------------------------------------------------------


@click.command("from-device")
@click.argument("node", type=click.IntRange(1, 127))
@_given_bus
@output_option("Where to write [default: node-N.eds].")
@force_option
@click.option("--skeleton", "only_skeleton", is_flag=True, help="Do not read the EDS that the drive stores.")
def from_device_command(
    node: int, given: GivenBus, output: Path | None, force: bool, only_skeleton: bool
) -> int:
    """Read the EDS that the drive NODE stores (1021h), or make a skeleton of the standard objects that exist in the drive.

    Writes nothing to the drive. A skeleton has the standard's names, types and access; it does not contain the maker's objects.
    """
    from axisbus.bus.node.from_device import as_file, skeleton, stored_eds
    from axisbus.bus.node.node import CanopenNode
    from axisbus.eds import writer

    target = output or Path(f"node-{node}.eds")
    require_free(target, force=force)
    notes: list[str] = []
    with ExitStack() as stack:
        bus = open_bus(stack, *given)
        device = stack.enter_context(CanopenNode(bus, node))
        data = None
        if not only_skeleton:
            with progress_bar("reading its EDS") as on_bytes:
                data = stored_eds(device.sdo, on_bytes)
        if data is not None:
            what = "the EDS that the drive stores"
        else:
            on_progress = stack.enter_context(progress_bar("reading the standard objects"))
            found = skeleton(device.sdo, on_progress, notes.append)
            data = _HEADER.encode() + writer.dumps(as_file(found, target.name, datetime.now(), given.bitrate))
            what = f"a skeleton of {counted(len(found.objects), 'object')}"
    write_whole(target, data)
    for note in notes:
        say(note)
    say(f"{target}: {what}")
    say_next(f"axisbus eds check {target}")
    return OK


_HEADER = """; A skeleton read from a drive: the standard objects that it has. Names and access are the standard's, not the maker's.
; The maker's own objects (2000h to 5FFFh) are missing. Replace it by the maker's EDS when you have it.
"""
