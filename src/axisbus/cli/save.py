"""``axisbus save``: store the parameters of a node."""

from __future__ import annotations

from contextlib import ExitStack

import click

from axisbus.cli.shared.common import OK, WRONG, progress_phases, say, say_error, say_json, say_next
from axisbus.cli.shared.completion import complete_node
from axisbus.cli.shared.nodes import NodeOptions, NodeSession, node_options
from axisbus.configuration import report_text
from axisbus.configuration.store_parameters import OBJECT, StoreResult, store_all
from axisbus.wording import counted


@click.command("save")
@click.argument("node", shell_complete=complete_node)
@node_options
@click.option("--json", "as_json", is_flag=True, help="Print the result as JSON.")
def command(node: str, options: NodeOptions, as_json: bool) -> int:
    """Make NODE (its ID, or an axis of --cell) store all its parameters (1010h:01, Save all parameters), so that they survive a
    power-off.

    Refused while a drive of the node is energised: some drives restart when they store. The command waits for such a restart,
    and the node must answer again; with its EDS (--cell, --eds) all its objects are then read again. Exit code 1 when the
    restart has lost a value, 3 when the node refuses or does not come back.

    \b
    axisbus save x --cell cell.toml
    axisbus save 5 -i socketcan -c can0 --eds drive.eds
    """
    files = options.files()
    node_id = files.address(node.rstrip(":")).node_id
    with ExitStack() as stack:
        device = NodeSession(stack, options, files, [node_id]).node(node_id)
        stored = store_all(device, stack.enter_context(progress_phases(quiet=as_json)))
    if as_json:
        say_json(_plain(node_id, stored))
    else:
        _show(node_id, stored, device.eds is not None)
    return WRONG if stored.comparison.differences else OK


def _show(node_id: int, stored: StoreResult, with_eds: bool) -> None:
    restart = ", restarted" if stored.restarted else ""
    say(f"node {node_id}: stored by {OBJECT} in {stored.seconds:.1f} s{restart}, and answers")
    for each in stored.comparison.differences:
        was, now = (report_text.shown(each.variable, value) for value in (each.left, each.right))
        say_error(
            f"{report_text.address(each.variable)} was {was}, is {each.note or now} since the restart: it was not stored"
        )
    if stored.restarted and with_eds:
        lost = len(stored.comparison.differences)
        say(f"{counted(stored.comparison.compared, 'object')} read again after the restart, {lost} differ")
    say_next(f"keep a copy in a file: axisbus config backup {node_id} ... -o FILE.dcf")


def _plain(node_id: int, stored: StoreResult) -> dict[str, object]:
    lost = [
        {
            **report_text.identified(each.variable),
            "before": report_text.plain(each.left),
            "after": report_text.plain(each.right),
        }
        for each in stored.comparison.differences
    ]
    return {
        "node": node_id,
        "stored": True,
        "object": "1010h:01",
        "restarted": stored.restarted,
        "seconds": stored.seconds,
        "compared": stored.comparison.compared,
        "lost": lost,
    }
