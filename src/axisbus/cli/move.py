"""``axisbus move``: enable axes and move them to positions."""

from __future__ import annotations

from pathlib import Path

import click

from axisbus import wait
from axisbus.cli.common import OK, say, say_next
from axisbus.cli.options import beside_option, parse_targets
from axisbus.machine.machine import Machine
from axisbus.motion.axis import Axis
from axisbus.motion.handle import Handle


@click.command("move")
@click.argument("cell", type=click.Path(path_type=Path))
@click.argument("targets", nargs=-1, required=True, metavar="AXIS=POSITION...")
@click.option("--velocity", type=float, help="Velocity in unit/s, instead of the axes' defaults.")
@click.option("--acceleration", type=float, help="Acceleration in unit/s², instead of the axes' defaults.")
@click.option("--relative", is_flag=True, help="Move by these distances instead of to these positions.")
@click.option("--home", "home_first", is_flag=True, help="Home the axes first, as [axes.NAME.homing] says.")
@click.option(
    "--timeout", type=float, help="Seconds that each move may take, instead of the worked-out time."
)
@beside_option
def command(
    cell: Path,
    targets: tuple[str, ...],
    velocity: float | None,
    acceleration: float | None,
    relative: bool,
    home_first: bool,
    timeout: float | None,
    beside: bool,
) -> int:
    """Boot CELL, enable the axes named, move them, stop and disable them: axisbus move cell.toml x=90 y=-45 --velocity 30

    MOVES REAL MOTORS. Ctrl-C halts them, a second Ctrl-C is a quick stop. An axis with position limits must be homed in the same
    run (--home), unless cell.toml says required = false for it.
    """
    wanted = parse_targets(targets)
    with Machine.open(cell, beside=beside) as machine:
        axes = {name: machine[name] for name in wanted}
        enable(list(axes.values()))
        if home_first:
            home(list(axes.values()))
        moves = [
            _start(axis, wanted[name], relative, velocity, acceleration, timeout)
            for name, axis in axes.items()
        ]
        wait(moves)
        for axis in axes.values():
            say_position(axis, "at")
    say("all axes stand and are disabled")
    say_next(f"axisbus monitor {cell}")
    return OK


def enable(axes: list[Axis]) -> None:
    """Enable axes, with a line of progress."""
    wait([axis.enable() for axis in axes])
    say(f"enabled: {', '.join(axis.name for axis in axes)}")


def home(axes: list[Axis]) -> None:
    """Home axes, with lines of progress."""
    wait([axis.home() for axis in axes])
    for axis in axes:
        say_position(axis, "homed, at")


def say_position(axis: Axis, what: str) -> None:
    """Tell where an axis is, where that is known."""
    known = axis.snapshot.position is not None
    say(
        f"{axis.name}: {what} "
        + (f"{axis.position:.4f} {axis.unit}" if known else "a position that is not known")
    )


def _start(
    axis: Axis,
    value: float,
    relative: bool,
    velocity: float | None,
    acceleration: float | None,
    timeout: float | None,
) -> Handle:
    move = axis.move_relative if relative else axis.move_absolute
    handle = move(value, velocity=velocity, acceleration=acceleration, timeout=timeout)
    say(f"{axis.name}: moving {'by' if relative else 'to'} {value:g} {axis.unit}")
    return handle
