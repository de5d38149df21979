"""``axisbus config diff``: compare two files, a file and a node, or a node and its own EDS."""

from __future__ import annotations

from contextlib import ExitStack
from typing import TYPE_CHECKING

import click

from axisbus.cli.config import files as config_files
from axisbus.cli.shared.attached_nodes import open_nodes
from axisbus.cli.shared.common import OK, WRONG, progress_bar, say, say_json, say_next
from axisbus.cli.shared.nodes import NodeFiles, NodeOptions, node_options, require_bus

if TYPE_CHECKING:
    from axisbus.configuration.compare import Comparison, ConfigurationSide
    from axisbus.eds.model import Eds, Variable


@click.command("diff")
@click.argument("one")
@click.argument("other", required=False)
@node_options
@click.option(
    "--all", "everything", is_flag=True, help="Also compare read-only objects, such as actual values."
)
@click.option("--json", "as_json", is_flag=True, help="Print the differences as JSON.")
def command(one: str, other: str | None, asked: NodeOptions, everything: bool, as_json: bool) -> int:
    """Compare configurations: FILE FILE, FILE NODE (the node as it is now), or NODE alone (with the defaults of its EDS).

    A file is a DCF or an EDS; a node is its ID, or an axis of --cell. The identity and the settings are compared; controlword,
    targets and other command objects are not. Exit code 1 when something differs. Writes nothing.

    \b
    axisbus config diff old.dcf new.dcf
    axisbus config diff x.dcf 5 -i socketcan -c can0
    axisbus config diff 5 -i socketcan -c can0 --eds drive.eds
    """
    files = NodeFiles.of(asked.cell, asked.eds)
    named = [each for each in (one, other) if each is not None and not _is_node(files, each)]
    nodes = [each for each in (one, other) if each is not None and _is_node(files, each)]
    if len(nodes) > 1 or (not nodes and len(named) < 2):
        raise click.UsageError("compare FILE with FILE, FILE with NODE, or NODE with its own EDS")
    if nodes:
        require_bus(asked)
        comparison, names = _with_node(asked, files, nodes[0], named, everything, quiet=as_json)
    else:
        comparison, names = _of_files(named[0], named[1], everything)
    if as_json:
        say_json(_plain(comparison, names))
    else:
        _show(comparison, names)
    return WRONG if comparison.differences else OK


def _is_node(files: NodeFiles, text: str) -> bool:
    return text.isdecimal() or (files.cell is not None and text in files.cell.axes)


def _of_files(one: str, other: str, everything: bool) -> tuple[Comparison, tuple[str, str]]:
    from axisbus.configuration import compare

    first, second = (config_files.read_file(each).eds for each in (one, other))
    entries = _entries(first, everything)
    there = {(each.index, each.subindex) for each in entries}
    entries += [each for each in _entries(second, everything) if (each.index, each.subindex) not in there]
    node_id = (
        first.node_id or second.node_id
    )  # COB-IDs that depend on the node-ID are compared for the same node
    left, right = (_side(each, node_id) for each in (first, second))
    found = compare.compare(entries, left, right)
    return found, (first.source, second.source)


def _with_node(
    asked: NodeOptions, files: NodeFiles, node: str, named: list[str], everything: bool, *, quiet: bool
) -> tuple[Comparison, tuple[str, str]]:
    from axisbus.configuration import compare as device_side

    node_id = files.address(node).node_id
    given = config_files.read_file(named[0]).eds if named else None  # read before the bus is opened
    with ExitStack() as stack:
        device = open_nodes(stack, asked, files, [node_id]).node(node_id)
        eds = given or config_files.node_reading(files, device)[0].eds
        tell = stack.enter_context(progress_bar(f"reading node {node_id}", quiet=quiet))
        found = device_side.against(device, eds, tell, everything=everything)
    return found, (eds.source, f"node {node_id}")


def _entries(eds: Eds, everything: bool) -> list[Variable]:
    from axisbus.configuration import compare

    return list(compare.entries(eds, everything=everything))


def _side(eds: Eds, node_id: int | None) -> ConfigurationSide:
    from axisbus.configuration import compare

    return compare.of_file(eds, node_id)


def _show(comparison: Comparison, names: tuple[str, str]) -> None:
    from axisbus.configuration import report_text

    left, right = map(report_text.short, names)
    for each in comparison.differences:
        mine, other = report_text.sides(each)
        says = each.note or f"{left} {mine}, {right} {other}"
        say(f"{report_text.place(each.variable)}: {says}")
    say(report_text.compared(comparison))
    if comparison.differences and right.startswith("node "):
        say_next(
            f"bring the node to a DCF: axisbus config restore FILE.dcf {right.removeprefix('node ')} ..."
        )


def _plain(comparison: Comparison, names: tuple[str, str]) -> dict[str, object]:
    from axisbus.configuration import report_text

    return {
        "left": names[0],
        "right": names[1],
        "compared": comparison.compared,
        "differences": [
            {
                "index": each.variable.index,
                "subindex": each.variable.subindex,
                "name": each.variable.name,
                "left": report_text.plain(each.left),
                "right": report_text.plain(each.right),
                "note": each.note,
            }
            for each in comparison.differences
        ],
    }
