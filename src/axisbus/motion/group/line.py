"""A straight line of a group under way: its axes' followers, the way from 0 to 1 that they share, and their common clock."""

from __future__ import annotations

from collections.abc import Mapping

from axisbus.motion.axis.core import AxisCore
from axisbus.motion.group.commands import MoveLinear
from axisbus.motion.group.gate import Gate
from axisbus.motion.group.path import plan_line
from axisbus.motion.group.pathclock import PathClock
from axisbus.motion.moves.follow import Follow
from axisbus.motion.trajectory import Trapezoid


class Line:
    """Holds the clock, which goes on for as long as any axis is led along the line, whatever has become of the command."""

    def __init__(self, command: MoveLinear, axes: Mapping[str, AxisCore], gate: Gate) -> None:
        """``axes``: those of the group, by name."""
        self._command = command
        self._axes = {name: axes[name] for name in command.ends}
        self._clock = PathClock()
        self._way = Trapezoid(0.0, 0.0, 1.0, 1.0)
        self.planned = False
        self.follows = {
            name: Follow(None, core.parameters, gate, self._clock, brake=self._brake)
            for name, core in self._axes.items()
        }

    def step(self, period: float, begins: bool, name: str) -> None:
        """Plan as soon as it ``begins`` (all wait where they stand), then go on by one cycle of ``period`` seconds.

        Raises:
            LimitError: there is no such line (see ``plan_line``); ``name`` says in its text what was asked for.
        """
        if self.planned:
            self._clock.advance(period)
        elif begins:
            self._plan(name)

    def leads(self) -> bool:
        """Whether any axis was led along the line since this was asked last."""
        led = [follow.take_stepped() for follow in self.follows.values()]
        return any(led)

    def _plan(self, name: str) -> None:
        starts = {axis: self._start(axis) for axis in self.follows}
        parameters = {axis: core.parameters for axis, core in self._axes.items()}
        command = self._command
        shares, self._way = plan_line(
            starts, command.ends, parameters, command.velocity, command.acceleration, name
        )
        for axis, share in shares.items():
            self.follows[axis].begin(share)
        self.planned = True

    def _start(self, name: str) -> float:
        core = self._axes[name]
        place = self.follows[name].reference(core.image) - core.image.origin
        return core.parameters.units.position.to_units(place)

    def _brake(self) -> None:
        """Slow all down together."""
        self._clock.brake(self._way.position, self._way.acceleration)
