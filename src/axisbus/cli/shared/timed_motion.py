"""Common parts of ``axisbus velocity`` and ``axisbus torque``: axes and pairs that move for a time, or until Ctrl-C."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import click

from axisbus import wait
from axisbus.check.run import checked
from axisbus.cli.shared.axes_and_pairs import Mover, all_axes, movers, sides_of
from axisbus.cli.shared.common import say
from axisbus.cli.shared.enabled_axes import commanded, enable, say_position
from axisbus.cli.shared.numbers import Seconds
from axisbus.cli.shared.progress import MoverProgress, draw, follow, speed_text
from axisbus.cli.shared.recordings import recorded
from axisbus.errors import StateError
from axisbus.machine.axis import Axis
from axisbus.machine.dry_run import DryRun
from axisbus.machine.handle import Handle
from axisbus.machine.machine import Machine
from axisbus.motion.states import AxisState

_TURNING = (AxisState.CONTINUOUS_MOTION, AxisState.SYNCHRONIZED_MOTION)  # alone, and as an axis of a pair
_LOOK = 0.1  # seconds
_HOLD = 0.5  # seconds after which the core halts the axes if this command no longer runs, for example suspended (Ctrl-Z)
_Function = TypeVar("_Function", bound=Callable[..., object])


def for_option(function: _Function) -> _Function:
    """Add --for: the seconds after which the axes are halted."""
    return click.option(
        "--for", "seconds", type=Seconds(0.0), help="Halt after so many seconds; without it, at Ctrl-C."
    )(function)


@dataclass(frozen=True, slots=True)
class TimedMotion:
    """Axes and pairs by name with their set values; ``begin`` gives one its command, ``unit`` follows the number.

    ``verb``: the command's name.
    """

    verb: str
    wanted: Mapping[str, float]
    begin: Callable[[Mover, float], Handle]
    unit: Callable[[Mover], str]

    def run(self, cell: Path, seconds: float | None, *, record: Path | None, beside: bool, take: bool) -> int:
        """Enable the axes, move them, halt them, and restore their previous state."""
        config = checked(cell)
        sides = sides_of(config, self.wanted, self.verb)
        self._rehearse(DryRun(config))  # report impossible requests before the bus is opened
        with (
            commanded(cell, sides, take=take, beside=beside) as (machine, _),
            recorded(machine, record) as recording,
        ):
            known = {name: facts.parameters for name, facts in machine.session.axes.items()}
            self._rehearse(DryRun(config, known))  # with the values of the drives, before they are enabled
            chosen = movers(machine, self.wanted)
            enable(chosen)
            follow(
                machine, [MoverProgress(each, self.begin(each, self.wanted[each.name])) for each in chosen]
            )
            for each in chosen:
                say(f"{each.name}: has {self.wanted[each.name]:g} {self.unit(each)}")
            _keep(machine, chosen, seconds)
            wait([each.halt() for each in chosen])
            for each in chosen:
                say_position(each, "stands at")
        return recording.code

    def _rehearse(self, rehearsal: DryRun) -> None:
        for each in movers(rehearsal, self.wanted):
            self.begin(each, self.wanted[each.name])


def _keep(machine: Machine, chosen: Sequence[Mover], seconds: float | None) -> None:
    """Keep them moving.

    Raises:
        AxisbusError: one has stopped without a command.
    """
    until = None if seconds is None else time.monotonic() + seconds
    try:
        while until is None or time.monotonic() < until:
            machine.hold_to_run(_HOLD)
            left = _LOOK if until is None else min(_LOOK, max(0.0, until - time.monotonic()))
            machine.sleep(left)
            for axis in all_axes(chosen):
                _require_turning(axis)
            draw("; ".join(speed_text(each) for each in chosen))
    finally:
        machine.hold_to_run(None)
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
