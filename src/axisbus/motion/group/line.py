"""A way of a group under way: its axes' followers, the way that they share, and their travel along it."""

from __future__ import annotations

import math
from collections.abc import Mapping

from axisbus.errors import AxisbusError, StateError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.group.along import Along, Share
from axisbus.motion.group.commands import MoveLinear, MovePath
from axisbus.motion.group.gate import Gate
from axisbus.motion.group.path import plan_line, window_of
from axisbus.motion.group.pieces import Place
from axisbus.motion.group.travel import Travel
from axisbus.motion.group.way import NOWHERE
from axisbus.motion.moves.follow import Follow
from axisbus.motion.override.factor import FASTER


class Line:
    """Holds the travel, which goes on for as long as any axis is led along the way, whatever has become of the command."""

    def __init__(
        self,
        command: MoveLinear | MovePath,
        axes: Mapping[str, AxisCore],
        gate: Gate,
        left: Line | None = None,
    ) -> None:
        """``axes``: those of the group, by name; ``left``: the same one, gone on with from where it was left."""
        self._command = command
        self._axes = {name: axes[name] for name in command.axes}
        self._left = left if left is not None and left.planned else None
        self._way, self._velocity, self._window = NOWHERE, 0.0, 1
        self.travel = Travel()
        self.planned: bool = False
        self.follows = {
            name: Follow(None, core.parameters, gate, self.travel) for name, core in self._axes.items()
        }

    @property
    def gives_up(self) -> AxisbusError | None:
        """Nothing that it would find itself."""
        return None

    @property
    def names(self) -> tuple[str, ...]:
        """The axes that it leads."""
        return tuple(self._axes)

    @property
    def is_at_its_end(self) -> bool:
        """Whether the last target has been given."""
        return self.planned and self.travel.t >= self._way.length

    def step(self, period: float, begins: bool, name: str) -> None:
        """Plan as soon as it ``begins`` (all wait where they stand), then go on by one cycle of ``period`` seconds.

        Raises:
            LimitError: there is no such line (see ``plan_line``); ``name`` says in its text what was asked for.
            StateError: the way does not begin where the axes stand.
        """
        if self.planned:
            self.travel.advance(period)
        elif begins:
            self._plan(name, period)

    def leads(self) -> bool:
        """Whether any axis was led along the way since this was asked last."""
        led = [follow.take_stepped() for follow in self.follows.values()]
        return any(led)

    def again(self, gate: Gate, group: Mapping[str, AxisCore], name: str) -> Line:
        """Return what goes on with it from where it was left.

        Raises:
            StateError: an axis is no longer there; ``name`` says in its text what was asked for.
        """
        line = Line(self._command, group, gate, self)
        if self.planned:
            line.require_near(self._way.at(self.travel.t), name, "is no longer where the way was left")
        return line

    def require_near(self, place: Place, name: str, what: str) -> None:
        """Raise StateError, which says ``what`` an axis does, where one does not stand at ``place``."""
        for (axis, core), there in zip(self._axes.items(), place, strict=True):
            units = core.parameters.units.position
            away, allowed = abs(self._start(axis) - there), abs(units.to_units(core.parameters.place_window))
            if away > allowed:
                places = ", ".join(f"{value:.6g}" for value in place)
                raise StateError(
                    f"{name}: {axis} {what}",
                    observed=f"it is {away:.6g} {units.unit} away from there, of which {allowed:.6g} {units.unit} are allowed",
                    remedy=f"go there first: group.move_direct(({places},)); or begin anew from where the axes stand",
                )

    def _plan(self, name: str, period: float) -> None:
        begin = self._take_way(name, period)
        here = tuple(self._start(axis) for axis in self._axes)
        along = Along(self._way, begin, here)
        for number, follow in enumerate(self.follows.values()):
            follow.begin(Share(along, number, FASTER * self._velocity))
        limits = [core.parameters.limits for core in self._axes.values()]
        way = along.eased(limits, FASTER * self._velocity)
        self.travel.begin(way, self._velocity, begin, self._window)
        self.planned = True

    def _take_way(self, name: str, period: float) -> float:
        """Find out which way it is, and how fast; return where on it to begin."""
        command, left = self._command, self._left
        if left is not None:
            self._way, self._velocity, self._window = left._way, left._velocity, left._window
            return left.travel.t
        if isinstance(command, MovePath):
            self._way, self._velocity = command.way, command.velocity
            self.require_near(self._way.at(0.0), name, "does not stand where the path begins")
            if len(self._way.tops) == 1:
                self._window = window_of(self._way, 1.0, command.jerk, period, name)
        else:
            starts = {axis: self._start(axis) for axis in self._axes}
            parameters = {axis: core.parameters for axis, core in self._axes.items()}
            self._way, self._velocity = plan_line(
                starts, command.ends, parameters, command.velocity, command.acceleration, name
            )
            unit = math.dist(self._way.at(0.0), self._way.at(1.0))
            self._window = window_of(self._way, unit, command.jerk, period, name)
        return 0.0

    def _start(self, name: str) -> float:
        core = self._axes[name]
        place = self.follows[name].reference(core.image) - core.image.origin
        return core.parameters.units.position.to_units(place)
