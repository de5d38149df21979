"""A gantry pair in the core: a group of two axes that moves as one beam, with the skew monitored in every cycle.

Theory of operation
-------------------
Every motion of the pair is a straight line of a group (``MoveLinear``). It leads from the commanded positions of both axes to one
position of the first axis, and that position plus the offset for the second. Both axes share one path and one motion along it, so
one set-point commands both. A halt, an override and a resumption act on this motion, and nothing commands one axis without the
other. A beam that is slightly out of square is square at the end of its next move.

The skew is checked before the axes step (``skew``). If the skew is too large or unknown, both axes go to ErrorStop in that cycle.
They brake along their line, as hard as all axes of that line permit; if no line commands them, each executes its stop sequence. If
the beam is still out of square at rest, it is quick-stopped, because a jammed side would jump to its target when it comes free. If
one axis has failed of its own accord, the fault policy stops the other along the same line, and that line brakes as hard.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from copy import copy
from dataclasses import replace
from functools import partial
from typing import Any

from axisbus.errors import AxisbusError, SkewError, StateError
from axisbus.motion import commands as c
from axisbus.motion.axis.accept_motion import require_count, require_own_zero, require_within_limits
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.command_status import CommandStatus, Status
from axisbus.motion.gantry import commands as g
from axisbus.motion.gantry.homing import GantryHoming
from axisbus.motion.gantry.motion import GantryVelocityMove, end_of_move, ends_of_squaring, far_end
from axisbus.motion.gantry.parameters import GantryParameters
from axisbus.motion.gantry.skew import SkewMonitor, demand_position_of
from axisbus.motion.group.commands import ForEach, GroupCommand, GroupContinue, MoveLinear
from axisbus.motion.group.core import EndedGroupCommand, GroupCore
from axisbus.motion.group.path_motion import PathMotion
from axisbus.motion.parameters import NOISE
from axisbus.motion.states import MOVING, AxisState
from axisbus.motion.stop.active_stop import StopKind
from axisbus.motion.stop.stop_sequence import AfterStop, StopLevel

# ----------------------------------------------------------------------------------------------------------------------
# The stop of an energised beam that is out of square: both axes stop, and are quick-stopped if they are still skewed at rest.


class SkewStop:
    """Holds whether both axes are being stopped because of the skew."""

    def __init__(self, axes: Mapping[str, AxisCore], monitor: SkewMonitor) -> None:
        self._axes, self._monitor = axes, monitor
        self._stopping = False

    def stop_both(self, error: SkewError) -> None:
        """Stop both axes along their line if one commands them, otherwise each by its stop sequence."""
        failing = self._monitor.failing()
        self._stopping = True
        for core in failing:
            path = core.active_path
            if path is not None and len(failing) == len(self._axes):
                path.brakes_along = True
            core.break_off(copy(error))

    def quick_stop_if_skewed(self) -> None:
        """Quick-stop both axes when their path is at rest and the beam is still skewed: a jammed side would jump to its target."""
        if not self._stopping:
            return
        halting = [
            core
            for core in self._axes.values()
            if core.stop_sequence is not None and core.stop_sequence.level is StopLevel.HALT
        ]
        if halting and any(core.active_path is not None for core in self._axes.values()):
            return
        self._stopping = False
        if self._monitor.skew is not None and abs(self._monitor.skew) > self._monitor.bound:
            for core in halting:
                core.stop_because(
                    StopKind.ERROR,
                    AfterStop.HOLD,
                    StopLevel.QUICK_STOP,
                    "the beam is still out of square",
                    None,
                )


# -- The pair ----------------------------------------------------------------------------------------------------------


class GantryCore(GroupCore):
    """The group of a pair's axes; holds the skew monitor and the pair's own active commands."""

    def __init__(
        self,
        parameters: GantryParameters,
        axes: Mapping[str, AxisCore],
        period: float,
        groups: Callable[[], Iterable[GroupCore]],
    ) -> None:
        """As ``GroupCore``; ``groups``: all groups including this one, because any group may command both axes with other axes."""
        super().__init__(axes, period)
        self._groups = groups
        self.parameters = parameters
        self._first, self._second = (axes[name] for name in parameters.axes)
        self.monitor = SkewMonitor(parameters, self._first, self._second)
        self._homing: GantryHoming | None = None
        self._velocity_move: GantryVelocityMove | None = None
        # the last one, also after it was interrupted
        self._last_velocity_move: GantryVelocityMove | None = None
        self._squaring: CommandStatus | None = None
        self._skew_stop = SkewStop(axes, self.monitor)
        self._last_end: float | None = None  # the last commanded end position of the beam

    def forget(self) -> None:
        """As ``GroupCore.forget``."""
        super().forget()
        self._last_end = None
        self.monitor.restore_bound()

    def accept(self, command: GroupCommand, ticket: CommandStatus) -> None:
        """As ``GroupCore.accept``."""
        self._end_squaring()
        own = _OWN.get(type(command))
        try:
            if own is not None:
                own(self, command, ticket)
            else:
                self._require_permitted(command, ticket)
        except AxisbusError as error:
            ticket.finish(Status.ERROR, error)
        if own is None and ticket.busy:
            super().accept(command, ticket)
        self._ended = self._ended or not ticket.busy

    def step(self) -> None:
        """Check the skew and advance all active commands; called once per cycle, before the axes step."""
        self.monitor.update()
        error = self.monitor.present_error()
        if error is not None:
            if self._homing is not None:
                self._homing.give_up(error)
            self._brake_hard()
            self._skew_stop.stop_both(error)
        elif any(core.state is AxisState.ERRORSTOP for core in self.axes.values()):
            self._brake_hard()
        self._skew_stop.quick_stop_if_skewed()
        self._step_own()
        super().step()

    def abandon(self, ended: Callable[[str], AxisbusError]) -> None:
        """As ``GroupCore.abandon``."""
        for own in (self._homing, self._velocity_move):
            if own is not None:
                own.abandon(ended(own.name))
        super().abandon(ended)

    @property
    def _is_busy(self) -> bool:
        return super()._is_busy or (self._homing is not None and self._homing.busy)

    def permit_group_path(self, name: str) -> AxisbusError | None:
        """Permit a path of another group to command both axes with others; return an error if not (``name``: the command)."""
        self._end_squaring()
        self._last_end = None
        if self._homing is not None and self._homing.busy:
            return StateError(
                f"{name}: {self.parameters.name} is being homed", remedy="wait for it, or halt it first"
            )
        return self._widened_error(name) if self.monitor.is_widened else None

    def _widened_error(self, name: str) -> StateError:
        return StateError(
            f"{name}: the pair was enabled with a wider skew limit of {self.monitor.bound:.6g} {self.monitor.unit}",
            observed=self.monitor.positions_text,
            remedy=f"make the beam square first: {self.parameters.name}.square(velocity=...), slowly",
        )

    # -- the skew monitor ----------------------------------------------------------------------------------------------

    def _brake_hard(self) -> None:
        """Let the line that commands both axes, of whichever group, brake as hard as all of its axes permit."""
        for group in self._groups():
            group.brake_hard(self.axes)

    def _step_own(self) -> None:
        if self._homing is not None:
            self._homing.step()
            self._check_homing(self._homing)
        if self._velocity_move is not None:
            self._ended = self._velocity_move.step() or self._ended
            self._velocity_move = None if self._velocity_move.over else self._velocity_move
        self._end_squaring()

    def _check_homing(self, homing: GantryHoming) -> None:
        """When homing has ended, begin the first waiting command."""
        if not homing.busy:
            self._ended, self._homing = True, None
            self._begin_next_after(homing)

    def _begin_next_after(self, ended: EndedGroupCommand) -> None:
        """As ``GroupCore``; the commands of a homing run to its axes do not count."""
        if self._homing is None:
            super()._begin_next_after(ended)

    def _end_squaring(self) -> None:
        """Restore ``max_skew`` as the bound after the beam has been squared."""
        ticket = self._squaring
        if ticket is None or ticket.busy:
            return
        self._squaring = None
        skew = self.monitor.skew
        if ticket.status is Status.DONE and skew is not None and abs(skew) <= self.parameters.max_skew:
            self.monitor.restore_bound()

    # -- power ---------------------------------------------------------------------------------------------------------

    def _require_permitted(self, command: GroupCommand, ticket: CommandStatus) -> None:
        """Raise the error if a group command is not permitted for this pair now."""
        singles = command.commands.values() if isinstance(command, ForEach) else ()
        if isinstance(command, GroupContinue) and self.monitor.is_widened:
            self._require_fit(ticket)
        out_of_square = self.monitor.skew is None or abs(self.monitor.skew) > self.monitor.bound
        if (
            any(isinstance(each, c.ResetCommand) for each in singles)
            and out_of_square
            and self.monitor.energised
        ):
            raise self.monitor.error(f"{ticket.name}: not reset")

    def _enable(self, command: g.GantryEnable, ticket: CommandStatus) -> None:
        monitor, bound = self.monitor, self.parameters.max_skew
        monitor.update()
        enables = ForEach({name: c.EnableCommand() for name in self.axes}, together=True)
        self._require_each(enables, ticket)
        before = monitor.bound
        if monitor.energised and command.skew is None:
            bound = before  # enabled already: nothing changes
        monitor.bound = max(bound, command.skew or 0.0)
        if monitor.skew is None or abs(monitor.skew) > monitor.bound:
            error = monitor.error(f"{ticket.name}: not enabled")
            monitor.bound = before
            raise error
        self._for_each(enables, ticket)

    # -- motion --------------------------------------------------------------------------------------------------------

    def _move(self, command: g.GantryMove, ticket: CommandStatus) -> None:
        if command.buffer and self._is_busy:
            self._require_no_stop(command.axes, ticket)
            self._queue.add(ticket, partial(self.accept, replace(command, buffer=False), ticket))
            return
        self._require_no_homing(ticket)
        self._require_fit(ticket)
        end = end_of_move(command, self._first, self._last_end)
        for name, position in self._both(end).items():
            end += self._allowed(name, position, ticket) - position
        ends = self._both(end)
        self._move_to(ends, command.velocity, command.acceleration, command.jerk, ticket)
        self._last_end = end

    def _both(self, end: float) -> dict[str, float]:
        return {self.parameters.first: end, self.parameters.second: end + self.monitor.square}

    def _move_velocity(self, command: g.GantryVelocity, ticket: CommandStatus) -> None:
        active = self._velocity_move
        if active is not None and active.change(command.velocity, ticket):
            return
        self._require_no_homing(ticket)
        self._require_fit(ticket)
        end = far_end(command.velocity, self._first, self._second, self.monitor.square, ticket.name)
        inner = CommandStatus(f"{ticket.name} [line]")
        self._move_to(self._both(end), abs(command.velocity), command.acceleration, None, inner)
        self._last_end = None
        if active is not None:
            active.end_replaced(ticket.name)
        self._velocity_move = self._last_velocity_move = GantryVelocityMove(
            command, ticket, inner, self._motion_of(inner)
        )

    def _resume(self, command: GroupContinue, ticket: CommandStatus) -> None:
        """As ``GroupCore``; a velocity move has no end to go on to, so it begins again, and is done at its last velocity."""
        last = self._last_velocity_move
        motion = None if last is None else last.motion
        if (
            last is None
            or motion is None
            or motion is not self._last_motion
            or not last.over
            or motion.is_at_its_end
        ):
            self._require_permitted(command, ticket)
            super().accept(command, ticket)
        else:
            self._move_velocity(last.command, ticket)

    def _motion_of(self, ticket: CommandStatus) -> PathMotion | None:
        motions = (each.motion for each in self._active if each.name == ticket.name and each.busy)
        return next((motion for motion in motions if isinstance(motion, PathMotion)), None)

    def _square(self, command: g.GantrySquare, ticket: CommandStatus) -> None:
        self._require_no_homing(ticket)
        self._require_rest(command.axes, ticket)
        ends = ends_of_squaring(command, self.parameters, self.axes, self.monitor, ticket.name)
        self._require_limits({command.axis: ends[command.axis]}, ticket)
        self._squaring = ticket
        self._move_to(ends, command.velocity, command.acceleration, None, ticket)
        self._last_end = None

    def _home(self, command: g.GantryHome, ticket: CommandStatus) -> None:
        plan = self.parameters.homing
        if plan is None:
            raise StateError(
                f"{ticket.name}: the cell file does not say how the pair is homed",
                remedy=f"add [gantries.{self.parameters.name}.homing] to cell.toml, or give its position: set_position(...)",
            )
        if self._is_busy:
            raise StateError(f"{ticket.name}: the pair is busy", remedy="wait for it, or halt it first")
        self._require_fit(ticket)
        for core in self.axes.values():
            core.forget_position()
        self.monitor.update()
        homing = GantryHoming(self.parameters, plan, command, self.axes, self.monitor, ticket)
        homing.begin(partial(self._move_home, command))
        self._homing = homing

    def _require_no_homing(self, ticket: CommandStatus) -> None:
        """Refuse a command while the pair is homed, also between its motions: while the touch probes are armed, for instance."""
        if self._homing is not None and self._homing.busy:
            raise StateError(
                f"{ticket.name}: the pair is being homed",
                remedy="wait for the end of the homing, or halt it first",
            )

    def _move_home(
        self, command: g.GantryHome, ends: Mapping[str, float], velocity: float, ticket: CommandStatus
    ) -> None:
        self._require_limits(ends, ticket)
        self._move_to(ends, velocity, command.acceleration, None, ticket)

    def _set_position(self, command: g.GantrySetPosition, ticket: CommandStatus) -> None:
        self._require_no_homing(ticket)
        skew = self.monitor.skew
        here = [core.image.position for core in self.axes.values()]
        still = all(core.image.standstill and core.state not in MOVING for core in self.axes.values())
        if not still or any(core.state is AxisState.STOPPING for core in self.axes.values()):
            raise StateError(f"{ticket.name}: the beam moves", remedy="set the position at standstill")
        if skew is None or None in here:
            raise self.monitor.error(f"{ticket.name}: not set")
        for core in self.axes.values():
            require_own_zero(core.parameters, ticket)
        second = command.position + self.parameters.offset + (0.0 if command.square else skew)
        for core, position in zip(self.axes.values(), (command.position, second), strict=True):
            define_position(core, position)
        self._last_end = None
        ticket.finish(Status.DONE)

    def _move_to(
        self,
        ends: Mapping[str, float],
        velocity: float,
        acceleration: float,
        jerk: float | None,
        ticket: CommandStatus,
    ) -> None:
        """Move both axes along one line; velocity, acceleration and jerk apply to the axis with the longer distance."""
        distances = [end - (demand_position_of(self.axes[name]) or 0.0) for name, end in ends.items()]
        farthest = max(abs(distance) for distance in distances)
        factor = math.hypot(*distances) / farthest if farthest else 1.0
        path_jerk = None if jerk is None else factor * jerk
        self._move_along(MoveLinear(ends, factor * velocity, factor * acceleration, path_jerk), ticket)

    # -- checks --------------------------------------------------------------------------------------------------------

    def _require_fit(self, ticket: CommandStatus) -> None:
        """Raise StateError if the beam cannot move as one: not at rest, position unknown, or a wider bound in force."""
        self._require_rest(self.parameters.axes, ticket)
        if self.monitor.skew is None:
            raise self.monitor.error(f"{ticket.name}: not begun")
        if self.monitor.is_widened:
            raise self._widened_error(ticket.name)

    def _require_limits(self, ends: Mapping[str, float], ticket: CommandStatus) -> None:
        for name, end in ends.items():
            self._allowed(name, end, ticket)

    def _allowed(self, name: str, end: float, ticket: CommandStatus) -> float:
        """Return the permitted end for an axis that is to move to ``end`` (``allowed_end``); raise LimitError if there is none."""
        core, image = self.axes[name], self.axes[name].image
        units, start = core.parameters.units.position, demand_position_of(core)
        assert start is not None  # the skew is known
        assert image.position is not None
        requested = units.to_increments(end)
        require_count(core.parameters, image.position, requested + image.origin, image.origin, ticket)
        if not core.bounded:
            return end
        begin = units.to_increments(start)
        found = require_within_limits(core.parameters, requested, ticket, begin, NOISE)
        return end if found == requested else units.to_units(found)


def define_position(core: AxisCore, position: float) -> None:
    """Define the axis's present position as ``position`` (in its unit)."""
    here = core.image.position
    assert here is not None
    core.confirm_position(here - core.parameters.units.position.to_increments(position))


_OWN: dict[type, Callable[[GantryCore, Any, CommandStatus], None]] = {
    g.GantryEnable: GantryCore._enable,
    g.GantryMove: GantryCore._move,
    g.GantryVelocity: GantryCore._move_velocity,
    g.GantryHome: GantryCore._home,
    g.GantrySquare: GantryCore._square,
    g.GantrySetPosition: GantryCore._set_position,
    GroupContinue: GantryCore._resume,
}
