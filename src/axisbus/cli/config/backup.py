"""``axisbus config backup``: read all objects of a node into a DCF."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.cli.config import files as config_files
from axisbus.cli.shared.attached_nodes import open_nodes
from axisbus.cli.shared.common import OK, progress_bar, say, say_json, say_next
from axisbus.cli.shared.completion import complete_node
from axisbus.cli.shared.nodes import NodeFiles, NodeOptions, node_options, require_bus
from axisbus.cli.shared.output import (
    concise_option,
    force_option,
    output_option,
    require_free,
    require_writable,
    write_whole,
)
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.bus.node.node import NodeIdentity
    from axisbus.bus.sdo.access import ByObjects
    from axisbus.configuration.dcf_backup import DcfBackup


@click.command("backup")
@click.argument("node", shell_complete=complete_node)
@node_options
@output_option("The DCF to write [default: node-N-serial-S.dcf].")
@concise_option("Also write a concise DCF, the content of 1F22h, here.")
@force_option
@click.option("--json", "as_json", is_flag=True, help="Print the values read as JSON.")
def command(
    node: str,
    asked: NodeOptions,
    output: Path | None,
    concise_out: Path | None,
    force: bool,
    as_json: bool,
) -> int:
    """Read every object of NODE into a DCF, with its identity and serial number; nothing is written to the drive.

    Without --eds or --cell, the EDS is read from the drive (1021h); if the drive has none, the objects of the standard are read
    one by one.
    """
    require_bus(asked)
    require_free(output, concise_out, force=force)
    if output is None:
        from axisbus.configuration.dcf_backup import file_name

        require_writable(Path(file_name(1, None)))  # checks this folder; the complete name is known later
    from axisbus.bus.node.node import read_identity

    files = NodeFiles.of(asked.cell, asked.eds)
    node_id = files.address(node.rstrip(":")).node_id
    with ExitStack() as stack:
        device = open_nodes(stack, asked, files, [node_id]).node(node_id)
        who = read_identity(device.sdo)
        target = output or _free_default(node_id, who.serial, force=force)
        made, origin = _taken(stack, asked, files, device, target.name)
    written = _write(made, target, concise_out)
    if as_json:
        say_json(_plain(made, who, origin, written))
    else:
        _show(made, who, origin, node_id, written)
    return OK


def _free_default(node_id: int, serial: int | None, *, force: bool) -> Path:
    from axisbus.configuration.dcf_backup import file_name

    target = Path(file_name(node_id, serial))
    require_free(target, force=force)
    return target


def _taken(
    stack: ExitStack, asked: NodeOptions, files: NodeFiles, device: ByObjects, name: str
) -> tuple[DcfBackup, str]:
    from axisbus.configuration.dcf_backup import backup
    from axisbus.eds.dcf import Settings

    reading, origin = config_files.node_reading(files, device)
    settings = Settings(
        device.node_id,
        config_files.baudrate(asked, files, reading),
        file_name=name,
        last_eds=Path(reading.eds.source).name if config_files.eds_file(files, device.node_id) else None,
    )
    tell = stack.enter_context(progress_bar(f"reading node {device.node_id}"))
    return backup(device.sdo, reading, settings, tell), origin


def _write(made: DcfBackup, target: Path, concise_out: Path | None) -> list[tuple[Path, int]]:
    from axisbus.eds import concise, writer
    from axisbus.eds.concise_dcf_values import configuration

    stream = None
    if concise_out is not None:
        stream = concise.encode(configuration(made.reading).writes)
    data = writer.dumps(made.reading)
    write_whole(target, data)
    written = [(target, len(data))]
    if concise_out is not None and stream is not None:
        write_whole(concise_out, stream)
        written.append((concise_out, len(stream)))
    return written


def _show(
    made: DcfBackup, who: NodeIdentity, origin: str, node_id: int, written: list[tuple[Path, int]]
) -> None:
    from axisbus.configuration import report_text

    for line in report_text.device(who, origin, node_id):
        say(line)
    for each in made.left_out:
        say(f"  left out: {report_text.place(each)}: {each.reason}")
    for path, size in written:
        say(f"{path}: {counted(size, 'octet')}")
    say(report_text.read(made))
    say_next(f"bring it back: axisbus config restore {written[0][0]} {node_id} ...")


def _plain(
    made: DcfBackup, who: NodeIdentity, origin: str, written: list[tuple[Path, int]]
) -> dict[str, object]:
    return {
        "files": [str(path) for path, _ in written],
        "eds": origin,
        "vendor_id": who.vendor_id,
        "product_code": who.product_code,
        "revision": who.revision,
        "serial": who.serial,
        "read": made.values,
        "left_out": [
            {"index": each.index, "subindex": each.subindex, "name": each.name, "reason": each.reason}
            for each in made.left_out
        ],
    }
