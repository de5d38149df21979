"""``axisbus eds from-device``: read an EDS from the drive."""

from __future__ import annotations

from contextlib import ExitStack
from datetime import datetime
from pathlib import Path

import click

from axisbus.cli.shared.buses import open_bus
from axisbus.cli.shared.common import OK, progress_bar, say, say_next
from axisbus.cli.shared.options import bus_options
from axisbus.cli.shared.output import force_option, output_option, require_free, write_whole
from axisbus.cli.shared.paths import PATH
from axisbus.wording import counted


@click.command("from-device")
@click.argument("node", type=click.IntRange(1, 127))
@bus_options
@click.option("--cell", type=PATH, help="Take the bus from this cell file instead.")
@output_option("Where to write [default: node-N.eds].")
@force_option
@click.option("--skeleton", "only_skeleton", is_flag=True, help="Do not read the EDS that the drive stores.")
def command(
    node: int,
    interface: str | None,
    channel: str | None,
    bitrate: int | None,
    option: tuple[str, ...],
    cell: Path | None,
    output: Path | None,
    force: bool,
    only_skeleton: bool,
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
        bus = open_bus(stack, cell, interface, channel, bitrate, option)
        device = stack.enter_context(CanopenNode(bus, node))
        data = None
        if not only_skeleton:
            with progress_bar("reading its EDS") as tell_bytes:
                data = stored_eds(device.sdo, tell_bytes)
        if data is not None:
            what = "the EDS that the drive stores"
        else:
            tell = stack.enter_context(progress_bar("reading the standard objects"))
            found = skeleton(device.sdo, tell, notes.append)
            data = _HEADER.encode() + writer.dumps(as_file(found, target.name, datetime.now(), bitrate))
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
