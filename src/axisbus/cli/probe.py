"""``axisbus probe``: print the position of an axis at each edge of its touch probe."""

from __future__ import annotations

import time
from pathlib import Path

import click

from axisbus.check.run import checked
from axisbus.cli.shared.attach_or_open import machine_of, take_option
from axisbus.cli.shared.common import OK, WRONG, say
from axisbus.cli.shared.completion import complete_axes
from axisbus.cli.shared.options import PATH, Seconds, beside_option
from axisbus.machine.dry_run import DryRun
from axisbus.machine.probing import ProbeHandle, ProbeResult

_POLL_PERIOD = 0.2  # seconds
_ARMED = 30.0  # seconds: a refused or unanswered request ends earlier


@click.command("probe")
@click.argument("cell", type=PATH)
@click.argument("axis", shell_complete=complete_axes)
@click.option(
    "--input", "number", type=click.IntRange(1, 2), default=1, help="Which touch probe; 1 if not given."
)
@click.option(
    "--edge",
    type=click.Choice(["rising", "falling", "both"]),
    default="rising",
    help="Which edges; rising if not given.",
)
@click.option("--zero-pulse", is_flag=True, help="Use the zero pulse of the encoder instead of the input.")
@click.option(
    "--for", "seconds", type=Seconds(0.0), help="End after this many seconds; without it, at Ctrl-C."
)
@beside_option
@take_option
def command(
    cell: Path,
    axis: str,
    number: int,
    edge: str,
    zero_pulse: bool,
    seconds: float | None,
    beside: bool,
    take: bool,
) -> int:
    """Boot CELL and show the position of AXIS at each edge of its touch probe: axisbus probe cell.toml x --edge both --for 10s

    It moves and energises nothing: turn the axis by hand, or touch the sensor. Exit code 1 if there was no edge.
    """
    rehearsal = DryRun(checked(cell))
    given = (number, edge)
    source = "zero pulse" if zero_pulse else "input"
    rehearsal[axis].probe(
        *given, continuous=True, source=source
    )  # report impossible requests before the bus is opened
    with machine_of(cell, command=True, take=take, beside=beside) as machine:
        unit = machine[axis].unit
        probe = machine[axis].probe(*given, continuous=True, source=source).wait_armed(_ARMED)
        say(f"{axis}: touch probe {number} is armed")
        count = _print_edges(probe, axis, unit, seconds)
        probe.cancel().wait(_ARMED)
    return OK if count else WRONG


def _print_edges(probe: ProbeHandle, axis: str, unit: str, seconds: float | None) -> int:
    """Print each edge until the time is over; return the number of edges."""
    count, until = 0, None if seconds is None else time.monotonic() + seconds
    while until is None or time.monotonic() < until:
        try:
            edge = probe.next(
                _POLL_PERIOD if until is None else min(_POLL_PERIOD, max(0.0, until - time.monotonic()))
            )
        except TimeoutError:
            continue
        count += 1
        say(f"{axis}: {_line(edge, unit)}")
    if not count:
        say(f"{axis}: no edge")
    return count


def _line(edge: ProbeResult, unit: str) -> str:
    missed = f", after {edge.missed} that were too fast to be reported" if edge.missed else ""
    return f"{edge.edge} edge at {edge.position:.4f} {unit}{missed}"
