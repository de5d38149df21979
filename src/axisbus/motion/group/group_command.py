"""One command of a group under way: what each axis has been told, where all wait for each other, and when it has ended.

Theory of operation
-------------------
A group's command is nothing but a command for each of its axes (a *child*), and it ends when they have ended. So a new command of
the group, or of one axis, does to it what it does on each axis: one that is harmless there (an enable of what is enabled) takes
nothing away, and one that stops or replaces a child ends it. Several undertakings of one group may thus be under way at a time.

Where all start together, or move on one line, an axis that drops out takes the others with it. That is looked for before the gate
may open, so that nobody starts in the very cycle in which somebody has gone.

An axis that has ended its part early stays where the command has brought it until the others have ended theirs. If it is given
another command, or fails, before that, the group's command is not done.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import copy
from typing import Protocol

from axisbus.errors import AxisbusError, Interrupted, Replaced, Stopped
from axisbus.motion import commands as c
from axisbus.motion.axis.accept import accept
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus, Status, end_as, unattended
from axisbus.motion.group.start_barrier import OPEN, StartBarrier
from axisbus.motion.moves.enable import EnableActivity
from axisbus.motion.states import AxisState
from axisbus.motion.user_code_errors import broken

_TOGETHER = "nobody of a group starts alone, or goes on along a line that another has left: ask for it again when all can go"


class GroupSetPointSource(Protocol):
    """What leads axes together: a line, or the joint of a slave and its master."""

    @property
    def planned(self) -> bool:
        """Whether it leads them."""

    @property
    def gives_up(self) -> AxisbusError | None:
        """Why it leads them no farther, where it found that itself; all are then braked along their way."""

    def step(self, period: float, begins: bool, name: str) -> None:
        """Once per cycle of ``period`` seconds, before the axes; ``begins``: all may begin. ``name`` says what was asked for."""

    def leads(self) -> bool:
        """Whether any axis was led since this was asked last."""


class ActiveGroupCommand:
    """Holds the command's ticket, its children by axis, the gate, and the line where it is one."""

    def __init__(
        self,
        ticket: CommandStatus,
        axes: Mapping[str, AxisCore],
        gate: StartBarrier = OPEN,
        line: GroupSetPointSource | None = None,
    ) -> None:
        """``axes``: those of the group, by name."""
        self.gate = gate
        self._ticket = ticket
        self._axes = axes
        self._line = line
        self._children: dict[str, CommandStatus] = {}
        self._goes_on: set[str] = set()  # axes with a command that waited for the end of their part
        self._called_off = False
        self._reason: AxisbusError | None = None  # why, where no axis's own error says it
        ticket.begin()

    @property
    def ticket(self) -> CommandStatus:
        """That of its command."""
        return self._ticket

    def leads_all(self) -> bool:
        """Whether each of its axes is still under way by it, and nobody has dropped out."""
        under_way = all(child.busy for child in self._children.values())
        return self.busy and under_way and not self._called_off and self._dropped_out() is None

    def pass_on(self, ticket: CommandStatus) -> CommandStatus:
        """Be the motion of another command from now on, which has joined it; return the ticket of the one before."""
        before, self._ticket = self._ticket, ticket
        return before

    def child(self, axis: str) -> CommandStatus:
        """Return the ticket of what ``axis`` is told for this command."""
        child = CommandStatus(f"{self._ticket.name} [{axis}]")
        self._children[axis] = child
        child.then(lambda: self._note_next(axis))
        return child

    def _note_next(self, axis: str) -> None:
        """Note an axis that goes on with what waited for the end of its part: that was asked for, and interrupts nothing."""
        if self._axes[axis].queue:
            self._goes_on.add(axis)

    def step(self, period: float) -> None:
        """Once per cycle, before the axes: see who has dropped out, open the gate, plan the line and go on along it."""
        try:
            self._go_on(period)
        except Exception as error:  # noqa: BLE001  # whatever it is, it ends this command and stops its axes
            self.break_off(broken(error, self._ticket.name))
        self.gather()

    @property
    def busy(self) -> bool:
        """Whether the ticket has not ended."""
        return self._ticket.busy

    @property
    def error(self) -> AxisbusError | None:
        """What has ended its ticket badly."""
        return self._ticket.error

    @property
    def is_over(self) -> bool:
        """Whether the ticket has ended, and no axis is led any more."""
        return not self._ticket.busy and (self._line is None or not self._line.leads())

    def gather(self) -> None:
        """End the ticket when every axis has ended."""
        if not self._ticket.busy or any(child.busy for child in self._children.values()):
            return
        errors = [error for child in self._children.values() if (error := child.error) is not None]
        error = _worst(errors if self._reason is None else [self._reason, *errors])
        self._ticket.finish(Status.DONE if error is None else end_as(error), error)

    def break_off(self, error: AxisbusError) -> None:
        """End the command with ``error``: what has not begun is not begun, what is led along the line is stopped."""
        moving = self._line is not None and self._line.planned
        self._reason, self._line, self._called_off = error, None, True
        self.gate.shut()
        for axis in self._own():
            if moving:
                self._axes[axis].break_off(_again(error))
            else:
                self._stop(axis, error.message)

    @property
    def line(self) -> GroupSetPointSource | None:
        """The way that its axes are led along, if there is one."""
        return self._line

    def abandon(self, error: AxisbusError) -> None:
        """End the ticket with ``error``: the scan has ended."""
        self._ticket.finish(Status.ERROR, error)

    @property
    def name(self) -> str:
        """What was asked for."""
        return self._ticket.name

    def _go_on(self, period: float) -> None:
        self._call_off()
        if self._reason is None and self._ticket.busy and self.gate is not OPEN:
            self._reason = self._left_early()
        if not self.gate.is_open:
            self.gate.update(sum(child.busy for child in self._children.values()))
        if self._line is not None:
            self._line.step(period, self.gate.is_open, self._ticket.name)

    def _call_off(self) -> None:
        """Nobody starts alone, and nobody goes on along a line that another has left."""
        if self._called_off or not self._ticket.busy or (self.gate.is_open and self._line is None):
            return
        failure = None if self._line is None else self._line.gives_up
        cause = failure or self._dropped_out()
        if cause is None:
            return
        what = "stopped on its line" if self.gate.is_open else "not started"
        reason = f"{self._ticket.name}: {what}, because {cause.message}"
        if failure is not None:
            self._reason = failure
        elif isinstance(cause, Interrupted):
            self._reason = type(cause)(reason, remedy=_TOGETHER)
        self._called_off = True
        self.gate.shut()
        for axis in self._own():
            self._stop(axis, reason)

    def _dropped_out(self) -> AxisbusError | None:
        """Return why an axis has ended badly, or is about to (a fault is looked into before it is told); None if none has."""
        for axis, child in self._children.items():
            core = self._axes[axis]
            error = core.error if child.busy and core.state is AxisState.ERRORSTOP else child.error
            if error is not None:
                return error
        return None

    def _left_early(self) -> AxisbusError | None:
        """Return why an axis that has ended its part well is not where the command has brought it any more; None if all are."""
        for axis, child in self._children.items():
            core, name = self._axes[axis], self._ticket.name
            if child.status is not Status.DONE or axis in self._goes_on:
                continue
            if core.state is AxisState.ERRORSTOP:
                return None if core.error is None else _again(core.error)
            if core.ladder is not None or core.state is AxisState.DISABLED:
                return Stopped(f"{name}: {axis} was stopped before the other axes had come to their end")
            other = core.running.ticket
            if other not in (None, child) and not isinstance(core.activity, EnableActivity):
                return Replaced(
                    f"{name}: {axis} was given another command before the other axes had come to their end"
                )
        return None

    def _own(self) -> list[str]:
        """The axes that run what they were told by this command; one that was at the same already goes on with that."""
        return [axis for axis, child in self._children.items() if self._axes[axis].running.ticket is child]

    def _stop(self, axis: str, reason: str) -> None:
        accept(self._axes[axis], c.PolicyStop(reason), unattended(f"{axis}.stop"))


def _again(error: AxisbusError) -> AxisbusError:
    """Return the same error for one axis, to which it may add what was seen of its drive."""
    again = copy(error)
    again.__cause__ = error.__cause__
    return again


def _worst(errors: list[AxisbusError]) -> AxisbusError | None:
    """Return the first failure; a mere interruption only if there is nothing worse."""
    return next((error for error in errors if end_as(error) is Status.ERROR), errors[0] if errors else None)
