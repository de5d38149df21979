"""The motion of a group along a path: the axes' followers, the path that they share, and the position along it."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

from axisbus.errors import AxisbusError, StateError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.blending.append_path import ActivePath, PathContinuation, active_path_of, append_path
from axisbus.motion.command_status import CommandEnds, CommandStatus
from axisbus.motion.group.commands import MoveLinear, MovePath
from axisbus.motion.group.path import EMPTY_PATH, Path, least
from axisbus.motion.group.path_builder import plan_line, window
from axisbus.motion.group.path_speed import PathSpeed
from axisbus.motion.group.segments import Coordinates, Straight
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.follow import Follow
from axisbus.motion.override import MAX_OVERRIDE
from axisbus.motion.parameters import AxisLimits

_NEAR = 1e-6  # units: end points no farther apart count as equal
MAX_SEGMENTS = 2000  # segments (lines and corners) ahead; a path that would exceed this is rejected


class _PendingPath(NamedTuple):
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
        self._interrupted = left if left is not None and left.planned else None
        self._path, self._velocity, self._window = EMPTY_PATH, 0.0, 1
        self._active: ActivePath | None = None  # set when another command has been appended
        self._path_position: PathPosition | None = None
        self._unit = 1.0  # length of path position 1 in the axes' units
        self._period = 0.0
        self._pending: list[_PendingPath] = []  # paths appended before this one was planned
        self._ends = CommandEnds()
        self._has_ended = False
        self.travel = PathSpeed()
        self.planned: bool = False
        self.follows = {
            name: Follow(None, core.path_parameters, gate, self.travel) for name, core in self._axes.items()
        }

    @property
    def abort_error(self) -> AxisbusError | None:
        """None: a path does not stop its motion of its own accord."""
        return None

    @property
    def names(self) -> tuple[str, ...]:
        """The axes that move along the path."""
        return tuple(self._axes)

    @property
    def is_at_its_end(self) -> bool:
        """Whether the last target has been sent."""
        return self.planned and self.travel.t >= self._path.length

    @property
    def top(self) -> float:
        """The highest path speed that all speed zones allow."""
        return min(self._path.max_speeds)

    def brake_hard(self) -> None:
        """Let a braking motion use the highest deceleration that all its axes permit, or the path's own if that is higher.

        Hard braking drops the limit of jerk. This applies only to a straight line: in a corner the axes also need acceleration for
        the change of direction.
        """
        share = max(self._path.speed_ratios, default=0.0)
        straight = isinstance(self._command, MoveLinear) and self._active is None
        if self.planned and straight and share > 0.0:
            self.travel.min_deceleration = (
                min(_max_deceleration(core) for core in self._axes.values()) / share
            )

    def step(self, period: float, begins: bool, name: str) -> None:
        """Plan the path as soon as it ``begins``; afterwards advance by one cycle of ``period`` seconds. Until then all axes wait.

        Raises:
            LimitError: the line is impossible (see ``plan_line``); ``name`` is the command's name in the message.
            StateError: an axis is not at the start of the path.
        """
        if self.planned:
            self.travel.advance(period)
            if self._ends:
                self._has_ended = self._ends.end_passed(self.travel.t) or self._has_ended
        elif begins:
            self._plan(name, period)
            pending, self._pending = self._pending, []
            for each in pending:
                self._append(*each)

    def take_commanded(self) -> bool:
        """Return whether any axis was commanded along the path since the last call."""
        commanded = [follow.take_stepped() for follow in self.follows.values()]
        return any(commanded)

    @property
    def commands(self) -> int:
        """The number of commands that share the path and have not ended."""
        return 1 + len(self._ends)

    @property
    def segments(self) -> int:
        """An upper bound of the number of segments (lines and corners) ahead."""
        return len(self._path.segments) + sum(len(following.path.segments) for following, *_ in self._pending)

    def why_not(self, following: PathContinuation) -> str:
        """Return why another path cannot be appended without a stop; "" if it can."""
        if self._is_soft:
            return "the present motion has a jerk limit, with which a corner cannot be blended"
        path = self._last_path
        if path is not None and not isinstance(path.segments[-1], Straight):
            return "the present motion does not end in a straight line, so its end cannot be rounded"
        if math.dist(self._end_point, following.path.at(0.0)) > _NEAR:
            return "it does not begin at the end of the present motion"
        return ""

    @property
    def _is_soft(self) -> bool:
        command = self._command
        return command.window > 1 if isinstance(command, MovePath) else command.jerk is not None

    @property
    def _last_path(self) -> Path | None:
        """The last path of the motion; None if it is not known yet."""
        if self._pending:
            return self._pending[-1].following.path
        if self.planned:
            return self._path
        if self._interrupted is not None:
            return self._interrupted._path
        return self._command.path if isinstance(self._command, MovePath) else None

    @property
    def _end_point(self) -> Coordinates:
        """The end point of the motion, in units."""
        path = self._last_path
        if path is not None:
            return path.at(path.length)
        assert isinstance(self._command, MoveLinear)
        return tuple(self._command.ends.values())

    def join(self, following: PathContinuation, ticket: CommandStatus, next_ticket: CommandStatus) -> None:
        """Append another path to the end of this one. ``ticket`` ends at the transition, then ``next_ticket`` takes over."""
        self._ends.add(ticket, next_ticket)
        if self.planned:
            self._append(following, ticket, next_ticket)
        else:
            self._pending.append(_PendingPath(following, ticket, next_ticket))

    def take_ended(self) -> bool:
        """Return whether a command that shares the path has ended since the last call."""
        has_ended, self._has_ended = self._has_ended, False
        return has_ended

    def _append(self, following: PathContinuation, ticket: CommandStatus, next_ticket: CommandStatus) -> None:
        active, path_position = self._active or self._in_units(), self._path_position
        assert path_position is not None
        limits = [core.parameters.limits for core in self._axes.values()]
        found = append_path(
            active, self.travel, following, limits, self._period, path_position.ease(self.travel.t)
        )
        self._active, self._path = found.active, found.active.path
        self._velocity = max(self._velocity, following.velocity)
        self.travel.take(self._path, self._active.requested)
        path_position.scale(self._path, 1.0)
        self._follow_path(path_position)
        self._ends.mark(ticket, found.mark)
        next_ticket.note = found.note

    def _in_units(self) -> ActivePath:
        """Convert path positions to the axes' units, as appended paths use them."""
        path_position, by = self._path_position, self._unit
        assert path_position is not None
        self._path = path_position.path  # slower than as planned, while the offset of the start is removed
        if by != 1.0:
            self._path, self._velocity, self._unit = path_position.path.rescaled(by), self._velocity * by, 1.0
            self.travel.scale(self._path, by)
            path_position.scale(self._path, by)
        return active_path_of(self._path, self._velocity)

    def _follow_path(self, path_position: PathPosition) -> None:
        """Give the new path to the axes that still follow this motion."""
        for number, follow in enumerate(self.follows.values()):
            if follow.clock is self.travel:
                follow.begin(AxisPathShare(path_position, number, MAX_OVERRIDE * self._velocity))

    def resumed(self, gate: StartBarrier, group: Mapping[str, AxisCore], name: str) -> PathMotion:
        """Return a motion that resumes this one from the position where it was interrupted.

        Raises:
            StateError: an axis is no longer at that position; ``name`` is the command's name in the message.
        """
        line = PathMotion(self._command, group, gate, self)
        if self.planned:
            line.require_near(
                self._path.at(self.travel.t),
                name,
                ("is no longer at the position at which the path was interrupted"),
            )
        return line

    def require_near(self, coordinates: Coordinates, name: str, what: str) -> None:
        """Raise StateError if an axis is not at ``coordinates`` within its position window; ``what`` is the message's predicate."""
        for (axis, core), there in zip(self._axes.items(), coordinates, strict=True):
            units = core.parameters.units.position
            away, allowed = (
                abs(self._start(axis) - there),
                abs(units.to_units(core.parameters.position_tolerance)),
            )
            if away > allowed:
                numbers = ", ".join(f"{value:.6g}" for value in coordinates)
                raise StateError(
                    f"{name}: {axis} {what}",
                    observed=f"it is {away:.6g} {units.unit} away from there, {allowed:.6g} {units.unit} are allowed",
                    remedy=(
                        f"go there first: group.move_direct(({numbers},)); or begin again at the present position of the "
                        "axes"
                    ),
                )

    def _plan(self, name: str, period: float) -> None:
        begin = self._take_path(name, period)
        here = tuple(self._start(axis) for axis in self._axes)
        self._path_position = path_position = PathPosition(self._path, begin, here)
        self._follow_path(path_position)
        limits = [core.parameters.limits for core in self._axes.values()]
        self._period, path_position.path = period, path_position.eased(limits, MAX_OVERRIDE * self._velocity)
        self.travel.begin(path_position.path, self._velocity, begin, self._window)
        if self._active is not None:
            self._active = self._active._replace(path=path_position.path)
            self.travel.take(path_position.path, self._active.requested)
        self.planned = True

    def _take_path(self, name: str, period: float) -> float:
        """Determine the path and its velocity; return the path position at which to begin."""
        command, left = self._command, self._interrupted
        if left is not None:
            self._path, self._velocity, self._window = left._path, left._velocity, left._window
            self._active, self._unit = left._active, left._unit
            return left.travel.t
        if isinstance(command, MovePath):
            self._path, self._velocity, self._window = command.path, command.velocity, command.window
            self.require_near(self._path.at(0.0), name, "is not at the start of the path")
        else:
            starts = {axis: self._start(axis) for axis in self._axes}
            parameters = {axis: core.parameters for axis, core in self._axes.items()}
            self._path, self._velocity = plan_line(
                starts, command.ends, parameters, command.velocity, command.acceleration, name
            )
            unit = math.dist(self._path.at(0.0), self._path.at(1.0))
            self._unit = unit or 1.0
            self._window = window(self._path.ramps[0] * unit, command.jerk, period, name)
        return 0.0

    def _start(self, name: str) -> float:
        core = self._axes[name]
        increments = self.follows[name].reference(core.image) - core.image.origin
        return core.parameters.units.position.to_units(increments)


def _max_deceleration(core: AxisCore) -> float:
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

    __slots__ = ("_begin", "_coordinates", "_ease_factor", "_fade_distance", "_last", "_offset", "path")

    def __init__(self, path: Path, begin: float, here: Coordinates) -> None:
        """``here``: the actual positions of the axes, in units."""
        self.path = path
        self._begin = begin
        self._offset = tuple(a - b for a, b in zip(here, path.at(begin), strict=True))
        rest = path.length - begin
        segment, travelled = path.segment(begin)
        own = segment.length - travelled
        self._fade_distance = min(rest, max(own, _SLOPE * math.hypot(*self._offset)))
        self._last = math.nan
        self._coordinates: Coordinates = here
        self._ease_factor = 1.0

    def eased(self, limits: Sequence[AxisLimits], velocity: float) -> Path:
        """Return the path, slowed so that removing the start offset at ``velocity`` or less exceeds no axis's limits."""
        if not self._fade_distance or not any(self._offset):
            return self.path
        slopes = tuple(abs(offset) / self._fade_distance for offset in self._offset)
        fastest, hardest = min(velocity, max(self.path.max_speeds)), max(self.path.ramps)
        more_speed = fastest / least([limit.velocity for limit in limits], slopes)
        more_ramp = hardest / least([limit.acceleration for limit in limits], slopes)
        self._ease_factor = 1.0 / (1.0 + max(more_speed, more_ramp))
        return self.path.slower(self._ease_factor)

    def ease(self, s: float) -> float:
        """Return the factor by which a path must be slower that is appended while the axes are at ``s``; 1.0 without an offset."""
        return self._ease_factor if s - self._begin < self._fade_distance else 1.0

    def scale(self, path: Path, by: float) -> None:
        """Continue along ``path``: the same path, with path positions multiplied by ``by``."""
        self.path, self._begin, self._fade_distance, self._last = (
            path,
            self._begin * by,
            self._fade_distance * by,
            math.nan,
        )

    def at(self, s: float) -> Coordinates:
        """Return the axis positions at path position ``s``."""
        if s == self._last:
            return self._coordinates
        coordinates, travelled = self.path.at(s), s - self._begin
        if travelled < self._fade_distance:
            left = 1.0 - travelled / self._fade_distance
            coordinates = tuple([a + left * b for a, b in zip(coordinates, self._offset, strict=True)])
        self._last, self._coordinates = s, coordinates
        return coordinates


class AxisPathShare:
    """One axis's component of a path, as a trajectory to follow. Its parameter is the path position (``PathSpeed``), not time."""

    def __init__(self, path_position: PathPosition, number: int, fastest: float) -> None:
        """``number``: index of the axis in a ``Coordinates``; ``fastest``: the highest path velocity that can be requested."""
        self._path_position = path_position
        self._number = number
        path = path_position.path
        self.duration = path.length
        self.span = path.lowest[number], path.highest[number]
        self.top_speed = min(fastest * path.speed_ratios[number], path.speeds[number])
        self.top_acceleration = path.accelerations[number]

    def position(self, s: float) -> float:
        """Return the axis position at path position ``s``."""
        return self._path_position.at(s)[self._number]
