"""``axisbus torque``: enable axes and apply torques."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus.cli.shared.attach_or_open import take_option
from axisbus.cli.shared.axes_and_pairs import Mover
from axisbus.cli.shared.completion import complete_targets
from axisbus.cli.shared.options import beside_option, parse_targets
from axisbus.cli.shared.paths import PATH
from axisbus.cli.shared.recordings import record_option
from axisbus.cli.shared.timed_motion import TimedMotion, for_option
from axisbus.errors import StateError
from axisbus.machine.axis import Axis


@click.command("torque")
@click.argument("cell", type=PATH)
@click.argument("targets", nargs=-1, required=True, metavar="AXIS=TORQUE...", shell_complete=complete_targets)
@click.option("--slope", type=float, help="Slope in N·m/s, instead of the axes' defaults.")
@for_option
@record_option
@beside_option
@take_option
def command(
    cell: Path,
    targets: tuple[str, ...],
    slope: float | None,
    seconds: float | None,
    record: Path | None,
    beside: bool,
    take: bool,
) -> int:
    """Enable axes of CELL and apply a torque in profile torque mode: axisbus torque cell.toml x=0.5 --for 2s

    MOVES REAL MOTORS: an axis that no load holds back accelerates up to the drive's velocity limit. It ends after the given time,
    or at Ctrl-C; then the axes are stopped and disabled. Torques in N·m; the axis needs rated_torque in CELL.
    """
    return TimedMotion(
        "torque",
        parse_targets(targets, "TORQUE"),
        lambda mover, value: _axis(mover).torque_control(value, slope=slope),
        lambda _: "N·m",
    ).run(cell, seconds, record=record, beside=beside, take=take)


def _axis(mover: Mover) -> Axis:
    """Return an axis.

    Raises:
        StateError: the name is a pair.
    """
    if isinstance(mover, Axis):
        return mover
    raise StateError(
        f"{mover.name}: a pair cannot be moved by a torque: each of its two axes would move independently",
        remedy="move it: axisbus move, or axisbus velocity",
    )
