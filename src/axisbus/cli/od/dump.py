"""``axisbus od dump``: read every readable object of a node."""

from __future__ import annotations

from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.cli.od import objects as od
from axisbus.cli.shared.attached_nodes import open_nodes
from axisbus.cli.shared.common import OK, progress_bar, say, say_json, say_next
from axisbus.cli.shared.completion import complete_node
from axisbus.cli.shared.nodes import NodeFiles, NodeOptions, node_options, require_bus
from axisbus.cli.shared.output import force_option, output_option, require_free, write_whole
from axisbus.trace import frame_formats
from axisbus.trace.decoded import ObjectValue
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.bus.sdo.access import ByObjects
    from axisbus.eds.model import Eds


@click.command("dump")
@click.argument("node", shell_complete=complete_node)
@node_options
@output_option("Write to this file instead.")
@force_option
@click.option("--json", "as_json", is_flag=True, help="Print the values as JSON.")
def command(node: str, asked: NodeOptions, output: Path | None, force: bool, as_json: bool) -> int:
    """Read every object of NODE that is readable by its EDS, and show its meaning; writes nothing to the drive.

    Without an EDS the objects of CiA 301 and CiA 402 are read. DOMAINs and objects that refuse a scan (ObjFlags) are left out.
    """
    require_bus(asked)
    require_free(output, force=force)
    files = NodeFiles.of(asked.cell, asked.eds)
    address = files.address(node.rstrip(":"))
    with ExitStack() as stack:
        device = open_nodes(stack, asked, files, [address.node_id]).node(address.node_id)
        found = _all(stack, files, device)
    values = [value for value, _ in found]
    if output is not None:
        write_whole(output, _text(address.node_id, found, as_json).encode())
        say(f"{output}: {counted(len(values), 'object')} of node {address.node_id}")
        say_next(f"read one again: axisbus od read ... {address.node_id}:6041")
    elif as_json:
        say_json([_plain(address.node_id, value, refusal) for value, refusal in found])
    else:
        say(_text(address.node_id, found, as_json).rstrip("\n"))
    return OK


def _all(stack: ExitStack, files: NodeFiles, device: ByObjects) -> list[tuple[ObjectValue, str]]:
    tell = stack.enter_context(progress_bar(f"reading node {device.node_id}"))
    eds = device.eds or _skeleton(device)
    wanted = list(od.may_read(eds))
    found = []
    for number, (index, subindex) in enumerate(wanted, start=1):
        found.append(_one(files, device, index, subindex))
        if tell is not None:
            tell(number, len(wanted))
    return found


def _skeleton(device: ByObjects) -> Eds:
    from axisbus.bus.node.from_device import skeleton

    return skeleton(device.sdo)


def _one(files: NodeFiles, device: ByObjects, index: int, subindex: int) -> tuple[ObjectValue, str]:
    """Return an object with its value, or with the reason why it has none."""
    from axisbus.bus.sdo.access import decoded, try_upload, why_unread

    entry = device.sdo.dictionary.entry(index, subindex)
    data = try_upload(device.sdo, index, subindex)
    if not isinstance(data, bytes):
        return ObjectValue(index, subindex, entry.name), why_unread(data)
    value = decoded(data, entry.data_type)
    return od.value_of(files, device.node_id, device.sdo.dictionary, entry, value), ""


def _text(node_id: int, found: list[tuple[ObjectValue, str]], as_json: bool) -> str:
    if as_json:
        import json

        return json.dumps([_plain(node_id, *each) for each in found], indent=2) + "\n"
    return "".join(
        (f"{frame_formats.address(value)}: {refusal}" if refusal else od.line(value)) + "\n"
        for value, refusal in found
    )


def _plain(node_id: int, value: ObjectValue, refusal: str) -> dict[str, object]:
    return {**od.plain(node_id, value), **({"refused": refusal} if refusal else {})}
