"""One active command of a group: its axis commands, the barrier at which the axes wait for each other, and its end.

Theory of operation
-------------------
A group command consists of one command per axis (a *child*), and ends when all children have ended. A new command of the group, or
of one axis, therefore affects the group command through its children. A command that changes nothing on an axis (enabling an
enabled axis) does not end its child; a command that stops or replaces a child ends it. Several commands of one group may be active
at a time.

If all axes start together, or move on one path, an axis that drops out stops the others too. This is checked before the start
barrier may open, so that no axis starts in the same cycle in which another axis drops out.

An axis whose child ends early holds its final position until the other children have ended. If the axis gets another command
or fails before that, the group command does not end as done.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import Protocol

from axisbus.errors import AxisbusError, Interrupted, Replaced, Stopped
from axisbus.motion import commands as c
from axisbus.motion.axis.accept import accept
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus, Status, broken, end_as, unattended
from axisbus.motion.group.start_barrier import OPEN, StartBarrier
from axisbus.motion.moves.enable import EnableActivity
from axisbus.motion.states import AxisState

_TOGETHER = "the axes of a group move only together: give the command again when all of them can move"


class GroupSetPointSource(Protocol):
    """A source of set-points for several axes: a path, or the coupling of a slave to its master."""

    @property
    def planned(self) -> bool:
        """Whether it is planned, so that it commands the axes."""

    @property
    def abort_error(self) -> AxisbusError | None:
        """The error because of which the source itself stops the motion, or None; all axes are then braked along their path."""

    def step(self, period: float, begins: bool, name: str) -> None:
        """Advance by one cycle of ``period`` seconds, before the axes step.

        ``begins``: all axes may begin. ``name``: the command's name, for error messages.
        """

    def take_commanded(self) -> bool:
        """Return whether any axis was commanded by this source since the last call."""


class ActiveGroupCommand:
    """Holds the command's ticket, its children by axis, the start barrier, and the path if there is one."""

    def __init__(
        self,
        ticket: CommandStatus,
        axes: Mapping[str, AxisCore],
        gate: StartBarrier = OPEN,
        motion: GroupSetPointSource | None = None,
    ) -> None:
        """``axes``: the axes of the group, by name."""
        self.gate = gate
        self._ticket = ticket
        self._axes = axes
        self._motion = motion
        self._children: dict[str, CommandStatus] = {}
        self._continuing: set[str] = set()  # axes that began a queued command when their child ended
        self._cancelled = False
        self._reason: AxisbusError | None = None  # the reason, if no axis's own error gives it
        ticket.begin()

    @property
    def ticket(self) -> CommandStatus:
        """The ticket of the command."""
        return self._ticket

    def commands_all(self) -> bool:
        """Return whether every axis still executes its child, and no axis has dropped out."""
        executing = all(child.busy for child in self._children.values())
        return self.busy and executing and not self._cancelled and self._dropped_out() is None

    def hand_over(self, ticket: CommandStatus) -> CommandStatus:
        """Become the motion of another command, which has been appended; return the previous command's ticket."""
        before, self._ticket = self._ticket, ticket
        return before

    def child(self, axis: str) -> CommandStatus:
        """Create and return the ticket for the command that ``axis`` gets as its part."""
        child = CommandStatus(f"{self._ticket.name} [{axis}]")
        self._children[axis] = child
        child.then(lambda: self._note_next(axis))
        return child

    def _note_next(self, axis: str) -> None:
        """Note an axis that begins a queued command at the end of its part: the user has requested it, so it is no interruption."""
        if self._axes[axis].queue:
            self._continuing.add(axis)

    def step(self, period: float) -> None:
        """Once per cycle, before the axes step: check for axes that dropped out, open the barrier, plan or advance the path."""
        try:
            self._go_on(period)
        except Exception as error:  # noqa: BLE001  # any exception ends this command and stops its axes
            self.break_off(broken(error, self._ticket.name))
        self.gather()

    @property
    def busy(self) -> bool:
        """Whether the ticket has not ended."""
        return self._ticket.busy

    @property
    def error(self) -> AxisbusError | None:
        """The error of the ticket; None if it has none."""
        return self._ticket.error

    @property
    def is_over(self) -> bool:
        """Whether the ticket has ended, and the command's path no longer commands any axis."""
        return not self._ticket.busy and (self._motion is None or not self._motion.take_commanded())

    def gather(self) -> None:
        """End the ticket when every child has ended."""
        if not self._ticket.busy or any(child.busy for child in self._children.values()):
            return
        errors = [error for child in self._children.values() if (error := child.error) is not None]
        error = _worst(errors if self._reason is None else [self._reason, *errors])
        self._ticket.finish(Status.DONE if error is None else end_as(error), error)

    def break_off(self, error: AxisbusError) -> None:
        """End the command with ``error``: axes that have not begun do not begin, and axes that move along the path are stopped."""
        moving = self._motion is not None and self._motion.planned
        self._reason, self._motion, self._cancelled = error, None, True
        self.gate.shut()
        for axis in self._own():
            if moving:
                self._axes[axis].break_off(_copy_of(error))
            else:
                self._stop(axis, error.message)

    @property
    def motion(self) -> GroupSetPointSource | None:
        """The source of the axes' set-points, such as a path; None if there is none."""
        return self._motion

    def abandon(self, error: AxisbusError) -> None:
        """End the ticket with ``error``: the scan has ended."""
        self._ticket.finish(Status.ERROR, error)

    @property
    def name(self) -> str:
        """The name of the command."""
        return self._ticket.name

    def _go_on(self, period: float) -> None:
        self._stop_others()
        if self._reason is None and self._ticket.busy and self.gate is not OPEN:
            self._reason = self._left_early()
        if not self.gate.is_open:
            self.gate.update(sum(child.busy for child in self._children.values()))
        if self._motion is not None:
            self._motion.step(period, self.gate.is_open, self._ticket.name)

    def _stop_others(self) -> None:
        """Stop the other axes if one has dropped out: no axis starts alone or continues along a path that another axis has left."""
        if self._cancelled or not self._ticket.busy or (self.gate.is_open and self._motion is None):
            return
        failure = None if self._motion is None else self._motion.abort_error
        cause = failure or self._dropped_out()
        if cause is None:
            return
        what = "stopped on its line" if self.gate.is_open else "not started"
        reason = f"{self._ticket.name}: {what}, because {cause.message}"
        if failure is not None:
            self._reason = failure
        elif isinstance(cause, Interrupted):
            self._reason = type(cause)(reason, remedy=_TOGETHER)
        self._cancelled = True
        self.gate.shut()
        for axis in self._own():
            self._stop(axis, reason)

    def _dropped_out(self) -> AxisbusError | None:
        """Return why an axis has failed or is about to (a fault is analysed before its child ends); None if no axis has."""
        for axis, child in self._children.items():
            core = self._axes[axis]
            error = core.error if child.busy and core.state is AxisState.ERRORSTOP else child.error
            if error is not None:
                return error
        return None

    def _left_early(self) -> AxisbusError | None:
        """Return the error if an axis whose child is done no longer holds its final position; None if all do."""
        for axis, child in self._children.items():
            core, name = self._axes[axis], self._ticket.name
            if child.status is not Status.DONE or axis in self._continuing:
                continue
            if core.state is AxisState.ERRORSTOP:
                return None if core.error is None else _copy_of(core.error)
            if core.stop_sequence is not None or core.state is AxisState.DISABLED:
                return Stopped(f"{name}: {axis} was stopped before the other axes had reached their ends")
            other = core.running.ticket
            if other not in (None, child) and not isinstance(core.activity, EnableActivity):
                return Replaced(
                    f"{name}: {axis} was given another command before the other axes had reached their ends"
                )
        return None

    def _own(self) -> list[str]:
        """Return the axes that execute this command's children. An axis that already ran the same command continues with that."""
        return [axis for axis, child in self._children.items() if self._axes[axis].running.ticket is child]

    def _stop(self, axis: str, reason: str) -> None:
        accept(self._axes[axis], c.PolicyStop(reason), unattended(f"{axis}.stop"))


def _copy_of(error: AxisbusError) -> AxisbusError:
    """Return a copy of the error for one axis, to which the axis may add observations of its drive."""
    copied = copy(error)
    copied.__cause__ = error.__cause__
    return copied


def _worst(errors: list[AxisbusError]) -> AxisbusError | None:
    """Return the first failure; an interruption only if there is no failure."""
    return next((error for error in errors if end_as(error) is Status.ERROR), errors[0] if errors else None)
