"""``axisbus eds diff``: compare the meaning of two files."""

from __future__ import annotations

import click

from axisbus.cli.eds.files import hint, node_option, open_eds, say_lines
from axisbus.cli.shared.common import MISUSE, OK, WRONG, say_error, say_json
from axisbus.eds.model import Eds
from axisbus.eds.report import compare
from axisbus.eds.report.consequences import EdsDifference
from axisbus.errors import EdsError


@click.command("diff")
@click.argument("a")
@click.argument("b")
@node_option
@click.option("--json", "as_json", is_flag=True, help="Print the differences as JSON.")
def command(a: str, b: str, node: int | None, as_json: bool) -> int:
    """Compare the meaning of two EDS or DCF files: 0x0A equals 10, the order does not matter, $NODEID+x equals $NODEID+x.

    It is made for comparing two firmware versions of one drive: the differences that matter for a master come first. With
    --node (or when one file is a DCF), values are compared as they are for that node. [FileInfo] is not compared.

    Exit codes: 0 the same, 1 different, 2 a file cannot be read.
    """
    try:
        first, second = open_eds(a), open_eds(b)
    except EdsError as error:
        say_error(str(error))
        return MISUSE  # 1 means that they differ
    node_id = _common_node(first, second, node)
    differences = compare.diff(first, second, node_id)
    if as_json:
        say_json(compare.plain(first, second, differences, node_id))
    else:
        say_lines(compare.lines(first, second, differences, node_id))
        if differences:
            hint(f"axisbus eds show {b} {_example(differences)}".rstrip())
    return WRONG if differences else OK


def _example(differences: tuple[EdsDifference, ...]) -> str:
    """Return the index of an object that differs and exists in B; empty if there is none."""
    return next((f"{each.index:04X}" for each in differences if each.index is not None and each.b), "")


def _common_node(a: Eds, b: Eds, node: int | None) -> int | None:
    """Return the node ID for the comparison: the requested one, or the only one that the files are made for."""
    own = {eds.node_id for eds in (a, b) if eds.node_id is not None}
    if node is not None or len(own) != 1:
        return node
    return own.pop()
