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
from axisbus.motion.group.path_motion import MAX_SEGMENTS, PathMotion
from axisbus.motion.group.start_barrier import OPEN, StartBarrier
from axisbus.motion.moves.follow import Follow
from axisbus.motion.override import MAX_OVERRIDE, require_factor
from axisbus.motion.point_stream.commands import AddPoints, FollowPoints
from axisbus.motion.point_stream.stream import PointStreamMotion
from axisbus.motion.probing.probe_move import ProbeSearch
from axisbus.motion.states import AxisState
from axisbus.wording import counted

_ENDS_ALL = (c.Halt, c.Stop, c.QuickStop, c.Disable)  # these commands also drop the commands that wait
Begin = Callable[[AxisCore, Follow, CommandStatus], None]


# -- Errors of a group motion that cannot be appended to the active motion, with their remedies ------------------------


MAX_COMMANDS = 100  # that share one motion


def no_path_to_extend(name: str) -> StateError:
    """Return the error if points cannot be added."""
    return StateError(
        f"{name}: the group follows no path to which points could be added",
        observed="its last path has ended, or another command runs",
        remedy="begin a new one at the present position of the axes: group.move_path(points, velocity=..., blend=...)",
    )


def not_blendable(name: str) -> StateError:
    """Return the error if the active command cannot be blended into the requested one."""
    return StateError(
        f"{name}: the present motion of the group cannot be blended with the next one",
        observed="only a line or a path of the same axes can be blended, and only if no other command waits behind it",
        remedy='let it begin at standstill, with buffer="buffered", or wait for the motion before it',
    )


def require_appendable(motion: PathMotion, following: PathContinuation, name: str) -> None:
    """Raise StateError if ``following`` cannot be appended to ``motion``, or if too many commands or segments are ahead."""
    if motion.commands >= MAX_COMMANDS or motion.segments + len(following.path.segments) > MAX_SEGMENTS:
        raise StateError(
            f"{name}: too many commands are blended into this motion already",
            observed=(
                f"{counted(motion.commands, 'command')}, segments of the path: {motion.segments}; the limits are {MAX_COMMANDS} "
                f"and {MAX_SEGMENTS}"
            ),
            remedy="wait for some of their handles before you give more commands",
        )
    why = motion.why_not(following)
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
        self._active: list[ActiveGroupCommand | ProbeSearch] = []
        # the last one, also after it was interrupted
        self._last_motion: PathMotion | PointStreamMotion | None = None
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
        for active in list(self._active):  # a command that waits may begin during this loop
            was_busy = active.busy
            if isinstance(active.motion, (PathMotion, PointStreamMotion)):
                active.motion.travel.factor = self._factor_of(active.motion)
            active.step(self._period)
            if isinstance(active.motion, PointStreamMotion):
                self._update_stream(active.motion, active.busy)
            elif isinstance(active.motion, PathMotion):
                self._ended = active.motion.take_ended() or self._ended
            if active.busy is not was_busy:
                self._ended = True
                self._begin_next_after(active)
        if self._active:
            self._active = [active for active in self._active if not active.is_over]

    def take_ended(self) -> bool:
        """Return whether a ticket of the group has ended since the last call."""
        ended, self._ended = self._ended, False
        return ended

    def abandon(self, ended: Callable[[str], AxisbusError]) -> None:
        """End all active commands because the scan has ended; ``ended`` makes the error from the command's name."""
        self._queue.drop("the motion before it", None)
        for active in self._active:
            if isinstance(active.motion, PointStreamMotion):
                active.motion.close()
            active.abandon(ended(active.name))

    def forget(self) -> None:
        """Forget the last motion: an axis has begun again, so there is nothing to continue."""
        self._last_motion = None

    def brake_hard(self, names: Collection[str]) -> None:
        """Let active straight lines that command any axis of ``names`` brake, if they brake, as hard as all their axes permit."""
        for active in self._active:
            motion = active.motion
            if isinstance(motion, PathMotion) and not set(names).isdisjoint(motion.names):
                motion.brake_hard()

    def _for_each(self, command: ForEach, ticket: CommandStatus) -> None:
        if any(isinstance(each, _ENDS_ALL) for each in command.commands.values()):
            self._queue.drop("the motion before it", Stopped(f"{ticket.name} was asked for"))
        if command.together:
            self._require_each(command, ticket)
        active = ActiveGroupCommand(ticket, self.axes, StartBarrier() if command.together else OPEN)
        self._start(active, lambda: self._begin_each(command, active))

    def _require_each(self, command: ForEach, ticket: CommandStatus) -> None:
        """Raise the error of an axis that rejects the command, before any other axis begins it."""
        for name, each in command.commands.items():
            require(self.axes[name], each, CommandStatus(f"{ticket.name} [{name}]"))

    def _begin_each(self, command: ForEach, active: ActiveGroupCommand) -> None:
        for name, axis_command in command.commands.items():
            accept(self.axes[name], axis_command, active.child(name), active.gate)

    def _begin_next_after(self, ended: EndedGroupCommand) -> None:
        """Begin the first waiting command when no command is active; if ``ended`` has failed, drop all waiting commands."""
        if ended.error is not None:
            self._queue.drop(ended.name, ended.error)
        elif not self._is_busy:
            self._queue.next()

    @property
    def _is_busy(self) -> bool:
        return any(active.busy for active in self._active)

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
        self._begin_motion(PathMotion(command, self.axes, gate), gate, ticket)

    def _take_over(self, command: MovePath, takeover: PathTransition, ticket: CommandStatus) -> None:
        """Append a path to the active command without a stop. If no command is active, begin the path from standstill."""
        self._require_no_stop(command.axes, ticket)
        plain = replace(command, takeover=None)
        if not self._is_busy:
            if takeover.extends:
                raise no_path_to_extend(ticket.name)
            self._move_along(plain, ticket)
            return
        active = self._extendable_command(command, takeover, ticket)
        motion = active.motion
        assert isinstance(motion, PathMotion)
        if (
            motion.is_at_its_end or not active.commands_all()
        ):  # it comes to rest, so there is no velocity to maintain
            ticket.note = began_from_rest("it came after the end of the previous command")
            self._move_along(replace(plain, buffer=True), ticket)
            return
        following = PathContinuation(command.path, command.velocity, takeover.mode, takeover.blend)
        require_appendable(motion, following, ticket.name)
        try:
            motion.join(following, active.hand_over(ticket), ticket)
        except Exception as error:  # noqa: BLE001  # any exception ends this motion
            active.break_off(broken(error, ticket.name))

    def _extendable_command(
        self, command: MovePath, takeover: PathTransition, ticket: CommandStatus
    ) -> ActiveGroupCommand:
        """Return the active command if it is one path that ``command`` can extend.

        Raises:
            StateError: several commands are active or wait, or the active command is not a path of the same axes.
        """
        busy = [each for each in self._active if each.busy]
        if len(busy) == 1 and not self._queue and isinstance(busy[0], ActiveGroupCommand):
            motion = busy[0].motion
            if isinstance(motion, PathMotion) and motion.names == command.axes:
                return busy[0]
        if takeover.extends:
            raise no_path_to_extend(ticket.name)
        raise not_blendable(ticket.name)

    def _continue(self, command: GroupContinue, ticket: CommandStatus) -> None:
        last = self._last_motion
        if last is None:
            raise StateError(
                f"{ticket.name}: there is no line to continue",
                remedy="begin one: group.move_linear(positions, velocity=...)",
            )
        if command.stream is not None and getattr(last, "number", None) != command.stream:
            raise StateError(
                f"{ticket.name}: the axes have run another command since then",
                remedy="begin a new stream at the present position of the axes",
            )
        if any(active.motion is last and active.busy for active in self._active):
            raise StateError(f"{ticket.name}: the line still runs, so there is nothing to continue")
        fed = command.stream is not None
        if last.is_at_its_end and not (fed and isinstance(last, PointStreamMotion) and last.expects_points):
            raise StateError(f"{ticket.name}: the line has ended, so there is nothing to continue")
        self._require_rest(last.names, ticket)
        if isinstance(last, PointStreamMotion):
            stream = last.resumed(self.axes, ticket.name, fed=fed)
            self._begin_motion(stream, stream.gate, ticket)
            return
        gate = StartBarrier()
        self._begin_motion(last.resumed(gate, self.axes, ticket.name), gate, ticket)

    def _follow_points(self, command: FollowPoints, ticket: CommandStatus) -> None:
        self._require_rest(command.axes, ticket)
        stream = PointStreamMotion(command, self.axes, ticket.name)
        self._begin_motion(stream, stream.gate, ticket)

    def _add_points(self, command: AddPoints, ticket: CommandStatus) -> None:
        """Append points to a running stream. Points for an ended stream are ignored: its own ticket has given the reason."""
        for active in self._active:
            stream = active.motion
            if active.busy and isinstance(stream, PointStreamMotion) and stream.number == command.stream:
                stream.add(command, ticket)
                return
        ticket.finish(Status.ABORTED)

    def _update_stream(self, stream: PointStreamMotion, busy: bool) -> None:
        if not busy:
            stream.close()
        self._ended = stream.take_ended() or self._ended

    def _set_override(self, command: GroupSetOverride, ticket: CommandStatus) -> None:
        require_factor(command.factor, ticket.name)
        self._factor = command.factor
        ticket.finish(Status.DONE)

    def _begin_motion(
        self, motion: PathMotion | PointStreamMotion, gate: StartBarrier, ticket: CommandStatus
    ) -> None:
        motion.travel.factor = self._factor_of(motion)
        active = ActiveGroupCommand(ticket, self.axes, gate, motion)
        self._last_motion = motion
        self._start(active, lambda: self._begin_children(motion.follows, begin_follow, active))

    def _factor_of(self, motion: PathMotion | PointStreamMotion) -> float:
        """Return a path's override: the group's factor times the lowest of its axes, so that no axis is slowed alone."""
        lowest = min(self.axes[name].override.factor for name in motion.follows)
        return min(self._factor * lowest, MAX_OVERRIDE)

    def _begin_children(
        self, follows: Mapping[str, Follow], begin: Begin, active: ActiveGroupCommand
    ) -> None:
        for name, follow in follows.items():
            core, child = self.axes[name], active.child(name)
            try:
                begin(core, follow, child)
            except AxisbusError as error:
                core.finish(child, error)

    def _couple(self, command: Couple, ticket: CommandStatus) -> None:
        master, slave = self.axes[command.master], self.axes[command.slave]
        require_no_ring(master, slave, ticket.name)
        engagement = Engagement(command, master, slave, self._period, path_of(slave))
        active = ActiveGroupCommand(ticket, self.axes, OPEN, engagement)
        self._start(active, lambda: self._begin_coupled(slave, engagement, active))

    def _begin_coupled(self, slave: AxisCore, engagement: Engagement, active: ActiveGroupCommand) -> None:
        child = active.child(slave.parameters.name)
        try:
            begin_coupled(slave, engagement.follow, child)
        except AxisbusError as error:
            slave.finish(child, error)

    def _begin_search(self, command: ProbeMove, ticket: CommandStatus) -> None:
        search = ProbeSearch(ticket, self.axes[command.axis], command)
        search.begin()
        self._active.append(search)

    def _start(self, active: ActiveGroupCommand, begin: Callable[[], None]) -> None:
        """Begin a command. If an exception occurs, break off the command, so that no axis moves alone."""
        self._active.append(active)
        try:
            begin()
        except Exception as error:  # noqa: BLE001  # any exception ends this command
            active.break_off(broken(error, active.name))
        active.gather()

    def _require_no_stop(self, names: Sequence[str], ticket: CommandStatus) -> None:
        """Raise StateError if an axis is being stopped: after a halt, no command begins automatically."""
        for name in names:
            if self.axes[name].stop_sequence is not None:
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
    ProbeMove: GroupCore._begin_search,
}
