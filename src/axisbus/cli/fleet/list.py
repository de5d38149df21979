"""``axisbus fleet list``: list the cells of a plant once."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import click

from axisbus.cli.fleet.cell_rows import Recordings, cell_lines, plain
from axisbus.cli.fleet.options import FleetOptions, plant_options
from axisbus.cli.shared.common import OK, WRONG, say, say_json, say_note
from axisbus.errors import AxisbusError

if TYPE_CHECKING:
    from axisbus.fleet.cell import FleetCell


@click.command("list")
@plant_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON value.")
def command(
    place: FleetOptions,
    as_json: bool,
) -> int:
    """Show the cells of a plant that are present, with their axes, newest incidents and recordings.

    It waits at most about one second for the cells' values. A value older than a second is unknown. The exit code is 1 if no
    cell is found, or an endpoint is not reached.
    """
    with place.fleet() as fleet:
        cells = list(fleet)
        found = dict(zip(cells, _recordings(cells), strict=True))
        if as_json:
            say_json([plain(cell, kept) for cell, kept in found.items()])
        else:
            for cell, kept in found.items():
                say("\n".join(cell_lines(cell, kept)))
        unreached = fleet.unreachable_endpoints
    for endpoint in unreached:
        say_note(unreached_text(endpoint))
    if not cells and not as_json:
        say(f"no cell of plant {place.plant} was found: check that its bridges run, and their endpoints")
    return OK if cells and not unreached else WRONG


def unreached_text(endpoint: str) -> str:
    """Return the text for an endpoint without a connection."""
    return f"NOT REACHED: {endpoint}: the state of its cells is unknown"


def recordings_of(cell: FleetCell) -> Recordings:
    """Return the recordings of a cell, or why they are unknown."""
    try:
        return cell.recordings() if cell.alive else cell.offline_reason
    except AxisbusError as error:
        return error.message


def _recordings(cells: Sequence[FleetCell]) -> list[Recordings]:
    """Query all cells at once, so that a slow cell does not delay the others."""
    if not cells:
        return []
    with ThreadPoolExecutor(min(len(cells), 16)) as pool:
        return list(pool.map(recordings_of, cells))
