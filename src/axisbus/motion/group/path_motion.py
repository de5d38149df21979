"""The motion of a group along a path: the axes' followers, the path that they share, and the position along it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from axisbus.errors import AxisbusError, StateError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.blending.append_path import ActivePath, PathContinuation, going_of, joined
from axisbus.motion.command_status import CommandEnds, CommandStatus
from axisbus.motion.group.commands import MoveLinear, MovePath
from axisbus.motion.group.path import NOWHERE, Path, least
from axisbus.motion.group.path_builder import plan_line, window
from axisbus.motion.group.path_speed import PathSpeed
from axisbus.motion.group.segments import Place, Straight
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.follow import Follow
from axisbus.motion.override import FASTER
from axisbus.motion.parameters import AxisLimits

_NEAR = 1e-6  # units: end points no farther apart count as equal
MOST = 2000  # segments (lines and corners) ahead; a path that would exceed this is rejected


class _Coming(NamedTuple):
    """A path to append to this one, the ticket that ends at the transition, and the ticket of the appended path."""

    following: PathContinuation
    ticket: CommandStatus
    next_ticket: CommandStatus


class PathMotion:
    """Holds the position along the path, and advances it while any axis is commanded along the path, even if the command ended."""

    def __init__(
        self,
        command: MoveLinear | MovePath,
        axes: Mapping[str, AxisCore],
        gate: StartBarrier,
        left: PathMotion | None = None,
    ) -> None:
        """``axes``: the axes of the group, by name; ``left``: the interrupted motion that this one resumes."""
        self._command = command
        self._axes = {name: axes[name] for name in command.axes}
        self._left = left if left is not None and left.planned else None
        self._way, self._velocity, self._window = NOWHERE, 0.0, 1
        self._going: ActivePath | None = None  # set when another command has been appended
        self._along: PathPosition | None = None
        self._unit = 1.0  # length of path position 1 in the axes' units
        self._period = 0.0
        self._coming: list[_Coming] = []  # paths appended before this one was planned
        self._milestones = CommandEnds()
        self._news = False
        self.travel = PathSpeed()
        self.planned: bool = False
        self.follows = {
            name: Follow(None, core.path_parameters, gate, self.travel) for name, core in self._axes.items()
        }

    @property
    def gives_up(self) -> AxisbusError | None:
        """None: a path does not stop its motion of its own accord."""
        return None

    @property
    def names(self) -> tuple[str, ...]:
        """The axes that move along the path."""
        return tuple(self._axes)

    @property
    def is_at_its_end(self) -> bool:
        """Whether the last target has been sent."""
        return self.planned and self.travel.t >= self._way.length

    @property
    def top(self) -> float:
        """The highest path speed that all speed zones allow."""
        return min(self._way.tops)

    def brake_hard(self) -> None:
        """Let a braking motion use the highest deceleration that all its axes permit, or the path's own if that is higher.

        Hard braking drops the limit of jerk. This applies only to a straight line: in a corner the axes also need acceleration for
        the change of direction.
        """
        share = max(self._way.shares, default=0.0)
        straight = isinstance(self._command, MoveLinear) and self._going is None
        if self.planned and straight and share > 0.0:
            self.travel.hard = min(_hardest(core) for core in self._axes.values()) / share

    def step(self, period: float, begins: bool, name: str) -> None:
        """Plan the path as soon as it ``begins``; afterwards advance by one cycle of ``period`` seconds. Until then all axes wait.

        Raises:
            LimitError: the line is impossible (see ``plan_line``); ``name`` is the command's name in the message.
            StateError: an axis is not at the start of the path.
        """
        if self.planned:
            self.travel.advance(period)
            if self._milestones:
                self._news = self._milestones.pass_to(self.travel.t) or self._news
        elif begins:
            self._plan(name, period)
            coming, self._coming = self._coming, []
            for each in coming:
                self._join(*each)

    def leads(self) -> bool:
        """Return whether any axis was commanded along the path since the last call."""
        led = [follow.take_stepped() for follow in self.follows.values()]
        return any(led)

    @property
    def commands(self) -> int:
        """The number of commands that share the path and have not ended."""
        return 1 + len(self._milestones)

    @property
    def pieces(self) -> int:
        """An upper bound of the number of segments (lines and corners) ahead."""
        return len(self._way.pieces) + sum(len(following.way.pieces) for following, *_ in self._coming)

    def why_not(self, following: PathContinuation) -> str:
        """Return why another path cannot be appended without a stop; "" if it can."""
        if self._is_soft:
            return "the present motion has a jerk limit, with which a corner cannot be blended"
        way = self._last_way
        if way is not None and not isinstance(way.pieces[-1], Straight):
            return "the present motion does not end in a straight line, so its end cannot be rounded"
        if math.dist(self._last_place, following.way.at(0.0)) > _NEAR:
            return "it does not begin at the end of the present motion"
        return ""

    @property
    def _is_soft(self) -> bool:
        command = self._command
        return command.window > 1 if isinstance(command, MovePath) else command.jerk is not None

    @property
    def _last_way(self) -> Path | None:
        """The last path of the motion; None if it is not known yet."""
        if self._coming:
            return self._coming[-1].following.way
        if self.planned:
            return self._way
        if self._left is not None:
            return self._left._way
        return self._command.way if isinstance(self._command, MovePath) else None

    @property
    def _last_place(self) -> Place:
        """The end point of the motion, in units."""
        way = self._last_way
        if way is not None:
            return way.at(way.length)
        assert isinstance(self._command, MoveLinear)
        return tuple(self._command.ends.values())

    def join(self, following: PathContinuation, ticket: CommandStatus, next_ticket: CommandStatus) -> None:
        """Append another path to the end of this one. ``ticket`` ends at the transition, then ``next_ticket`` takes over."""
        self._milestones.add(ticket, next_ticket)
        if self.planned:
            self._join(following, ticket, next_ticket)
        else:
            self._coming.append(_Coming(following, ticket, next_ticket))

    def take_news(self) -> bool:
        """Return whether a command that shares the path has ended since the last call."""
        news, self._news = self._news, False
        return news

    def _join(self, following: PathContinuation, ticket: CommandStatus, next_ticket: CommandStatus) -> None:
        going, along = self._going or self._in_units(), self._along
        assert along is not None
        limits = [core.parameters.limits for core in self._axes.values()]
        found = joined(going, self.travel, following, limits, self._period, along.ease(self.travel.t))
        self._going, self._way = found.going, found.going.way
        self._velocity = max(self._velocity, following.velocity)
        self.travel.take(self._way, self._going.asked)
        along.scale(self._way, 1.0)
        self._follow_along(along)
        self._milestones.mark(ticket, found.mark)
        next_ticket.note = found.told

    def _in_units(self) -> ActivePath:
        """Convert path positions to the axes' units, as appended paths use them."""
        along, by = self._along, self._unit
        assert along is not None
        self._way = along.way  # slower than as planned, while the offset of the start is removed
        if by != 1.0:
            self._way, self._velocity, self._unit = along.way.larger(by), self._velocity * by, 1.0
            self.travel.scale(self._way, by)
            along.scale(self._way, by)
        return going_of(self._way, self._velocity)

    def _follow_along(self, along: PathPosition) -> None:
        """Give the new path to the axes that still follow this motion."""
        for number, follow in enumerate(self.follows.values()):
            if follow.clock is self.travel:
                follow.begin(AxisPathShare(along, number, FASTER * self._velocity))

    def again(self, gate: StartBarrier, group: Mapping[str, AxisCore], name: str) -> PathMotion:
        """Return a motion that resumes this one from the position where it was interrupted.

        Raises:
            StateError: an axis is no longer at that position; ``name`` is the command's name in the message.
        """
        line = PathMotion(self._command, group, gate, self)
        if self.planned:
            line.require_near(
                self._way.at(self.travel.t),
                name,
                ("is no longer at the position at which the path was interrupted"),
            )
        return line

    def require_near(self, place: Place, name: str, what: str) -> None:
        """Raise StateError if an axis is not at ``place``, within its position window; ``what`` is the message's predicate."""
        for (axis, core), there in zip(self._axes.items(), place, strict=True):
            units = core.parameters.units.position
            away, allowed = abs(self._start(axis) - there), abs(units.to_units(core.parameters.place_window))
            if away > allowed:
                places = ", ".join(f"{value:.6g}" for value in place)
                raise StateError(
                    f"{name}: {axis} {what}",
                    observed=f"it is {away:.6g} {units.unit} away from there, {allowed:.6g} {units.unit} are allowed",
                    remedy=(
                        f"go there first: group.move_direct(({places},)); or begin again at the present position of the "
                        "axes"
                    ),
                )

    def _plan(self, name: str, period: float) -> None:
        begin = self._take_way(name, period)
        here = tuple(self._start(axis) for axis in self._axes)
        self._along = along = PathPosition(self._way, begin, here)
        self._follow_along(along)
        limits = [core.parameters.limits for core in self._axes.values()]
        self._period, along.way = period, along.eased(limits, FASTER * self._velocity)
        self.travel.begin(along.way, self._velocity, begin, self._window)
        if self._going is not None:
            self._going = self._going._replace(way=along.way)
            self.travel.take(along.way, self._going.asked)
        self.planned = True

    def _take_way(self, name: str, period: float) -> float:
        """Determine the path and its velocity; return the path position at which to begin."""
        command, left = self._command, self._left
        if left is not None:
            self._way, self._velocity, self._window = left._way, left._velocity, left._window
            self._going, self._unit = left._going, left._unit
            return left.travel.t
        if isinstance(command, MovePath):
            self._way, self._velocity, self._window = command.way, command.velocity, command.window
            self.require_near(self._way.at(0.0), name, "is not at the start of the path")
        else:
            starts = {axis: self._start(axis) for axis in self._axes}
            parameters = {axis: core.parameters for axis, core in self._axes.items()}
            self._way, self._velocity = plan_line(
                starts, command.ends, parameters, command.velocity, command.acceleration, name
            )
            unit = math.dist(self._way.at(0.0), self._way.at(1.0))
            self._unit = unit or 1.0
            self._window = window(self._way.ramps[0] * unit, command.jerk, period, name)
        return 0.0

    def _start(self, name: str) -> float:
        core = self._axes[name]
        place = self.follows[name].reference(core.image) - core.image.origin
        return core.parameters.units.position.to_units(place)


def _hardest(core: AxisCore) -> float:
    """Return the highest deceleration of an axis in unit/s²: its limit, otherwise the deceleration of its moves."""
    parameters = core.parameters
    return parameters.limits.acceleration or parameters.path_deceleration or 0.0


# ----------------------------------------------------------------------------------------------------------------------
# Commanded positions of a group's axes along their path: one position vector per cycle, and each axis's component of it.


_SLOPE = 100.0  # units of path over which one unit of start offset is removed


class PathPosition:
    """Positions along a path from path position ``begin`` on; caches the result of the last query.

    The axes start within a window around the path's start. The offset of each axis from the path is removed gradually.
    """

    __slots__ = ("_begin", "_ease", "_fade", "_last", "_off", "_place", "way")

    def __init__(self, way: Path, begin: float, here: Place) -> None:
        """``here``: the actual positions of the axes, in units."""
        self.way = way
        self._begin = begin
        self._off = tuple(a - b for a, b in zip(here, way.at(begin), strict=True))
        rest = way.length - begin
        piece, gone = way.piece(begin)
        own = piece.length - gone
        self._fade = min(rest, max(own, _SLOPE * math.hypot(*self._off)))
        self._last = math.nan
        self._place: Place = here
        self._ease = 1.0

    def eased(self, limits: Sequence[AxisLimits], velocity: float) -> Path:
        """Return the path, slowed so that removing the start offset at ``velocity`` or less exceeds no axis's limits."""
        if not self._fade or not any(self._off):
            return self.way
        slopes = tuple(abs(off) / self._fade for off in self._off)
        fastest, hardest = min(velocity, max(self.way.tops)), max(self.way.ramps)
        more_speed = fastest / least([limit.velocity for limit in limits], slopes)
        more_ramp = hardest / least([limit.acceleration for limit in limits], slopes)
        self._ease = 1.0 / (1.0 + max(more_speed, more_ramp))
        return self.way.slower(self._ease)

    def ease(self, s: float) -> float:
        """Return the factor by which a path must be slower that is appended while the axes are at ``s``; 1.0 without an offset."""
        return self._ease if s - self._begin < self._fade else 1.0

    def scale(self, way: Path, by: float) -> None:
        """Continue along ``way``: the same path, with path positions multiplied by ``by``."""
        self.way, self._begin, self._fade, self._last = way, self._begin * by, self._fade * by, math.nan

    def at(self, s: float) -> Place:
        """Return the axis positions at path position ``s``."""
        if s == self._last:
            return self._place
        place, gone = self.way.at(s), s - self._begin
        if gone < self._fade:
            left = 1.0 - gone / self._fade
            place = tuple([a + left * b for a, b in zip(place, self._off, strict=True)])
        self._last, self._place = s, place
        return place


class AxisPathShare:
    """One axis's component of a path, as a trajectory to follow. Its parameter is the path position (``PathSpeed``), not time."""

    def __init__(self, along: PathPosition, number: int, fastest: float) -> None:
        """``number``: index of the axis in a ``Place``; ``fastest``: the highest path velocity that can be requested."""
        self._along = along
        self._number = number
        way = along.way
        self.duration = way.length
        self.span = way.lowest[number], way.highest[number]
        self.top_speed = min(fastest * way.shares[number], way.speeds[number])
        self.top_acceleration = way.accelerations[number]

    def position(self, s: float) -> float:
        """Return the axis position at path position ``s``."""
        return self._along.at(s)[self._number]
