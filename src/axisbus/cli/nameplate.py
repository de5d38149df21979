"""``axisbus nameplate``: show, save and compare what identifies the nodes of a cell."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path

import click

from axisbus.cell import reader
from axisbus.cell.model import CellConfig
from axisbus.cell.other_protocols import canopen_nodes
from axisbus.cli.shared.attached_nodes import open_nodes
from axisbus.cli.shared.common import FAILURE, OK, WRONG, say, say_error, say_json, say_next, say_note
from axisbus.cli.shared.nodes import NodeFiles, NodeOptions
from axisbus.cli.shared.options import PATH
from axisbus.cli.shared.output import write_whole
from axisbus.configuration import nameplate
from axisbus.configuration.nameplate import Nameplate
from axisbus.configuration.replacement_plan import note_file
from axisbus.errors import Interrupted, SdoTimeout
from axisbus.wording import counted


@click.command("nameplate")
@click.argument("cell", type=PATH)
@click.option("--save", is_flag=True, help="Store the nameplates beside CELL, as JSON and as Markdown.")
@click.option("--compare", is_flag=True, help="Show the changes since they were saved.")
@click.option("--saved", is_flag=True, help="Show the stored nameplates, without the bus.")
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def command(cell: Path, save: bool, compare: bool, saved: bool, as_json: bool) -> int:
    """Show what identifies each CANopen node of CELL: make, device name, identity, serial number, versions, date of the
    configuration, and the hash of its EDS or DCF.

    The nodes are read through the running machine of CELL, otherwise on the bus; nothing is written to them. --save stores the
    result in CELL's name with .nameplate.json and .nameplate.md: the as-built record of the machine. Exit code 1 when --compare
    finds a difference, 3 when a node does not answer.
    """
    if saved and (save or compare):
        raise click.UsageError("--saved reads no node: leave out --save and --compare")
    config = reader.load(cell)
    file = nameplate.file_of(cell)
    for node in config.nodes:
        if note_file(cell, node).exists():
            say_note(f"the replacement of node {node} is unfinished: axisbus replace {cell} {node}")
    if saved:
        when, plates = nameplate.load(file)
        _show(plates, when, as_json)
        return OK
    before = nameplate.load(file)[1] if compare or (save and file.exists()) else None
    plates, silent = _read(cell, config)
    found = [] if before is None else nameplate.changes(before, [*plates, *_unread_plates(before, silent)])
    if as_json:
        say_json(
            {
                "nodes": [asdict(each) for each in plates],
                "silent": silent,
                "changes": [str(each) for each in found],
            }
        )
    else:
        if not compare:
            _show(plates, "", as_json)
        for each in found:
            say(str(each))
        if compare and not found:
            say(f"{counted(len(plates), 'node')} compared, nothing has changed")
        for node in silent:
            say_error(
                f"node {node} does not answer: check its supply, cable and node-ID (axisbus scan {cell})"
            )
    if save and not silent:
        save_plates(file, plates, cell.name)
        if not as_json:
            say(f"saved in {file} and {file.with_suffix('.md').name}")
            say_next("after a repair or an update: axisbus nameplate CELL --compare")
    elif save:
        say_note("nothing was saved, because a node did not answer")
    if silent:
        return FAILURE
    return WRONG if compare and found else OK


def _read(cell: Path, config: CellConfig) -> tuple[list[Nameplate], list[int]]:
    """Return the nameplates of the nodes that answer, and the other nodes."""
    options = NodeOptions(None, None, None, (), cell, ())
    node_ids, plates, silent = sorted(canopen_nodes(config)), list[Nameplate](), list[int]()
    with ExitStack() as stack:
        nodes = open_nodes(stack, options, NodeFiles(config), node_ids)
        for node_id in node_ids:
            try:
                plates.append(nameplate.read_nameplate(nodes.node(node_id), config))
            except (SdoTimeout, Interrupted):  # the machine may be stopping its axes because the node is lost
                silent.append(node_id)
    return plates, silent


def _unread_plates(before: list[Nameplate], silent: list[int]) -> list[Nameplate]:
    """Return the stored nameplates of silent nodes: of these nothing is known now."""
    return [plate for plate in before if plate.node in silent]


def save_plates(file: Path, plates: Sequence[Nameplate], cell: str) -> None:
    """Store nameplates with the present date and time, as JSON and beside it as Markdown; ``cell``: the name of the cell file.

    Raises:
        UserError: a file cannot be written.
    """
    now = datetime.now(UTC).isoformat(" ", "seconds")
    write_whole(file, nameplate.as_json(plates, cell, now).encode())
    write_whole(file.with_suffix(".md"), nameplate.as_markdown(plates, cell, now).encode())


def _show(plates: list[Nameplate], when: str, as_json: bool) -> None:
    if as_json:
        say_json({"saved": when, "nodes": [asdict(each) for each in plates]})
        return
    if when:
        say(f"saved {when}")
    for plate in plates:
        say(f"node {plate.node}")
        for title, text in nameplate.texts(plate):
            say(f"  {title:<38}{text}")
