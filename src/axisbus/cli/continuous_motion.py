"""The commands that move axes without an end: ``axisbus velocity`` and ``torque``."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import click

from axisbus import wait
from axisbus.check.run import checked
from axisbus.cli.shared.axes_and_pairs import Mover, all_axes, movers, sides_of
from axisbus.cli.shared.common import say
from axisbus.cli.shared.completion import complete_targets
from axisbus.cli.shared.enabled_axes import MotionOptions, commanded, enable, motion_options, say_position
from axisbus.cli.shared.options import PATH, Seconds, parse_targets
from axisbus.cli.shared.progress import MoverProgress, draw, follow, speed_text
from axisbus.cli.shared.recordings import recorded
from axisbus.errors import StateError
from axisbus.machine.axis import Axis
from axisbus.machine.dry_run import DryRun
from axisbus.machine.handle import Handle
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState

# ----------------------------------------------------------------------------------------------------------------------
# Common parts of ``axisbus velocity`` and ``axisbus torque``: axes and pairs that move for a time, or until Ctrl-C.

_TURNING = (AxisState.CONTINUOUS_MOTION, AxisState.SYNCHRONIZED_MOTION)  # alone, and as an axis of a pair


_POLL_PERIOD = 0.1  # seconds


_HOLD_TIME = 0.5  # seconds after which the core halts the axes if this command no longer runs, for example suspended (Ctrl-Z)


for_option = click.option(
    "--for", "seconds", type=Seconds(0.0), help="Halt after this many seconds; without it, at Ctrl-C."
)


@dataclass(frozen=True, slots=True)
class TimedMotion:
    """Axes and pairs by name with their set values; ``begin`` gives one its command, ``unit`` follows the number.

    ``verb``: the command's name.
    """

    verb: str
    wanted: Mapping[str, float]
    begin: Callable[[Mover, float], Handle]
    unit: Callable[[Mover], str]

    def run(self, cell: Path, seconds: float | None, how: MotionOptions) -> int:
        """Enable the axes, move them, halt them, and restore their previous state."""
        config = checked(cell)
        sides = sides_of(config, self.wanted, self.verb)
        self._rehearse(DryRun(config))  # report impossible requests before the bus is opened
        with (
            commanded(cell, sides, how) as (machine, _),
            recorded(machine, how.record) as recording,
        ):
            known = {name: facts.parameters for name, facts in machine.session.axes.items()}
            self._rehearse(DryRun(config, known))  # with the values of the drives, before they are enabled
            chosen = movers(machine, self.wanted)
            enable(chosen)
            try:
                self._begin(machine, chosen)
                _wait(machine, chosen, seconds)
                halts = [each.halt() for each in chosen]
            finally:  # not before the halts are given: until then nothing else ends the motion
                machine.hold_to_run(None)
            wait(halts)
            for each in chosen:
                say_position(each, "stands at")
        return recording.code

    def _begin(self, machine: Machine, chosen: Sequence[Mover]) -> None:
        """Start all, and wait until each has its set value. A ramp may be long: the core halts it, too, without this command."""
        machine.hold_to_run(_HOLD_TIME)
        progress = [MoverProgress(each, self.begin(each, self.wanted[each.name])) for each in chosen]
        follow(machine, progress, _HOLD_TIME)
        for each in chosen:
            say(f"{each.name}: has {self.wanted[each.name]:g} {self.unit(each)}")

    def _rehearse(self, rehearsal: DryRun) -> None:
        for each in movers(rehearsal, self.wanted):
            self.begin(each, self.wanted[each.name])


def _wait(machine: Machine, chosen: Sequence[Mover], seconds: float | None) -> None:
    """Keep them moving.

    Raises:
        AxisbusError: one has stopped without a command.
    """
    until = None if seconds is None else time.monotonic() + seconds
    try:
        while until is None or time.monotonic() < until:
            machine.hold_to_run(_HOLD_TIME)
            remaining = (
                _POLL_PERIOD if until is None else min(_POLL_PERIOD, max(0.0, until - time.monotonic()))
            )
            machine.sleep(remaining)
            for axis in all_axes(chosen):
                _require_turning(axis)
            draw("; ".join(speed_text(each) for each in chosen))
    finally:
        draw("")


def _require_turning(axis: Axis) -> None:
    if axis.state in _TURNING:
        return
    if axis.error is not None:
        raise axis.error
    raise StateError(
        f"{axis.name}: the motion ended early",
        observed=f"it is in {axis.state.value}",
        remedy="check which other program commands or halts it: axisbus monitor",
    )


# -- ``axisbus velocity``: enable axes and move them at constant velocities --------------------------------------------


@click.command("velocity")
@click.argument("cell", type=PATH)
@click.argument(
    "targets", nargs=-1, required=True, metavar="AXIS=VELOCITY...", shell_complete=complete_targets
)
@click.option("--acceleration", type=float, help="Acceleration in unit/s², instead of the axes' defaults.")
@for_option
@motion_options
def velocity_command(
    cell: Path,
    targets: tuple[str, ...],
    acceleration: float | None,
    seconds: float | None,
    how: MotionOptions,
) -> int:
    """Enable axes or pairs of CELL and move them at a velocity: axisbus velocity cell.toml x=30 y=-15 --for 5s

    MOVES REAL MOTORS until the time is over, or until Ctrl-C; then they are stopped and disabled. Velocities in unit/s.
    """
    return TimedMotion(
        "velocity",
        parse_targets(targets, "VELOCITY"),
        lambda mover, value: mover.move_velocity(value, acceleration=acceleration),
        lambda mover: f"{mover.unit}/s",
    ).run(cell, seconds, how)


# -- ``axisbus torque``: enable axes and apply torques -----------------------------------------------------------------


@click.command("torque")
@click.argument("cell", type=PATH)
@click.argument("targets", nargs=-1, required=True, metavar="AXIS=TORQUE...", shell_complete=complete_targets)
@click.option("--slope", type=float, help="Slope in N·m/s, instead of the axes' defaults.")
@for_option
@motion_options
def torque_command(
    cell: Path, targets: tuple[str, ...], slope: float | None, seconds: float | None, how: MotionOptions
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
    ).run(cell, seconds, how)


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
