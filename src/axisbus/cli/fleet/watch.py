"""``axisbus fleet watch``: observe the cells of a plant."""

from __future__ import annotations

import threading
import time
from typing import TYPE_CHECKING

import click

from axisbus.cli.fleet.cell_rows import Recordings, cell_lines, plain
from axisbus.cli.fleet.list import recordings_of, unreached_text
from axisbus.cli.fleet.options import FleetOptions, plant_options
from axisbus.cli.shared.common import OK, say, say_json
from axisbus.cli.shared.numbers import Seconds
from axisbus.cli.shared.terminal import coloured
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.fleet.cell import FleetCell
    from axisbus.fleet.fleet import Fleet

_REPAINTED, _PRINTED = 0.25, 1.0  # seconds between two updates
_RECORDINGS = 10.0  # seconds between two queries for recordings


@click.command("watch")
@plant_options
@click.option(
    "--every",
    type=Seconds(0.05),
    help=f"Seconds between two updates  [default: {_PRINTED:g}; {_REPAINTED:g} in a terminal]",
)
@click.option("--count", type=click.IntRange(min=1), help="How many updates; without it, until Ctrl-C.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON value per update.")
def command(
    place: FleetOptions,
    every: float | None,
    count: int | None,
    as_json: bool,
) -> int:
    """Show the cells of a plant, their axes, newest incidents and recordings until Ctrl-C; commands nothing.

    When a cell is lost, it is shown as GONE, and its values as unknown, within about a second. "age" is the age of a value by
    the clock of the cell's computer, plus the time since this computer received it: clocks are not compared. In a terminal it
    is one table, which is updated in place.
    """
    live = coloured() and not as_json
    pause = every if every is not None else _REPAINTED if live else _PRINTED
    with (
        place.fleet() as fleet,
        _Kept(fleet) as kept,
    ):
        if live:
            from axisbus.cli.fleet.live import show

            show(
                lambda: [(cell, kept.of(cell)) for cell in fleet],
                lambda: [f"plant {place.plant}", *map(unreached_text, fleet.unreachable_endpoints)],
                pause,
                count,
            )
            return OK
        looks = 0
        while count is None or looks < count:
            if looks:
                time.sleep(pause)
            _look(fleet, kept, as_json)
            looks += 1
    return OK


def _look(fleet: Fleet, kept: _Kept, as_json: bool) -> None:
    if as_json:
        say_json([plain(cell, kept.of(cell)) for cell in fleet])
        return
    say(f"plant {fleet.plant}, {time.strftime('%H:%M:%S')}: {counted(len(fleet), 'cell')}")
    for endpoint in fleet.unreachable_endpoints:
        say(unreached_text(endpoint))
    for cell in fleet:
        say("\n".join(cell_lines(cell, kept.of(cell))))


class _Kept:
    """The recordings of all cells, queried periodically in a thread, so that a slow cell does not delay the display."""

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet
        self._found: dict[str, Recordings] = {}
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> _Kept:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()

    def of(self, cell: FleetCell) -> Recordings:
        """Return the known recordings of a cell."""
        return self._found.get(cell.name, "not asked yet") if cell.alive else cell.offline_reason

    def _run(self) -> None:
        while not self._ended.is_set():
            for cell in self._fleet:
                if self._ended.is_set():
                    return
                self._found[cell.name] = recordings_of(cell)
            self._ended.wait(_RECORDINGS if self._found else 1.0)
