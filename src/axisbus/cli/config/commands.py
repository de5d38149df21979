"""The commands ``axisbus config backup`` and ``diff``."""

from __future__ import annotations

from contextlib import ExitStack
from functools import partial
from pathlib import Path

import click

from axisbus.bus.node.node import CanopenNode, NodeIdentity, read_identity
from axisbus.bus.sdo.access import ByObjects
from axisbus.cli.config.files import baudrate, eds_file, node_reading, read_file
from axisbus.cli.shared.attached_nodes import open_nodes
from axisbus.cli.shared.common import OK, WRONG, progress_bar, say, say_json, say_next
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
from axisbus.configuration import compare, report_text
from axisbus.configuration.compare import Comparison
from axisbus.configuration.dcf_backup import DcfBackup, backup, file_name
from axisbus.eds import concise, writer
from axisbus.eds.concise_dcf_values import configuration
from axisbus.eds.dcf import Settings
from axisbus.machine.machine_node import MachineNode
from axisbus.wording import counted

# -- ``axisbus config backup``: read all objects of a node into a DCF --------------------------------------------------


@click.command("backup")
@click.argument("node", shell_complete=complete_node)
@node_options
@output_option("The DCF to write [default: node-N-serial-S.dcf].")
@concise_option("Also write a concise DCF, the content of 1F22h, here.")
@force_option
@click.option("--json", "as_json", is_flag=True, help="Print the values read as JSON.")
def backup_command(
    node: str,
    options: NodeOptions,
    output: Path | None,
    concise_out: Path | None,
    force: bool,
    as_json: bool,
) -> int:
    """Read every object of NODE into a DCF, with its identity and serial number; nothing is written to the drive.

    Without --eds or --cell, the EDS is read from the drive (1021h); if the drive has none, the objects of the standard are read
    one by one.
    """
    require_bus(options)
    require_free(output, concise_out, force=force)
    if output is None:
        require_writable(Path(file_name(1, None)))  # checks this folder; the complete name is known later
    files = NodeFiles.of(options.cell, options.eds)
    node_id = files.address(node.rstrip(":")).node_id
    with ExitStack() as stack:
        device = open_nodes(stack, options, files, [node_id]).node(node_id)
        identity = read_identity(device.sdo)
        target = output or _free_default(node_id, identity.serial, force=force)
        saved, origin = _backup(stack, options, files, device, target.name)
    written = _write(saved, target, concise_out)
    if as_json:
        say_json(_plain(saved, identity, origin, written))
    else:
        _show(saved, identity, origin, node_id, written)
    return OK


def _free_default(node_id: int, serial: int | None, *, force: bool) -> Path:
    target = Path(file_name(node_id, serial))
    require_free(target, force=force)
    return target


def _backup(
    stack: ExitStack, options: NodeOptions, files: NodeFiles, device: ByObjects, name: str
) -> tuple[DcfBackup, str]:
    reading, origin = node_reading(files, device)
    settings = Settings(
        device.node_id,
        baudrate(options, files, reading),
        file_name=name,
        last_eds=Path(reading.eds.source).name if eds_file(files, device.node_id) else None,
    )
    on_progress = stack.enter_context(progress_bar(f"reading node {device.node_id}"))
    return backup(device.sdo, reading, settings, on_progress, partial(_restarts, device)), origin


def _restarts(device: ByObjects) -> float:
    """Return a number that changes if a node restarts."""
    if isinstance(device, MachineNode):
        return device.last_restart
    return device.nmt.bootups if isinstance(device, CanopenNode) else 0


def _write(saved: DcfBackup, target: Path, concise_out: Path | None) -> list[tuple[Path, int]]:
    stream = None
    if concise_out is not None:
        stream = concise.encode(configuration(saved.reading).writes)
    data = writer.dumps(saved.reading)
    write_whole(target, data)
    written = [(target, len(data))]
    if concise_out is not None and stream is not None:
        write_whole(concise_out, stream)
        written.append((concise_out, len(stream)))
    return written


def _show(
    saved: DcfBackup, identity: NodeIdentity, origin: str, node_id: int, written: list[tuple[Path, int]]
) -> None:
    for line in report_text.device(identity, origin, node_id):
        say(line)
    for each in saved.left_out:
        say(f"  left out: {report_text.address(each)}: {each.reason}")
    for path, size in written:
        say(f"{path}: {counted(size, 'octet')}")
    say(report_text.read(saved))
    say_next(f"bring it back: axisbus config restore {written[0][0]} {node_id} ...")


def _plain(
    saved: DcfBackup, identity: NodeIdentity, origin: str, written: list[tuple[Path, int]]
) -> dict[str, object]:
    return {
        "files": [str(path) for path, _ in written],
        "eds": origin,
        "vendor_id": identity.vendor_id,
        "product_code": identity.product_code,
        "revision": identity.revision,
        "serial": identity.serial,
        "read": saved.values,
        "left_out": [{**report_text.identified(each), "reason": each.reason} for each in saved.left_out],
    }


# -- ``axisbus config diff``: compare two files, a file and a node, or a node and its own EDS --------------------------


@click.command("diff")
@click.argument("one")
@click.argument("other", required=False)
@node_options
@click.option(
    "--all", "everything", is_flag=True, help="Also compare read-only objects, such as actual values."
)
@click.option("--json", "as_json", is_flag=True, help="Print the differences as JSON.")
def diff_command(one: str, other: str | None, options: NodeOptions, everything: bool, as_json: bool) -> int:
    """Compare configurations: FILE FILE, FILE NODE (the node as it is now), or NODE alone (with the defaults of its EDS).

    A file is a DCF or an EDS; a node is its ID, or an axis of --cell. The identity and the settings are compared; controlword,
    targets and other command objects are not. Exit code 1 when something differs. Writes nothing.

    \b
    axisbus config diff old.dcf new.dcf
    axisbus config diff x.dcf 5 -i socketcan -c can0
    axisbus config diff 5 -i socketcan -c can0 --eds drive.eds
    """
    files = NodeFiles.of(options.cell, options.eds)
    named = [each for each in (one, other) if each is not None and not _is_node(files, each)]
    nodes = [each for each in (one, other) if each is not None and _is_node(files, each)]
    if len(nodes) > 1 or (not nodes and len(named) < 2):
        raise click.UsageError("compare FILE with FILE, FILE with NODE, or NODE with its own EDS")
    if nodes:
        require_bus(options)
        comparison, names = _with_node(options, files, nodes[0], named, everything, quiet=as_json)
    else:
        comparison, names = _of_files(named[0], named[1], everything)
    if as_json:
        say_json(_diff_plain(comparison, names))
    else:
        _diff_show(comparison, names)
    return WRONG if comparison.differences else OK


def _is_node(files: NodeFiles, text: str) -> bool:
    return text.isdecimal() or (files.cell is not None and text in files.cell.axes)


def _of_files(one: str, other: str, everything: bool) -> tuple[Comparison, tuple[str, str]]:
    first, second = (read_file(each).eds for each in (one, other))
    entries = list(compare.entries(first, everything=everything))
    selected = {(each.index, each.subindex) for each in entries}
    entries += [
        each
        for each in compare.entries(second, everything=everything)
        if (each.index, each.subindex) not in selected
    ]
    node_id = (
        first.node_id or second.node_id
    )  # COB-IDs that depend on the node-ID are compared for the same node
    left, right = (compare.of_file(each, node_id) for each in (first, second))
    found = compare.compare(entries, left, right)
    return found, (first.source, second.source)


def _with_node(
    options: NodeOptions, files: NodeFiles, node: str, named: list[str], everything: bool, *, quiet: bool
) -> tuple[Comparison, tuple[str, str]]:
    node_id = files.address(node).node_id
    given = read_file(named[0]).eds if named else None  # read before the bus is opened
    if given is not None:
        files = files.described_by(node_id, given)
    with ExitStack() as stack:
        device = open_nodes(stack, options, files, [node_id]).node(node_id)
        eds = given or node_reading(files, device)[0].eds
        on_progress = stack.enter_context(progress_bar(f"reading node {node_id}", quiet=quiet))
        found = compare.against(device, eds, on_progress, everything=everything)
    return found, (eds.source, f"node {node_id}")


def _diff_show(comparison: Comparison, names: tuple[str, str]) -> None:
    left, right = map(report_text.short, names)
    for each in comparison.differences:
        shown_value, other = report_text.sides(each)
        difference = each.note or f"{left} {shown_value}, {right} {other}"
        say(f"{report_text.address(each.variable)}: {difference}")
    say(report_text.compared(comparison))
    if comparison.differences and right.startswith("node "):
        say_next(
            f"bring the node to a DCF: axisbus config restore FILE.dcf {right.removeprefix('node ')} ..."
        )


def _diff_plain(comparison: Comparison, names: tuple[str, str]) -> dict[str, object]:
    return {
        "left": names[0],
        "right": names[1],
        "compared": comparison.compared,
        "differences": [
            {
                **report_text.identified(each.variable),
                "left": report_text.plain(each.left),
                "right": report_text.plain(each.right),
                "note": each.note,
            }
            for each in comparison.differences
        ],
    }
