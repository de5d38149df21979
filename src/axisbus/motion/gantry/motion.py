"""End positions of a beam or of one side of it: of a move, of a velocity without an end, and of squaring; in the axes' unit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace

from axisbus.errors import AxisbusError, LimitError, Replaced
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus, Status, end_as
from axisbus.motion.commands import TargetReference
from axisbus.motion.gantry import commands as g
from axisbus.motion.gantry.parameters import GantryParameters
from axisbus.motion.gantry.skew import SkewMonitor, led_place_of, place_of
from axisbus.motion.group.path_motion import PathMotion
from axisbus.motion.position_limits import room_of_count
from axisbus.units import INT32_HALF

_FAR = 0.25  # of half the INTEGER32 range: the distance of a velocity move without position limits


def end_of_move(command: g.GantryMove, first: AxisCore, last: float | None) -> float:
    """Return the beam's position at the end of a move; ``last``: the previous end position, None: none yet."""
    if command.reference is TargetReference.ABSOLUTE:
        return command.value
    base = place_of(first)
    if command.reference is TargetReference.ADDITIVE and last is not None:
        base = last
    assert base is not None  # because the skew is known
    return base + command.value


def far_end(velocity: float, first: AxisCore, second: AxisCore, square: float, name: str) -> float:
    """Return the farthest position of the beam that its limits and the count of its drives permit.

    ``square``: position of the second axis minus that of the first if the beam is square; ``name``: the command's name.

    Raises:
        LimitError: the beam is at that position already, or beyond it.
    """
    way, here = math.copysign(1.0, velocity), led_place_of(first)
    assert here is not None
    far = _FAR * INT32_HALF / max(abs(core.parameters.units.position.factor) for core in (first, second))
    ends = [here + way * far]
    for core, more in ((first, 0.0), (second, square)):
        limits = core.parameters.limits.position
        if limits is not None and first.bounded and second.bounded:
            ends.append(limits[velocity > 0.0] - more)
        if core.parameters.units.modulo is None and core.image.position is not None:
            count = room_of_count(core.image.position)
            edges = sorted(core.parameters.units.position.to_units(end - core.image.origin) for end in count)
            ends.append(edges[velocity > 0.0] - more)
    end = min(ends, key=lambda place: place * way)
    if (end - here) * way <= 0.0:
        raise LimitError(
            f"{name}: the beam is at its position limit, or beyond it",
            observed=f"it is at {here:g}; the limit in that direction is {end:g}",
            remedy="move it in the other direction",
        )
    return end


def ends_of_squaring(
    command: g.GantrySquare,
    pair: GantryParameters,
    axes: Mapping[str, AxisCore],
    watch: SkewMonitor,
    name: str,
) -> dict[str, float]:
    """Return the positions of both axes after one of them has moved by its distance, or until the beam is square.

    Raises:
        SkewError: the skew of the beam is unknown.
        LimitError: the beam would be farther out of square than the monitor's bound.
    """
    if watch.skew is None:
        raise watch.error(f"{name}: not begun")
    places = {axis: led_place_of(core) for axis, core in axes.items()}
    ends = {axis: place for axis, place in places.items() if place is not None}
    if command.distance is not None:
        ends[command.axis] += command.distance
    elif command.axis == pair.first:
        ends[command.axis] = ends[pair.second] - watch.square
    else:
        ends[command.axis] = ends[pair.first] + watch.square
    left = ends[pair.second] - ends[pair.first] - watch.square
    if abs(left) > watch.bound:
        raise LimitError(
            f"{name}: the beam would be {abs(left):.6g} {watch.unit} out of square; {watch.bound:.6g} are allowed",
            observed=watch.places,
            remedy="command a shorter move, or a move in the other direction",
        )
    return ends


# -- A beam that moves at a velocity until another command comes, on a line whose end is far away ----------------------


_REACHED = 1e-6  # of the velocity


class GantryVelocityMove:
    """Holds the velocity command with its present velocity, its ticket, which is done at that velocity, and that of the line.

    ``line`` continues until another command comes; None if it has not begun.
    """

    def __init__(
        self, command: g.GantryVelocity, ticket: CommandStatus, inner: CommandStatus, line: PathMotion | None
    ) -> None:
        """``inner``: the ticket of ``line``."""
        self.command, self.line = command, line
        self._ticket, self._inner = ticket, inner
        ticket.begin()

    @property
    def name(self) -> str:
        """The name of the command."""
        return self._ticket.name

    @property
    def over(self) -> bool:
        """Whether the line has ended."""
        return not self._inner.busy

    def abandon(self, error: AxisbusError) -> None:
        """End the ticket with ``error``."""
        self._ticket.finish(Status.ERROR, error)

    def change(self, velocity: float, ticket: CommandStatus) -> bool:
        """Change the velocity in the same direction, with the same acceleration; return False if that is impossible."""
        line = self.line
        if (
            self.over
            or line is None
            or not line.planned
            or line.travel.braking
            or velocity * self.command.velocity <= 0.0
        ):
            return False
        self._end_for(ticket.name)
        line.travel.velocity *= velocity / self.command.velocity
        self.command, self._ticket = replace(self.command, velocity=velocity), ticket
        ticket.begin()
        return True

    def make_way(self, name: str) -> None:
        """End a ticket that is still open: with the line's result if the line has ended, else as replaced by command ``name``."""
        self.step()
        self._end_for(name)

    def step(self) -> bool:
        """Once per cycle: end the ticket if the velocity is reached or the line has ended; return whether it ended."""
        if not self._ticket.busy:
            return False
        line = self.line
        if self.over:
            error = self._inner.error or self._too_short()
            self._ticket.finish(end_as(error), error)
        elif line is not None and line.planned and line.travel.factor > 0.0:
            wanted = line.travel.velocity * line.travel.factor
            if abs(line.travel.speed - wanted) <= _REACHED * wanted or self._as_fast_as_it_may(line, wanted):
                self._ticket.finish(Status.DONE)
        return not self._ticket.busy

    def _end_for(self, name: str) -> None:
        self._ticket.finish(Status.ABORTED, Replaced(f"{self.name} was replaced by {name}"))

    def _as_fast_as_it_may(self, line: PathMotion, wanted: float) -> bool:
        return wanted > line.top >= line.travel.speed >= (1.0 - _REACHED) * line.top

    def _too_short(self) -> LimitError:
        return LimitError(
            f"{self.name}: the beam stopped at its position limit before it reached the velocity",
            remedy="begin farther away from the limit, or command less velocity or more acceleration",
        )
