"""The commands ``axisbus fleet list``, ``watch`` and ``stop``."""

from __future__ import annotations

import threading
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import click

from axisbus.cli.fleet.cell_rows import Recordings, cell_lines, plain
from axisbus.cli.shared.common import FAILURE, OK, WRONG, coloured, rounds, say, say_error, say_json, say_note
from axisbus.cli.shared.options import PATH, Seconds, packed, together
from axisbus.errors import AxisbusError, said_of
from axisbus.fleet.fleet import Fleet
from axisbus.machine.handle import Handle, mark_end_as_read
from axisbus.wording import counted

if TYPE_CHECKING:
    from axisbus.fleet.cell import FleetCell


# -- Options of all ``axisbus fleet`` commands: the plant, and its network ---------------------------------------------


@dataclass(frozen=True, slots=True)
class FleetOptions:
    """A plant by its name, and its network, as ``Fleet`` takes them."""

    plant: str
    connect: tuple[str, ...]
    listen: tuple[str, ...]
    scouting: bool
    config: Path | None

    def fleet(self, look: float | None = None) -> Fleet:
        """Return the cells of the plant; ``look`` in seconds, blocking and errors as for ``Fleet``."""
        return Fleet(**asdict(self), look=look)


# --plant, --connect, --listen, --scouting and --config; a command gets them together as ``fleet_options``.
plant_options = together(
    click.option(
        "--plant", required=True, metavar="NAME", help="The name of the plant, as given to its bridges."
    ),
    click.option(
        "--connect",
        multiple=True,
        metavar="ENDPOINT",
        help="A bridge or a router, such as tcp/10.0.0.5:7447; repeatable.",
    ),
    click.option(
        "--listen",
        multiple=True,
        metavar="ENDPOINT",
        help="The endpoint at which cells may connect; repeatable.",
    ),
    click.option("--scouting", is_flag=True, help="Also search for cells by multicast."),
    click.option("--config", type=PATH, help="A configuration file of Zenoh, for example for certificates."),
    packed(FleetOptions, "fleet_options"),
)


# -- ``axisbus fleet list``: list the cells of a plant once ------------------------------------------------------------


@click.command("list")
@plant_options
@click.option("--json", "as_json", is_flag=True, help="Print one JSON value.")
def list_command(fleet_options: FleetOptions, as_json: bool) -> int:
    """Show the cells of a plant that are present, with their axes, newest incidents and recordings.

    It waits at most about one second for the cells' values. A value older than a second is unknown. The exit code is 1 if no
    cell is found, or an endpoint is not reached.
    """
    with fleet_options.fleet() as fleet:
        cells = list(fleet)
        found = dict(zip(cells, _recordings(cells), strict=True))
        if as_json:
            say_json([plain(cell, recordings) for cell, recordings in found.items()])
        else:
            for cell, recordings in found.items():
                say("\n".join(cell_lines(cell, recordings)))
        unreached = fleet.unreachable_endpoints
    for endpoint in unreached:
        say_note(unreached_text(endpoint))
    if not cells and not as_json:
        say(
            f"no cell of plant {fleet_options.plant} was found: check that its bridges run, and their endpoints"
        )
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


# -- ``axisbus fleet watch``: observe the cells of a plant -------------------------------------------------------------


_REPAINTED, _PRINTED = 0.25, 1.0  # seconds between two updates
_RECORDINGS = 10.0  # seconds between two queries for recordings


@click.command("watch")
@plant_options
@click.option(
    "--every",
    type=Seconds(0.05),
    help=f"Seconds between two updates  [default: {_PRINTED:g}; {_REPAINTED:g} in a terminal]",
)
@click.option("--count", type=click.IntRange(min=1), help="Number of updates; without it, until Ctrl-C.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON value per update.")
def watch_command(fleet_options: FleetOptions, every: float | None, count: int | None, as_json: bool) -> int:
    """Show the cells of a plant, their axes, newest incidents and recordings until Ctrl-C; commands nothing.

    When a cell is lost, it is shown as GONE, and its values as unknown, within about a second. "age" is the age of a value by
    the clock of the cell's computer, plus its delay beyond that of the promptest messages, plus the time since this computer
    received it: clocks are not compared. On a terminal the output is one table, which is updated in place.
    """
    live = coloured() and not as_json
    pause = every if every is not None else _REPAINTED if live else _PRINTED
    with fleet_options.fleet() as fleet, _RecordingsCache(fleet) as recordings_cache:
        if live:
            from axisbus.cli.fleet.live import show

            show(
                lambda: [(cell, recordings_cache.of(cell)) for cell in fleet],
                lambda: [f"plant {fleet_options.plant}", *map(unreached_text, fleet.unreachable_endpoints)],
                pause,
                count,
            )
            return OK
        for _ in rounds(count, lambda: time.sleep(pause)):
            _print_update(fleet, recordings_cache, as_json)
    return OK


def _print_update(fleet: Fleet, recordings_cache: _RecordingsCache, as_json: bool) -> None:
    if as_json:
        say_json([plain(cell, recordings_cache.of(cell)) for cell in fleet])
        return
    say(f"plant {fleet.plant}, {time.strftime('%H:%M:%S')}: {counted(len(fleet), 'cell')}")
    for endpoint in fleet.unreachable_endpoints:
        say(unreached_text(endpoint))
    for cell in fleet:
        say("\n".join(cell_lines(cell, recordings_cache.of(cell))))


class _RecordingsCache:
    """The recordings of all cells, queried periodically in a thread, so that a slow cell does not delay the display."""

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet
        self._found: dict[str, Recordings] = {}
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def __enter__(self) -> _RecordingsCache:
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


# -- ``axisbus fleet stop``: quick-stop all axes of a plant, and report which cells have confirmed it ------------------


_WAIT = 5.0  # seconds
_SEARCH_TIME, _STEP = 1.0, 0.01  # seconds of the search for cells, and between its steps


@click.command("stop")
@click.argument("cells", nargs=-1, metavar="[CELL]...")
@plant_options
@click.option(
    "--wait",
    "seconds",
    type=Seconds(0.1),
    default=_WAIT,
    show_default=True,
    help="Seconds within which cells must confirm.",
)
def stop_command(cells: tuple[str, ...], fleet_options: FleetOptions, seconds: float) -> int:
    """Quick-stop all axes of all cells of a plant, or of the named cells, whichever program has control.

    For each cell it shows whether the cell has confirmed that its drives have stopped. The exit code is 3 if a cell has not, or
    an endpoint is not reached, and 1 if no cell is found. It is not a safety function.
    """
    with fleet_options.fleet(look=0.0) as fleet:
        handles = _stop(fleet, tuple(dict.fromkeys(cells)))
        deadline = time.monotonic() + seconds
        confirmed = [_confirmed(name, handles[name], deadline) for name in sorted(handles)]
        unreached = [] if cells else fleet.unreachable_endpoints
    for endpoint in unreached:
        say(f"NOT REACHED: {endpoint}: its cells were not stopped; use the stop devices at the machine")
    if unreached:
        return FAILURE
    if not confirmed:
        say_error(
            f"no cell of plant {fleet_options.plant} was found, so none was stopped: use the stop devices at the machines"
        )
        return WRONG
    return OK if all(confirmed) else FAILURE


def _stop(fleet: Fleet, names: Sequence[str]) -> dict[str, Handle]:
    """Stop each cell as soon as it is found, and named cells in any case; return the handles by cell."""
    handles: dict[str, Handle] = {}
    named, end = [fleet.any_cell(name) for name in names], time.monotonic() + _SEARCH_TIME
    while time.monotonic() < end and not (names and len(handles) == len(names)):
        for cell in named or fleet:
            if cell.name not in handles and cell.alive:
                handles[cell.name] = cell.quick_stop()
        time.sleep(_STEP)
    return handles | {cell.name: cell.quick_stop() for cell in named if cell.name not in handles}


def _confirmed(name: str, handle: Handle, deadline: float) -> bool:
    """Wait for the end of a stop, and print its result."""
    mark_end_as_read(handle)
    try:
        handle.wait(max(0.0, deadline - time.monotonic()))
    except TimeoutError:
        say(f"{name}: NOT CONFIRMED: no answer in time; use the stop devices at the machine")
    except AxisbusError as error:
        say(f"{name}: NOT CONFIRMED: {said_of(error)}")
    else:
        say(f"{name}: stopped{f' ({handle.note})' if handle.note else ''}")
        return True
    return False
