"""Groups: axes that are enabled, stopped and started in one SYNC, and that move together on a straight line (PLCopen part 4)."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from axisbus.errors import AxisbusError, Interrupted, Replaced, StateError, Stopped
from axisbus.motion import commands as c
from axisbus.motion.accept import accept
from axisbus.motion.accept_motion import begin_follow
from axisbus.motion.core import AxisCore
from axisbus.motion.follow import Follow
from axisbus.motion.gate import OPEN, Gate
from axisbus.motion.handle import NOBODY, Handle, Status, end_as
from axisbus.motion.path import plan_line
from axisbus.motion.pathclock import PathClock
from axisbus.motion.states import AxisState
from axisbus.motion.trajectory import Trapezoid


@dataclass(frozen=True, slots=True)
class ForEach:
    """The same or own axis commands for every axis of the group; ``together``: all start in one cycle, once all are prepared."""

    commands: Mapping[str, c.Command]
    together: bool = False


@dataclass(frozen=True, slots=True)
class MoveLinear:
    """MC_MoveLinearAbsolute: a straight line to ``ends`` (units), with path velocity and acceleration (units/s, units/s²)."""

    ends: Mapping[str, float]
    velocity: float
    acceleration: float


GroupCommand = ForEach | MoveLinear
_STOPS = {c.Halt, c.Stop, c.QuickStop, c.Disable}
_REPEATABLE = _STOPS | {c.Enable, c.Reset, c.Release}


class GroupCore:
    """The axes of one group under one command; holds the command's handle and its children."""

    def __init__(self, name: str, axes: Mapping[str, AxisCore], period: float) -> None:
        self.name = name
        self.axes = axes
        self._period = period
        self._handle: Handle | None = None
        self._command: ForEach | None = None  # what it was given for, where it is one for each axis
        self._children: dict[str, Handle] = {}
        self._gate: Gate | None = None
        self._line: _Line | None = None
        self._ended = False

    def accept(self, command: GroupCommand, handle: Handle) -> None:
        """Let a command take effect.

        One that is still under way ends: by another command as stopped or replaced, by the same one (``_repeats``) as that ends.
        """
        try:
            _ACCEPT[type(command)](self, command, handle)
        except AxisbusError as error:
            self._finish(handle, error)

    def step(self) -> None:
        """Once per cycle, before the axes: open the gate, plan and advance the line, see who has ended.

        A line goes on until its clock stands still, also when its command has ended: the axes brake along it.
        """
        if self._gate is not None:
            self._gate.update(sum(child.busy for child in self._children.values()))
        if self._line is not None:
            self._step_line(self._line)
        self._gather()

    def take_ended(self) -> bool:
        """Return whether a handle of the group has ended since the last call."""
        ended, self._ended = self._ended, False
        return ended

    def abandon(self, ended: Callable[[str], AxisbusError]) -> None:
        """End the running command, with the error that ``ended`` makes for its name: the scan has ended."""
        handle, self._handle = self._handle, None
        if handle is not None:
            handle.finish(Status.ERROR, ended(handle.name))

    def _for_each(self, command: ForEach, handle: Handle) -> None:
        gate = Gate() if command.together else OPEN
        kinds = {type(axis_command) for axis_command in command.commands.values()}
        if self._repeats(command, kinds):
            gate = self._hand_over(handle) or gate
        self._start(handle, gate, None, Stopped if kinds <= _STOPS else Replaced)
        self._command = command
        for name, axis_command in command.commands.items():
            accept(self.axes[name], axis_command, self._child(name, handle), gate)
        self._gather()

    def _repeats(self, command: ForEach, kinds: set[type]) -> bool:
        """Whether the same is asked for as is under way, and asking again means nothing more: enable, reset, all that stops."""
        return self._handle is not None and self._command == command and kinds <= _REPEATABLE

    def _hand_over(self, handle: Handle) -> Gate | None:
        """Let the running command's handle end as ``handle`` will; return the gate at which its axes may be waiting."""
        running, self._handle = self._handle, None
        if running is not None:
            handle.add_done_callback(lambda: self._finish(running, handle.error))
        return self._gate

    def _move_linear(self, command: MoveLinear, handle: Handle) -> None:
        gate, line = Gate(), _Line(command)
        self._require_rest(command, handle)
        self._start(handle, gate, line, Replaced)
        for name in command.ends:
            core = self.axes[name]
            follow = Follow(None, core.parameters, gate, line.clock, brake=line.brake)
            line.follows[name] = follow
            child = self._child(name, handle)
            try:
                begin_follow(core, follow, child)
            except AxisbusError as error:
                core.finish(child, error)
        self._gather()

    def _require_rest(self, command: MoveLinear, handle: Handle) -> None:
        for name in command.ends:
            state = self.axes[name].state
            if state is not AxisState.STANDSTILL:
                raise StateError(
                    f"{handle.name}: {name} is {state.value}",
                    remedy="a straight line starts from Standstill on every axis: enable, or wait for or halt what moves",
                )

    def _start(self, handle: Handle, gate: Gate, line: _Line | None, end: type[Interrupted]) -> None:
        if self._handle is not None:
            how = "stopped" if end is Stopped else "replaced"
            self._finish(self._handle, end(f"{self._handle.name} was {how} by {handle.name}"))
        self._handle, self._gate, self._children = handle, gate, {}
        self._command = None
        self._line = line or self._line
        handle.status = Status.ACTIVE

    def _child(self, name: str, handle: Handle) -> Handle:
        child = Handle(f"{handle.name} [{name}]", NOBODY)
        self._children[name] = child
        return child

    def _step_line(self, line: _Line) -> None:
        if not line.planned:
            if self._gate is not None and self._gate.is_open:
                self._plan(line)
            return
        line.clock.advance(self._period)

    def _plan(self, line: _Line) -> None:
        """All wait at the gate: plan from where each stands now."""
        cores = {name: self.axes[name] for name in line.command.ends}
        starts = {
            name: core.parameters.units.position.to_units(
                line.follows[name].reference(core.image) - core.image.origin
            )
            for name, core in cores.items()
        }
        parameters = {name: core.parameters for name, core in cores.items()}
        command = line.command
        shares, line.way = plan_line(starts, command.ends, parameters, command.velocity, command.acceleration)
        for name, share in shares.items():
            line.follows[name].begin(share)
        line.planned = True

    def _gather(self) -> None:
        """End the group's handle when every axis has ended."""
        handle = self._handle
        self._call_off()
        if handle is None or any(child.busy for child in self._children.values()):
            return
        errors = [error for child in self._children.values() if (error := child.exception()) is not None]
        self._handle, self._gate = None, None
        if not errors:
            self._line = None
        self._finish(handle, _worst(errors))

    def _call_off(self) -> None:
        """One axis that fails, or is taken away, before the start or on a line, takes the others with it."""
        waiting = self._gate is not None and not self._gate.is_open
        if not waiting and self._line is None:
            return
        ended = [child for child in self._children.values() if not child.busy]
        errors = [error for child in ended if (error := child.exception()) is not None]
        if not errors or len(ended) == len(self._children):
            return
        what = "not started" if waiting else "stopped on its line"
        reason = f"{self.name}: {what}, because {errors[0].message}"
        for name, child in self._children.items():
            if child.busy:
                accept(self.axes[name], c.PolicyStop(reason), Handle(f"{name}.stop", NOBODY))

    def _finish(self, handle: Handle, error: AxisbusError | None) -> None:
        handle.finish(Status.DONE if error is None else end_as(error), error)
        self._ended = True


class _Line:
    """A straight line under way: its axes' followers, the way from 0 to 1 that they share, and their common clock."""

    def __init__(self, command: MoveLinear) -> None:
        self.command = command
        self.clock = PathClock()
        self.follows: dict[str, Follow] = {}
        self.planned = False
        self.way = Trapezoid(0.0, 0.0, 1.0, 1.0)

    def brake(self) -> None:
        """Slow all down together."""
        self.clock.brake(self.way.position, self.way.acceleration)


def _worst(errors: list[AxisbusError]) -> AxisbusError | None:
    """Return the first failure; a mere interruption only if there is nothing worse."""
    return next((error for error in errors if end_as(error) is Status.ERROR), errors[0] if errors else None)


_ACCEPT: dict[type, Callable[[GroupCore, Any, Handle], None]] = {
    ForEach: GroupCore._for_each,
    MoveLinear: GroupCore._move_linear,
}
