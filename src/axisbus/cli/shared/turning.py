"""What ``axisbus velocity`` and ``axisbus torque`` share: axes that go on until their time is over, or Ctrl-C."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import click

from axisbus import wait
from axisbus.check.checked import checked
from axisbus.cli.shared.commanded import commanded, enable, say_position
from axisbus.cli.shared.common import OK, say
from axisbus.cli.shared.numbers import Seconds
from axisbus.cli.shared.recordings import recorded
from axisbus.cli.shared.underway import Way, draw, follow, speed_text
from axisbus.errors import StateError
from axisbus.machine.axis import Axis
from axisbus.machine.handle import Handle
from axisbus.machine.machine import Machine
from axisbus.machine.rehearsal import Rehearsal
from axisbus.motion.states import AxisState

_LOOK = 0.1  # seconds
_Function = TypeVar("_Function", bound=Callable[..., object])


def for_option(function: _Function) -> _Function:
    """Add --for: the seconds after which the axes are halted."""
    return click.option(
        "--for", "seconds", type=Seconds(0.0), help="Halt after so many seconds; without, at Ctrl-C."
    )(function)


@dataclass(frozen=True, slots=True)
class Turning:
    """Axes by name with what each is to keep; ``begin`` gives one its command, ``unit`` is what follows the number."""

    wanted: Mapping[str, float]
    begin: Callable[[Axis, float], Handle]
    unit: Callable[[Axis], str]

    def run(self, cell: Path, seconds: float | None, *, record: Path | None, beside: bool, take: bool) -> int:
        """Enable the axes, let them turn, halt them, and leave them as they were found."""
        config = checked(cell)
        self._rehearse(Rehearsal(config))  # what cannot be is told before the bus is opened
        with (
            commanded(cell, list(self.wanted), take=take, beside=beside) as (machine, axes),
            recorded(machine, record),
        ):
            known = {name: facts.parameters for name, facts in machine.session.axes.items()}
            self._rehearse(Rehearsal(config, known))  # what the drives alone know, before they are enabled
            enable(axes)
            follow(machine, [Way(axis, self.begin(axis, self.wanted[axis.name])) for axis in axes])
            for axis in axes:
                say(f"{axis.name}: has {self.wanted[axis.name]:g} {self.unit(axis)}")
            _keep(machine, axes, seconds)
            wait([axis.halt() for axis in axes])
            for axis in axes:
                say_position(axis, "stands at")
        return OK

    def _rehearse(self, rehearsal: Rehearsal) -> None:
        for name, value in self.wanted.items():
            self.begin(rehearsal[name], value)


def _keep(machine: Machine, axes: list[Axis], seconds: float | None) -> None:
    """Let them turn.

    Raises:
        AxisbusError: one has stopped by itself.
    """
    until = None if seconds is None else time.monotonic() + seconds
    try:
        while until is None or time.monotonic() < until:
            left = _LOOK if until is None else min(_LOOK, max(0.0, until - time.monotonic()))
            machine.sleep(left)
            for axis in axes:
                _require_turning(axis)
            draw("; ".join(speed_text(axis) for axis in axes))
    finally:
        draw("")


def _require_turning(axis: Axis) -> None:
    if axis.state is AxisState.CONTINUOUS_MOTION:
        return
    if axis.error is not None:
        raise axis.error
    raise StateError(
        f"{axis.name}: does not go on",
        observed=f"it is in {axis.state.value}",
        remedy="look who else commands or halts it: axisbus monitor",
    )
