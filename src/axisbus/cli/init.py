"""``axisbus init``: write a first cell file from the results of a scan."""

from __future__ import annotations

import os
from collections import Counter
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.cell.model import SIMULATED
from axisbus.cli.shared.buses import open_bus
from axisbus.cli.shared.common import OK, WRONG, progress_bar, say, say_json, say_next
from axisbus.cli.shared.options import PATH, bus_options, parse_options
from axisbus.cli.shared.output import force_option, output_option, require_free, write_whole
from axisbus.errors import UserError
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.bus.link.channel import Channel
    from axisbus.bus.node.discover import DiscoveredNode
    from axisbus.drives.foreign_protocols import ForeignProtocols
    from axisbus.scaffold.draft import Draft, NodeFound
    from axisbus.scaffold.match import CandidateFile, FileMatch


@click.command("init")
@bus_options
@output_option("The cell file to write.", default=Path("cell.toml"), show_default=True)
@click.option(
    "--eds",
    "folders",
    multiple=True,
    type=PATH,
    help="Folder (or file) to look for EDS files in; may be repeated.",
)
@force_option
@click.option("--json", "as_json", is_flag=True, help="Print the results as JSON.")
def command(
    interface: str | None,
    channel: str | None,
    bitrate: int | None,
    option: tuple[str, ...],
    output: Path,
    folders: tuple[Path, ...],
    force: bool,
    as_json: bool,
) -> int:
    """Write a first cell file from the answers on a bus: its nodes, an EDS for each by its identity, and their axes.

    The properties that only you know (units, scales, speeds, stop sequence) are written as comments to confirm, with the values
    that the drives report. Only reads; energises nothing. Exit code 1 when something is missing in the file.
    """
    from axisbus.drives.foreign_protocols import ForeignProtocols
    from axisbus.scaffold import match

    if interface is None:
        raise click.UsageError("give the bus with -i and -c (such as: -i socketcan -c can0)")
    require_free(output, force=force)
    others = ForeignProtocols()
    known, unreadable = match.collect(folders)
    with ExitStack() as stack:
        bus = open_bus(stack, None, interface, channel, bitrate, option)
        nodes = _found(bus, known, output, others, quiet=as_json)
    if not nodes:
        raise _no_answer_error(others)
    cell_draft = _draft(nodes, interface, channel, bitrate, option)
    write_whole(output, cell_draft.text.encode())
    return _report(output, nodes, cell_draft, unreadable, as_json)


def _no_answer_error(others: ForeignProtocols) -> UserError:
    """Return why no cell file is made: no node answers, or the present modules use another protocol."""
    default_remedy = (
        "check supply, cable, termination and bit rate (axisbus scan), and node-IDs (axisbus lss find)"
    )
    return UserError(
        "no node answered on the bus; no cell file was written",
        observed="; ".join(others.heard()),
        remedy="; ".join(others.remedies()) or default_remedy,
    )


def _found(
    bus: Channel, known: list[CandidateFile], output: Path, others: ForeignProtocols, *, quiet: bool
) -> list[NodeFound]:
    from axisbus.bus.node.discover import scan

    found = scan(bus, listening=others)
    nodes = []
    with progress_bar("asking the nodes", quiet=quiet) as on_progress:
        for number, node in enumerate(found, start=1):
            nodes.append(_node(bus, node, known, output))
            if on_progress is not None:
                on_progress(number, len(found))
    return nodes


def _node(bus: Channel, node: DiscoveredNode, known: list[CandidateFile], output: Path) -> NodeFound:
    from axisbus.bus.sdo.client import SdoClient
    from axisbus.cia402.objects import PROFILE_NUMBER
    from axisbus.drives import registry
    from axisbus.scaffold import device_probe, draft, match

    identity = node.identity
    files = match.match(known, node.node_id, identity.vendor_id, identity.product_code, identity.revision)
    axes: list[device_probe.ProbedAxis] = []
    if node.answers_sdo and identity.profile == PROFILE_NUMBER:
        client = SdoClient(bus, node.node_id)
        try:
            axes = device_probe.axes(client)
        finally:
            client.close()
    make = registry.of_identity(identity)
    return draft.NodeFound(node, files, _specs(files, output), tuple(axes), make)


def _specs(files: FileMatch, output: Path) -> tuple[str, ...]:
    """Return the files as named in the cell file: built-in ones by name, others relative to its folder."""
    from axisbus.eds.builtin import PREFIX

    folder = output.parent.resolve()
    return tuple(
        each.spec
        if each.spec.startswith(PREFIX)
        else Path(os.path.relpath(Path(each.spec).resolve(), folder)).as_posix()
        for each in files.files
    )


def _draft(
    nodes: list[NodeFound], interface: str, channel: str | None, bitrate: int | None, option: tuple[str, ...]
) -> Draft:
    from axisbus.bus.link.listen import link_bitrate
    from axisbus.scaffold import draft

    rate = bitrate or link_bitrate(interface, channel)
    name = None if interface == SIMULATED else channel  # there, the channel is the simulated cell
    return draft.draft(draft.BusFound(interface, name, rate, parse_options(option)), nodes)


def _report(
    output: Path, nodes: list[NodeFound], cell_draft: Draft, unreadable: list[str], as_json: bool
) -> int:
    from axisbus.cell.problem import shared
    from axisbus.check.run import check

    counts = Counter(each.problem.severity.value for each in shared(check(output)))
    code = WRONG if cell_draft.missing or counts["error"] else OK
    if as_json:
        say_json(
            {
                "file": str(output),
                "nodes": [_plain(node) for node in nodes],
                "missing": cell_draft.missing,
                "confirm": cell_draft.confirm,
                "unreadable": unreadable,
                "check": dict(counts),
            }
        )
        return code
    for node in nodes:
        say(_line(node))
    for text in unreadable:
        say(f"not used: {text}")
    for text in cell_draft.missing:
        say(f"MISSING: {text}")
    for text in cell_draft.confirm:
        say(f"CONFIRM: {text}")
    say(
        f"{output}: {counted(len(nodes), 'node')}, {counted(sum(len(node.axes) for node in nodes), 'axis', 'axes')}"
    )
    say_next(f"confirm its comments with an editor, then: axisbus check {output}")
    return code


def _line(node: NodeFound) -> str:
    identity = node.found.identity
    files = " or ".join(node.specs) or "no EDS"
    axes = f", {counted(len(node.axes), 'axis', 'axes')}" if node.axes else ""
    return f"node {node.found.node_id}: {identity.device_name or node.found.kind or 'answers no SDO'}{axes}, {files}"


def _plain(node: NodeFound) -> dict[str, object]:
    identity = node.found.identity
    return {
        "node": node.found.node_id,
        "answers_sdo": node.found.answers_sdo,
        "device_name": identity.device_name,
        "vendor_id": identity.vendor_id,
        "product_code": identity.product_code,
        "revision": identity.revision,
        "serial": identity.serial,
        "eds": list(node.specs),
        "axes": [
            {"drive_axis": axis.number, "power": axis.power, "energised": axis.energised}
            for axis in node.axes
        ],
    }
