"""Groups: axes that are enabled, stopped and started in one SYNC, and that move together on a straight line (PLCopen part 4)."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Protocol

from axisbus.errors import AxisbusError, StateError, Stopped
from axisbus.motion import commands as c
from axisbus.motion.axis.accept import accept, require
from axisbus.motion.axis.accept_motion import begin_coupled, begin_follow, path_of
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.axis.queue import Queue
from axisbus.motion.blending.append_path import PathContinuation
from axisbus.motion.blending.mode import began_from_rest
from axisbus.motion.command_status import CommandStatus, Status, broken
from axisbus.motion.coupling.engagement import Engagement
from axisbus.motion.coupling.slave_axis import require_no_ring
from axisbus.motion.group.commands import (
    Couple,
    ForEach,
    GroupCommand,
    GroupContinue,
    GroupSetOverride,
    MoveLinear,
    MovePath,
    PathTransition,
    ProbeMove,
)
from axisbus.motion.group.group_command import ActiveGroupCommand
from axisbus.motion.group.path_motion import MOST, PathMotion
from axisbus.motion.group.start_barrier import OPEN, StartBarrier
from axisbus.motion.moves.follow import Follow
from axisbus.motion.override import FASTER, require_factor
from axisbus.motion.point_stream.commands import AddPoints, FollowPoints
from axisbus.motion.point_stream.stream import PointStreamMotion
from axisbus.motion.probing.probe_move import ProbeSearch
from axisbus.motion.states import AxisState
from axisbus.wording import counted

_ENDS_ALL = (c.Halt, c.Stop, c.QuickStop, c.Disable)  # these commands also drop the commands that wait
Begin = Callable[[AxisCore, Follow, CommandStatus], None]


# -- Errors of a group motion that cannot be appended to the active motion, with their remedies ------------------------


COMMANDS = 100  # that share one motion


def no_path_to_extend(name: str) -> StateError:
    """Return the error if points cannot be added."""
    return StateError(
        f"{name}: the group follows no path to which points could be added",
        observed="its last path has ended, or another command runs",
        remedy="begin a new one at the present position of the axes: group.move_path(points, velocity=..., blend=...)",
    )


def not_a_line(name: str) -> StateError:
    """Return the error if the active command cannot be blended into the requested one."""
    return StateError(
        f"{name}: the present motion of the group cannot be blended with the next one",
        observed="only a line or a path of the same axes can be blended, and only if no other command waits behind it",
        remedy='let it begin at standstill, with buffer="buffered", or wait for the motion before it',
    )


def require_joint(line: PathMotion, following: PathContinuation, name: str) -> None:
    """Raise StateError if ``following`` cannot be appended to ``line``, or if too many commands or segments are ahead."""
    if line.commands >= COMMANDS or line.pieces + len(following.way.pieces) > MOST:
        raise StateError(
            f"{name}: too many commands are blended into this motion already",
            observed=(
                f"{counted(line.commands, 'command')}, segments of the path: {line.pieces}; the limits are {COMMANDS} and "
                f"{MOST}"
            ),
            remedy="wait for some of their handles before you give more commands",
        )
    why = line.why_not(following)
    if why:
        raise StateError(
            f"{name}: the present motion of the group cannot be blended with the next one",
            observed=why,
            remedy='let it begin at standstill, with buffer="buffered"',
        )


# -- The group ---------------------------------------------------------------------------------------------------------


class EndedGroupCommand(Protocol):
    """A command of a group that has ended."""

    @property
    def name(self) -> str: ...

    @property
    def error(self) -> AxisbusError | None: ...


class GroupCore:
    """The axes of one group; holds the group's active commands and its queue."""

    def __init__(self, axes: Mapping[str, AxisCore], period: float) -> None:
        """``axes`` by name; ``period``: scan period in seconds."""
        self.axes = axes
        self._period = period
        self._under_way: list[ActiveGroupCommand | ProbeSearch] = []
        self._line: PathMotion | PointStreamMotion | None = (
            None  # the last one, also after it was interrupted
        )
        self._factor = 1.0
        self._queue = Queue()
        self._ended = False

    def accept(self, command: GroupCommand, ticket: CommandStatus) -> None:
        """Let a command take effect. An active command ends when its axes get other commands. Errors end ``ticket``."""
        try:
            _ACCEPT[type(command)](self, command, ticket)
        except AxisbusError as error:
            ticket.finish(Status.ERROR, error)
        self._ended = self._ended or not ticket.busy

    def step(self) -> None:
        """Advance all active commands; called once per cycle, before the axes step."""
        for undertaking in list(self._under_way):  # a command that waits may begin during this loop
            was_busy = undertaking.busy
            if isinstance(undertaking.line, (PathMotion, PointStreamMotion)):
                undertaking.line.travel.factor = self._factor_of(undertaking.line)
            undertaking.step(self._period)
            if isinstance(undertaking.line, PointStreamMotion):
                self._look_at_stream(undertaking.line, undertaking.busy)
            elif isinstance(undertaking.line, PathMotion):
                self._ended = undertaking.line.take_news() or self._ended
            if undertaking.busy is not was_busy:
                self._ended = True
                self._go_on_after(undertaking)
        if self._under_way:
            self._under_way = [undertaking for undertaking in self._under_way if not undertaking.is_over]

    def take_ended(self) -> bool:
        """Return whether a ticket of the group has ended since the last call."""
        ended, self._ended = self._ended, False
        return ended

    def abandon(self, ended: Callable[[str], AxisbusError]) -> None:
        """End all active commands because the scan has ended; ``ended`` makes the error from the command's name."""
        self._queue.drop("the motion before it", None)
        for undertaking in self._under_way:
            if isinstance(undertaking.line, PointStreamMotion):
                undertaking.line.close()
            undertaking.abandon(ended(undertaking.name))

    def forget(self) -> None:
        """Forget the last motion: an axis has begun again, so there is nothing to continue."""
        self._line = None

    def brake_hard(self, names: Collection[str]) -> None:
        """Let active straight lines that command any axis of ``names`` brake, if they brake, as hard as all their axes permit."""
        for undertaking in self._under_way:
            line = undertaking.line
            if isinstance(line, PathMotion) and not set(names).isdisjoint(line.names):
                line.brake_hard()

    def _for_each(self, command: ForEach, ticket: CommandStatus) -> None:
        if any(isinstance(each, _ENDS_ALL) for each in command.commands.values()):
            self._queue.drop("the motion before it", Stopped(f"{ticket.name} was asked for"))
        if command.together:
            self._require_each(command, ticket)
        undertaking = ActiveGroupCommand(ticket, self.axes, StartBarrier() if command.together else OPEN)
        self._undertake(undertaking, lambda: self._tell_each(command, undertaking))

    def _require_each(self, command: ForEach, ticket: CommandStatus) -> None:
        """Raise the error of an axis that rejects the command, before any other axis begins it."""
        for name, each in command.commands.items():
            require(self.axes[name], each, CommandStatus(f"{ticket.name} [{name}]"))

    def _tell_each(self, command: ForEach, undertaking: ActiveGroupCommand) -> None:
        for name, axis_command in command.commands.items():
            accept(self.axes[name], axis_command, undertaking.child(name), undertaking.gate)

    def _go_on_after(self, ended: EndedGroupCommand) -> None:
        """Begin the first waiting command when no command is active; if ``ended`` has failed, drop all waiting commands."""
        if ended.error is not None:
            self._queue.drop(ended.name, ended.error)
        elif not self._is_busy:
            self._queue.next()

    @property
    def _is_busy(self) -> bool:
        return any(undertaking.busy for undertaking in self._under_way)

    def _move_along(self, command: MoveLinear | MovePath, ticket: CommandStatus) -> None:
        if isinstance(command, MovePath) and command.takeover is not None:
            self._take_over(command, command.takeover, ticket)
            return
        if command.buffer and self._is_busy:
            self._require_no_stop(command.axes, ticket)
            self._queue.add(ticket, partial(self.accept, replace(command, buffer=False), ticket))
            return
        self._require_rest(command.axes, ticket)
        gate = StartBarrier()
        self._go_along(PathMotion(command, self.axes, gate), gate, ticket)

    def _take_over(self, command: MovePath, takeover: PathTransition, ticket: CommandStatus) -> None:
        """Append a path to the active command without a stop. If no command is active, begin the path from standstill."""
        self._require_no_stop(command.axes, ticket)
        plain = replace(command, takeover=None)
        if not self._is_busy:
            if takeover.extends:
                raise no_path_to_extend(ticket.name)
            self._move_along(plain, ticket)
            return
        undertaking = self._to_join(command, takeover, ticket)
        line = undertaking.line
        assert isinstance(line, PathMotion)
        if (
            line.is_at_its_end or not undertaking.leads_all()
        ):  # it comes to rest, so there is no velocity to maintain
            ticket.note = began_from_rest("it came after the end of the previous command")
            self._move_along(replace(plain, buffer=True), ticket)
            return
        following = PathContinuation(command.way, command.velocity, takeover.mode, takeover.blend)
        require_joint(line, following, ticket.name)
        try:
            line.join(following, undertaking.pass_on(ticket), ticket)
        except Exception as error:  # noqa: BLE001  # any exception ends this motion
            undertaking.break_off(broken(error, ticket.name))

    def _to_join(
        self, command: MovePath, takeover: PathTransition, ticket: CommandStatus
    ) -> ActiveGroupCommand:
        """Return the active command if it is one path that ``command`` can extend.

        Raises:
            StateError: several commands are active or wait, or the active command is not a path of the same axes.
        """
        busy = [each for each in self._under_way if each.busy]
        if len(busy) == 1 and not self._queue and isinstance(busy[0], ActiveGroupCommand):
            line = busy[0].line
            if isinstance(line, PathMotion) and line.names == command.axes:
                return busy[0]
        if takeover.extends:
            raise no_path_to_extend(ticket.name)
        raise not_a_line(ticket.name)

    def _continue(self, command: GroupContinue, ticket: CommandStatus) -> None:
        left = self._line
        if left is None:
            raise StateError(
                f"{ticket.name}: there is no line to continue",
                remedy="begin one: group.move_linear(positions, velocity=...)",
            )
        if command.stream is not None and getattr(left, "number", None) != command.stream:
            raise StateError(
                f"{ticket.name}: the axes have run another command since then",
                remedy="begin a new stream at the present position of the axes",
            )
        if any(undertaking.line is left and undertaking.busy for undertaking in self._under_way):
            raise StateError(f"{ticket.name}: the line still runs, so there is nothing to continue")
        fed = command.stream is not None
        if left.is_at_its_end and not (fed and isinstance(left, PointStreamMotion) and left.goes_on):
            raise StateError(f"{ticket.name}: the line has ended, so there is nothing to continue")
        self._require_rest(left.names, ticket)
        if isinstance(left, PointStreamMotion):
            stream = left.again(self.axes, ticket.name, fed=fed)
            self._go_along(stream, stream.gate, ticket)
            return
        gate = StartBarrier()
        self._go_along(left.again(gate, self.axes, ticket.name), gate, ticket)

    def _follow_points(self, command: FollowPoints, ticket: CommandStatus) -> None:
        self._require_rest(command.axes, ticket)
        stream = PointStreamMotion(command, self.axes, ticket.name)
        self._go_along(stream, stream.gate, ticket)

    def _add_points(self, command: AddPoints, ticket: CommandStatus) -> None:
        """Append points to a running stream. Points for an ended stream are ignored: its own ticket has given the reason."""
        for undertaking in self._under_way:
            stream = undertaking.line
            if undertaking.busy and isinstance(stream, PointStreamMotion) and stream.number == command.stream:
                stream.add(command, ticket)
                return
        ticket.finish(Status.ABORTED)

    def _look_at_stream(self, stream: PointStreamMotion, busy: bool) -> None:
        if not busy:
            stream.close()
        self._ended = stream.take_news() or self._ended

    def _set_override(self, command: GroupSetOverride, ticket: CommandStatus) -> None:
        require_factor(command.factor, ticket.name)
        self._factor = command.factor
        ticket.finish(Status.DONE)

    def _go_along(
        self, line: PathMotion | PointStreamMotion, gate: StartBarrier, ticket: CommandStatus
    ) -> None:
        line.travel.factor = self._factor_of(line)
        undertaking = ActiveGroupCommand(ticket, self.axes, gate, line)
        self._line = line
        self._undertake(undertaking, lambda: self._lead(line.follows, begin_follow, undertaking))

    def _factor_of(self, line: PathMotion | PointStreamMotion) -> float:
        """Return a path's override: the group's factor times the lowest of its axes, so that no axis is slowed alone."""
        lowest = min(self.axes[name].override.factor for name in line.follows)
        return min(self._factor * lowest, FASTER)

    def _lead(self, follows: Mapping[str, Follow], begin: Begin, undertaking: ActiveGroupCommand) -> None:
        for name, follow in follows.items():
            core, child = self.axes[name], undertaking.child(name)
            try:
                begin(core, follow, child)
            except AxisbusError as error:
                core.finish(child, error)

    def _couple(self, command: Couple, ticket: CommandStatus) -> None:
        master, slave = self.axes[command.master], self.axes[command.slave]
        require_no_ring(master, slave, ticket.name)
        joint = Engagement(command, master, slave, self._period, path_of(slave))
        undertaking = ActiveGroupCommand(ticket, self.axes, OPEN, joint)
        self._undertake(undertaking, lambda: self._begin_coupled(slave, joint, undertaking))

    def _begin_coupled(self, slave: AxisCore, joint: Engagement, undertaking: ActiveGroupCommand) -> None:
        child = undertaking.child(slave.parameters.name)
        try:
            begin_coupled(slave, joint.follow, child)
        except AxisbusError as error:
            slave.finish(child, error)

    def _search(self, command: ProbeMove, ticket: CommandStatus) -> None:
        search = ProbeSearch(ticket, self.axes[command.axis], command)
        search.begin()
        self._under_way.append(search)

    def _undertake(self, undertaking: ActiveGroupCommand, begin: Callable[[], None]) -> None:
        """Begin a command. If an exception occurs, break off the command, so that no axis moves alone."""
        self._under_way.append(undertaking)
        try:
            begin()
        except Exception as error:  # noqa: BLE001  # any exception ends this command
            undertaking.break_off(broken(error, undertaking.name))
        undertaking.gather()

    def _require_no_stop(self, names: Sequence[str], ticket: CommandStatus) -> None:
        """Raise StateError if an axis is being stopped: after a halt, no command begins automatically."""
        for name in names:
            if self.axes[name].ladder is not None:
                raise StateError(
                    f"{ticket.name}: {name} is being halted", remedy="wait until it is at standstill"
                )

    def _require_rest(self, names: Sequence[str], ticket: CommandStatus) -> None:
        for name in names:
            state = self.axes[name].state
            if state is not AxisState.STANDSTILL:
                raise StateError(
                    f"{ticket.name}: {name} is {state.value}",
                    remedy=(
                        "a straight line starts from Standstill on every axis: enable each axis; if one moves, wait for "
                        "it or halt it"
                    ),
                )


_ACCEPT: dict[type, Callable[[GroupCore, Any, CommandStatus], None]] = {
    ForEach: GroupCore._for_each,
    MoveLinear: GroupCore._move_along,
    MovePath: GroupCore._move_along,
    GroupContinue: GroupCore._continue,
    GroupSetOverride: GroupCore._set_override,
    Couple: GroupCore._couple,
    FollowPoints: GroupCore._follow_points,
    AddPoints: GroupCore._add_points,
    ProbeMove: GroupCore._search,
}
