"""``axisbus od read``: read objects and explain their values."""

from __future__ import annotations

from contextlib import ExitStack

import click

from axisbus.cli.od import objects as od
from axisbus.cli.shared.attached_nodes import open_nodes
from axisbus.cli.shared.common import OK, say, say_json
from axisbus.cli.shared.nodes import NodeFiles, NodeOptions, node_options, require_bus


@click.command("read")
@click.argument("arguments", metavar="NODE:OBJECT...", nargs=-1, required=True, shell_complete=od.complete)
@node_options
@click.option(
    "--type", "kind", metavar="TYPE", help="Read as this type (u16, i32, REAL32, VISIBLE_STRING, ...)."
)
@click.option("--json", "as_json", is_flag=True, help="Print the values as JSON.")
def command(arguments: tuple[str, ...], asked: NodeOptions, kind: str | None, as_json: bool) -> int:
    """Read objects and show their meaning; writes nothing. A record is read whole.

    \b
    axisbus od read --cell cell.toml x:Statusword 5:6064 5:1018
    axisbus od read -i socketcan -c can0 --eds drive.eds 5 Position_actual_value 6041
    """
    require_bus(asked)
    data_type = od.kind_of(kind)
    files = NodeFiles.of(asked.cell, asked.eds)
    wanted = od.targets(files, arguments)
    with ExitStack() as stack:
        nodes = open_nodes(stack, asked, files, {each.address.node_id for each in wanted})
        found = [
            (each, od.read(files, nodes.node(each.address.node_id), each.entry, data_type)) for each in wanted
        ]
    if as_json:
        say_json([od.plain(each.address.node_id, value) for each, value in found])
        return OK
    several = len({each.address for each, _ in found}) > 1
    for each, value in found:
        say((f"node {each.address.node_id}  " if several else "") + od.line(value))
    return OK
