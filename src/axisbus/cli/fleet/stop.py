"""``axisbus fleet stop``: quick-stop all axes of a plant, and report which cells have confirmed it."""

from __future__ import annotations

import time
from collections.abc import Sequence

import click

from axisbus.cli.fleet.options import FleetOptions, plant_options
from axisbus.cli.shared.common import FAILURE, OK, WRONG, say, say_error
from axisbus.cli.shared.numbers import Seconds
from axisbus.errors import AxisbusError, said_of
from axisbus.fleet.fleet import Fleet
from axisbus.machine.handle import Handle, look_at_end

_WAIT = 5.0  # seconds
_LOOK, _STEP = 1.0, 0.01  # seconds of the search for cells, and between its steps


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
def command(
    cells: tuple[str, ...],
    place: FleetOptions,
    seconds: float,
) -> int:
    """Quick-stop all axes of all cells of a plant, or of the named cells, whichever program has control.

    For each cell it shows whether the cell has confirmed that its drives have stopped. The exit code is 3 if a cell has not, or
    an endpoint is not reached, and 1 if no cell is found. It is not a safety function.
    """
    with place.fleet(look=0.0) as fleet:
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
            f"no cell of plant {place.plant} was found, so none was stopped: use the stop devices at the machines"
        )
        return WRONG
    return OK if all(confirmed) else FAILURE


def _stop(fleet: Fleet, names: Sequence[str]) -> dict[str, Handle]:
    """Stop each cell as soon as it is found, and named cells in any case; return the handles by cell."""
    handles: dict[str, Handle] = {}
    named, end = [fleet.any_cell(name) for name in names], time.monotonic() + _LOOK
    while time.monotonic() < end and not (names and len(handles) == len(names)):
        for cell in named or fleet:
            if cell.name not in handles and cell.alive:
                handles[cell.name] = cell.quick_stop()
        time.sleep(_STEP)
    return handles | {cell.name: cell.quick_stop() for cell in named if cell.name not in handles}


def _confirmed(name: str, handle: Handle, deadline: float) -> bool:
    """Wait for the end of a stop, and print its result."""
    look_at_end(handle)
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
