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
from axisbus.motion.gantry.skew import SkewMonitor, actual_position_of, demand_position_of
from axisbus.motion.group.path_motion import PathMotion
from axisbus.motion.position_limits import count_range
from axisbus.units import INT32_HALF

_FAR = 0.25  # of half the INTEGER32 range: the distance of a velocity move without position limits


def end_of_move(command: g.GantryMove, first: AxisCore, last: float | None) -> float:
    """Return the beam's position at the end of a move; ``last``: the previous end position, None: none yet."""
    if command.reference is TargetReference.ABSOLUTE:
        return command.value
    base = actual_position_of(first)
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
    direction, here = math.copysign(1.0, velocity), demand_position_of(first)
    assert here is not None
    far = _FAR * INT32_HALF / max(abs(core.parameters.units.position.factor) for core in (first, second))
    ends = [here + direction * far]
    for core, more in ((first, 0.0), (second, square)):
        limits = core.parameters.limits.position
        if limits is not None and first.bounded and second.bounded:
            ends.append(limits[velocity > 0.0] - more)
        if core.parameters.units.modulo is None and core.image.position is not None:
            count = count_range(core.image.position)
            edges = sorted(core.parameters.units.position.to_units(end - core.image.origin) for end in count)
            ends.append(edges[velocity > 0.0] - more)
    end = min(ends, key=lambda position: position * direction)
    if (end - here) * direction <= 0.0:
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
    monitor: SkewMonitor,
    name: str,
) -> dict[str, float]:
    """Return the positions of both axes after one of them has moved by its distance, or until the beam is square.

    Raises:
        SkewError: the skew of the beam is unknown.
        LimitError: the beam would be farther out of square than the monitor's bound.
    """
    if monitor.skew is None:
        raise monitor.error(f"{name}: not begun")
    positions = {axis: demand_position_of(core) for axis, core in axes.items()}
    ends = {axis: position for axis, position in positions.items() if position is not None}
    if command.distance is not None:
        ends[command.axis] += command.distance
    elif command.axis == pair.first:
        ends[command.axis] = ends[pair.second] - monitor.square
    else:
        ends[command.axis] = ends[pair.first] + monitor.square
    skew = ends[pair.second] - ends[pair.first] - monitor.square
    if abs(skew) > monitor.bound:
        raise LimitError(
            f"{name}: the beam would be {abs(skew):.6g} {monitor.unit} out of square; {monitor.bound:.6g} are allowed",
            observed=monitor.positions_text,
            remedy="command a shorter move, or a move in the other direction",
        )
    return ends


# -- A beam that moves at a velocity until another command comes, on a line whose end is far away ----------------------


_REACHED = 1e-6  # of the velocity


class GantryVelocityMove:
    """Holds the velocity command with its present velocity, its ticket, which is done at that velocity, and that of the line.

    ``motion`` continues until another command comes; None if it has not begun.
    """

    def __init__(
        self,
        command: g.GantryVelocity,
        ticket: CommandStatus,
        inner: CommandStatus,
        motion: PathMotion | None,
    ) -> None:
        """``inner``: the ticket of ``motion``."""
        self.command, self.motion = command, motion
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
        motion = self.motion
        if (
            self.over
            or motion is None
            or not motion.planned
            or motion.travel.braking
            or velocity * self.command.velocity <= 0.0
        ):
            return False
        self._end_for(ticket.name)
        motion.travel.velocity *= velocity / self.command.velocity
        self.command, self._ticket = replace(self.command, velocity=velocity), ticket
        ticket.begin()
        return True

    def end_replaced(self, name: str) -> None:
        """End a ticket that is still open: with the line's result if the line has ended, else as replaced by command ``name``."""
        self.step()
        self._end_for(name)

    def step(self) -> bool:
        """Once per cycle: end the ticket if the velocity is reached or the line has ended; return whether it ended."""
        if not self._ticket.busy:
            return False
        motion = self.motion
        if self.over:
            error = self._inner.error or self._too_short()
            self._ticket.finish(end_as(error), error)
        elif motion is not None and motion.planned and motion.travel.factor > 0.0:
            wanted = motion.travel.velocity * motion.travel.factor
            if abs(motion.travel.speed - wanted) <= _REACHED * wanted or self._is_at_path_limit(
                motion, wanted
            ):
                self._ticket.finish(Status.DONE)
        return not self._ticket.busy

    def _end_for(self, name: str) -> None:
        self._ticket.finish(Status.ABORTED, Replaced(f"{self.name} was replaced by {name}"))

    def _is_at_path_limit(self, motion: PathMotion, wanted: float) -> bool:
        return wanted > motion.top >= motion.travel.speed >= (1.0 - _REACHED) * motion.top

    def _too_short(self) -> LimitError:
        return LimitError(
            f"{self.name}: the beam stopped at its position limit before it reached the velocity",
            remedy="begin farther away from the limit, or command less velocity or more acceleration",
        )
