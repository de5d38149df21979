"""``axisbus scan``: who is on a bus, and what they are."""

from __future__ import annotations

from contextlib import ExitStack
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.cli.buses import open_bus
from axisbus.cli.common import OK, WRONG, say, say_json, say_next
from axisbus.cli.options import bus_options

if TYPE_CHECKING:
    from axisbus.bus.discover import Found


@click.command("scan")
@click.argument("cell", type=click.Path(path_type=Path), required=False)
@bus_options
@click.option("--json", "as_json", is_flag=True, help="Print the nodes as JSON.")
def command(
    cell: Path | None,
    interface: str | None,
    channel: str | None,
    bitrate: int | None,
    option: tuple[str, ...],
    as_json: bool,
) -> int:
    """Show who is on a bus and what they are: on that of CELL (a cell.toml), or with -i and -c on any.

    Asks each of the 127 node IDs once or twice; takes under 3 s. Changes nothing. Exit code 1 when nobody answers.
    """
    from axisbus.bus.discover import scan

    with ExitStack() as stack:
        bus = open_bus(stack, cell, interface, channel, bitrate, option)
        found = scan(bus)
    if as_json:
        say_json([{**asdict(node), "nmt": node.nmt.text if node.nmt is not None else None} for node in found])
    else:
        _show(found)
    return OK if found else WRONG


def _show(found: list[Found]) -> None:
    if not found:
        say("nobody answered: check supply, cable, termination and bit rate")
        say_next("with another bit rate: axisbus scan -i ... -c ... -b 500000")
        return
    for node in found:
        who = node.identity
        numbers = [
            f"{title} 0x{value:X}"
            for title, value in (
                ("vendor", who.vendor_id),
                ("product", who.product_code),
                ("revision", who.revision),
                ("serial", who.serial),
            )
            if value is not None
        ]
        state = node.nmt.text if node.nmt is not None else "no heartbeat"
        say(
            f"{node.node_id:>4}  {node.kind or 'does not answer SDO':<24}  {who.device_name or '':<20}  {state}"
        )
        if numbers:
            say(f"      {', '.join(numbers)}")
    say_next("write these nodes into a cell.toml, then: axisbus check cell.toml")
