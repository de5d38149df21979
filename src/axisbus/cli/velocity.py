"""``axisbus velocity``: enable axes and move them at constant velocities."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus.cli.shared.attach_or_open import take_option
from axisbus.cli.shared.completion import complete_targets
from axisbus.cli.shared.options import beside_option, parse_targets
from axisbus.cli.shared.paths import PATH
from axisbus.cli.shared.recordings import record_option
from axisbus.cli.shared.timed_motion import TimedMotion, for_option


@click.command("velocity")
@click.argument("cell", type=PATH)
@click.argument(
    "targets", nargs=-1, required=True, metavar="AXIS=VELOCITY...", shell_complete=complete_targets
)
@click.option("--acceleration", type=float, help="Acceleration in unit/s², instead of the axes' defaults.")
@for_option
@record_option
@beside_option
@take_option
def command(
    cell: Path,
    targets: tuple[str, ...],
    acceleration: float | None,
    seconds: float | None,
    record: Path | None,
    beside: bool,
    take: bool,
) -> int:
    """Enable axes or pairs of CELL and move them at a velocity: axisbus velocity cell.toml x=30 y=-15 --for 5s

    MOVES REAL MOTORS until the time is over, or until Ctrl-C; then they are stopped and disabled. Velocities in unit/s.
    """
    return TimedMotion(
        "velocity",
        parse_targets(targets, "VELOCITY"),
        lambda mover, value: mover.move_velocity(value, acceleration=acceleration),
        lambda mover: f"{mover.unit}/s",
    ).run(cell, seconds, record=record, beside=beside, take=take)
