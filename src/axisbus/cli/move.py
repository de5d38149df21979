"""``axisbus move``: enable axes and move them to positions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import click

from axisbus.check.run import checked
from axisbus.cli.shared.axes_and_pairs import Mover, has_drive, movers, sides_of
from axisbus.cli.shared.common import say, say_next
from axisbus.cli.shared.completion import complete_targets
from axisbus.cli.shared.enabled_axes import (
    MotionOptions,
    commanded,
    enable,
    home,
    motion_options,
    say_position,
)
from axisbus.cli.shared.options import PATH, Seconds, parse_targets
from axisbus.cli.shared.progress import MoverProgress, follow
from axisbus.cli.shared.recordings import recorded
from axisbus.machine.axis import Axis
from axisbus.machine.dry_run import DryRun
from axisbus.machine.handle import Handle


@click.command("move")
@click.argument("cell", type=PATH)
@click.argument(
    "targets", nargs=-1, required=True, metavar="AXIS=POSITION...", shell_complete=complete_targets
)
@click.option("--velocity", type=float, help="Velocity in unit/s, instead of the axes' defaults.")
@click.option("--acceleration", type=float, help="Acceleration in unit/s², instead of the axes' defaults.")
@click.option("--relative", is_flag=True, help="Move by these distances instead of to these positions.")
@click.option(
    "--home", "home_first", is_flag=True, help="Home the axes first, as their homing tables define."
)
@click.option(
    "--timeout", type=Seconds(), help="Time-out of each move in seconds, instead of the calculated time."
)
@motion_options
def command(
    cell: Path,
    targets: tuple[str, ...],
    velocity: float | None,
    acceleration: float | None,
    relative: bool,
    home_first: bool,
    timeout: float | None,
    how: MotionOptions,
) -> int:
    """Boot CELL, enable the axes or pairs named, move them, stop and disable them: axisbus move cell.toml x=90 y=-45 --velocity 30

    MOVES REAL MOTORS. Ctrl-C halts them, a second Ctrl-C is a quick stop. An axis with position limits must be homed in the same
    run (--home), unless cell.toml says required = false for it.
    """
    wanted = parse_targets(targets)
    config = checked(cell)
    sides = sides_of(config, wanted, "move")
    request = _MoveRequest(wanted, relative, velocity, acceleration, timeout)
    rehearsal = DryRun(config)

    def rehearse() -> None:
        request.rehearse(rehearsal, home_first)  # report impossible requests before the bus is opened

    with commanded(cell, sides, how, rehearse) as (machine, axes):
        for axis in axes:
            rehearsal.see(axis.name, axis.snapshot)
        rehearse()  # again with the actual positions, before any axis is enabled
        chosen = movers(machine, wanted)
        with recorded(machine, how.record) as recording:
            enable(chosen)
            if home_first:
                home(machine, [each for each in chosen if has_drive(config, each.name)])
            follow(machine, [MoverProgress(each, request.start(each)) for each in chosen])
            for each in chosen:
                say_position(each, "at")
    say_next(f"axisbus monitor {cell}")
    return recording.code


@dataclass(frozen=True, slots=True)
class _MoveRequest:
    """The requested motion: a position or distance for each axis, in units, and the velocity."""

    targets: Mapping[str, float]
    relative: bool
    velocity: float | None
    acceleration: float | None
    timeout: float | None

    def rehearse(self, rehearsal: DryRun, home_first: bool) -> None:
        """Check everything that is known so far; sends nothing.

        Raises:
            UserError: as the call itself.
        """
        for each in movers(rehearsal, self.targets):
            if home_first and has_drive(rehearsal.cell, each.name):
                each.home()
            self._move(each)

    def start(self, mover: Mover) -> Handle:
        """Start an axis or a pair, with a progress line."""
        handle = self._move(mover)
        how = "by" if self.relative else "to"
        say(f"{mover.name}: moving {how} {self.targets[mover.name]:g} {mover.unit}")
        return handle

    def _move(self, mover: Mover) -> Handle:
        target, velocity, acceleration = self.targets[mover.name], self.velocity, self.acceleration
        if isinstance(mover, Axis):
            move = mover.move_relative if self.relative else mover.move_absolute
            return move(target, velocity=velocity, acceleration=acceleration, timeout=self.timeout)
        if self.timeout is not None:
            raise click.UsageError(
                f"{mover.name}: --timeout does not apply to a gantry pair: the master calculates and monitors its path"
            )
        call = mover.move_relative if self.relative else mover.move_absolute
        return call(target, velocity=velocity, acceleration=acceleration)
