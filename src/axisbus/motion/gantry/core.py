"""A gantry pair in the core: a group of two axes whose way is one place, with the skew watched in every cycle.

Theory of operation
-------------------
Every motion of the pair is a straight line of a group (``group.line``), from where both are led to, to one place of the first axis
and that plus the offset of the second. Both have their shares of one way and one travel along it, so one set-point leads both; a
halt, an override and a resumption act on the travel, and nothing leads one of them without the other. A beam that stands a little
out of square is square at the end of its next move.

The skew is looked at before the axes step (``skew``). What is found is told to both in that cycle: they go to ErrorStop, and brake
along the line that they are on, as hard as all axes of that line may; where no line leads them, by the ladder of each. At rest, a
beam that is bent still is quick-stopped: a side that is held would leap to its target when it comes free. Where one of them has
failed by itself, the fault policy stops the other along the same line, and that is braked as hard.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from copy import copy
from dataclasses import replace
from functools import partial
from typing import Any

from axisbus.errors import AxisbusError, LimitError, SkewError, StateError
from axisbus.motion import commands as c
from axisbus.motion.axis.accept_motion import require_within_limits
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.commands import Reference
from axisbus.motion.gantry import commands as g
from axisbus.motion.gantry.homing import Homing
from axisbus.motion.gantry.parameters import GantryParameters
from axisbus.motion.gantry.skew import Watch, led_place_of, place_of
from axisbus.motion.gantry.turning import Turning
from axisbus.motion.group.commands import ForEach, GroupCommand, GroupContinue, MoveLinear
from axisbus.motion.group.core import GroupCore
from axisbus.motion.group.line import Line
from axisbus.motion.states import MOVING, AxisState
from axisbus.motion.stop.ladder import Rung, Then
from axisbus.motion.stop.stopping import StopKind
from axisbus.motion.ticket import Status, Ticket
from axisbus.units import INT32_HALF

_FAR = 0.25  # of the half of INTEGER32: how far a beam without position limits goes, where it is told no end


class GantryCore(GroupCore):
    """The group of a pair's axes; holds the watch over their skew, and what of its own is under way."""

    def __init__(
        self,
        parameters: GantryParameters,
        axes: Mapping[str, AxisCore],
        period: float,
        groups: Callable[[], Iterable[GroupCore]],
    ) -> None:
        """As ``GroupCore``; ``groups``: all that there are, this one with them: any of them may lead both with other axes."""
        super().__init__(axes, period)
        self._groups = groups
        self.parameters = parameters
        self._first, self._second = (axes[name] for name in parameters.axes)
        self.watch = Watch(parameters, self._first, self._second)
        self._homing: Homing | None = None
        self._turning: Turning | None = None
        self._squaring: Ticket | None = None
        self._bent = False  # so that both are being stopped
        self._ends_at: float | None = None  # the last place that the beam was told to go to

    def accept(self, command: GroupCommand, ticket: Ticket) -> None:
        """As ``GroupCore.accept``."""
        self._end_squaring()
        own = _OWN.get(type(command))
        try:
            if own is not None:
                own(self, command, ticket)
            else:
                self._require_ours(command, ticket)
        except AxisbusError as error:
            ticket.finish(Status.ERROR, error)
        if own is None and ticket.busy:
            super().accept(command, ticket)
        self._ended = self._ended or not ticket.busy

    def step(self) -> None:
        """Once per cycle, before the axes."""
        self.watch.look()
        error = self.watch.finding()
        if error is not None:
            self._stop_both(error)
        elif any(core.state is AxisState.ERRORSTOP for core in self.axes.values()):
            self._brake_hard()
        if self._bent:
            self._let_nothing_pull()
        self._look_at_own()
        super().step()

    def abandon(self, ended: Callable[[str], AxisbusError]) -> None:
        """As ``GroupCore.abandon``."""
        for own in (self._homing, self._turning):
            if own is not None:
                own.abandon(ended(own.name))
        super().abandon(ended)

    @property
    def _is_busy(self) -> bool:
        return super()._is_busy or (self._homing is not None and self._homing.busy)

    def let_lead(self, name: str) -> AxisbusError | None:
        """Let a way of another group lead both with other axes; return why it must not (``name`` says what was asked for)."""
        self._end_squaring()
        self._ends_at = None
        if self._homing is not None and self._homing.busy:
            return StateError(
                f"{name}: {self.parameters.name} is being homed", remedy="wait for it, or halt it first"
            )
        return self._too_wide(name) if self.watch.wide else None

    def _too_wide(self, name: str) -> StateError:
        return StateError(
            f"{name}: the pair was enabled with a wider bound of {self.watch.bound:.6g} {self.watch.unit}",
            observed=self.watch.places,
            remedy=f"make the beam square first: {self.parameters.name}.square(velocity=...), slowly",
        )

    # -- the watch -----------------------------------------------------------------------------------------------------

    def _stop_both(self, error: SkewError) -> None:
        """Stop both along their line, where one leads them, else each by its ladder."""
        if self._homing is not None:
            self._homing.give_up(error)
        failing = self.watch.failing()
        self._bent = True
        self._brake_hard()
        for core in failing:
            path = core.leading_path
            if path is not None and len(failing) == len(self.axes):
                path.brakes_along = True
            core.break_off(copy(error))

    def _let_nothing_pull(self) -> None:
        """Quick-stop both once their way is at rest, if the beam is bent still: a side that comes free would leap to its target."""
        halting = [
            core for core in self.axes.values() if core.ladder is not None and core.ladder.rung is Rung.HALT
        ]
        if not halting:
            self._bent = False
        elif all(core.leading_path is None for core in self.axes.values()):
            self._bent = False
            if self.watch.skew is not None and abs(self.watch.skew) > self.watch.bound:
                for core in halting:
                    core.stop_because(
                        StopKind.ERROR, Then.HOLD, Rung.QUICK_STOP, "the beam is out of square still", None
                    )

    def _brake_hard(self) -> None:
        """Let the line that leads both, of whichever group, brake as hard as all of its axes may."""
        for group in self._groups():
            group.brake_hard(self.axes)

    def _look_at_own(self) -> None:
        if self._homing is not None:
            self._homing.step()
            self._ended = self._ended or not self._homing.busy
            self._homing = self._homing if self._homing.busy else None
        if self._turning is not None:
            self._ended = self._turning.step() or self._ended
            self._turning = None if self._turning.over else self._turning
        self._end_squaring()

    def _end_squaring(self) -> None:
        """Let ``max_skew`` hold again where the beam has been made square."""
        ticket = self._squaring
        if ticket is None or ticket.busy:
            return
        self._squaring = None
        skew = self.watch.skew
        if ticket.status is Status.DONE and skew is not None and abs(skew) <= self.parameters.max_skew:
            self.watch.narrow()

    # -- power ---------------------------------------------------------------------------------------------------------

    def _require_ours(self, command: GroupCommand, ticket: Ticket) -> None:
        """Raise where what is for groups is not for this one now."""
        singles = command.commands.values() if isinstance(command, ForEach) else ()
        if isinstance(command, GroupContinue) and self.watch.wide:
            self._require_fit(ticket)
        out_of_square = self.watch.skew is not None and abs(self.watch.skew) > self.watch.bound
        if any(isinstance(each, c.Reset) for each in singles) and out_of_square and self.watch.energised:
            raise self.watch.error(f"{ticket.name}: not reset")

    def _enable(self, command: g.GantryEnable, ticket: Ticket) -> None:
        watch, bound = self.watch, self.parameters.max_skew
        watch.look()
        if watch.energised and command.skew is None:
            bound = watch.bound  # asked for again: nothing changes
        watch.bound = max(bound, command.skew or 0.0)
        if watch.skew is None or abs(watch.skew) > watch.bound:
            error = watch.error(f"{ticket.name}: not enabled")
            watch.narrow()
            raise error
        enables = {name: c.Enable() for name in self.axes}
        self._for_each(ForEach(enables, together=True), ticket)

    # -- motion --------------------------------------------------------------------------------------------------------

    def _move(self, command: g.GantryMove, ticket: Ticket) -> None:
        if command.buffer and self._is_busy:
            self._require_no_stop(command.axes, ticket)
            self._queue.add(ticket, partial(self.accept, replace(command, buffer=False), ticket))
            return
        self._require_fit(ticket)
        end = self._end_of(command)
        ends = self._both(end)
        self._require_limits(ends, ticket)
        self._lead_to(ends, command.velocity, command.acceleration, command.jerk, ticket)
        self._ends_at = end

    def _end_of(self, command: g.GantryMove) -> float:
        if command.reference is Reference.ABSOLUTE:
            return command.value
        base = place_of(self._first)
        if command.reference is Reference.ADDITIVE and self._ends_at is not None:
            base = self._ends_at
        assert base is not None  # the skew is known
        return base + command.value

    def _both(self, end: float) -> dict[str, float]:
        return {self.parameters.first: end, self.parameters.second: end + self.watch.square}

    def _turn(self, command: g.GantryVelocity, ticket: Ticket) -> None:
        turning = self._turning
        if turning is not None and turning.change(command.velocity, ticket):
            return
        self._require_fit(ticket)
        end = self._far_end(command.velocity)
        inner = Ticket(f"{ticket.name} [line]")
        self._lead_to(self._both(end), abs(command.velocity), command.acceleration, None, inner)
        self._ends_at = None
        self._turning = Turning(command.velocity, ticket, inner, self._line_of(inner))

    def _line_of(self, ticket: Ticket) -> Line | None:
        lines = (each.line for each in self._under_way if each.name == ticket.name and each.busy)
        return next((line for line in lines if isinstance(line, Line)), None)

    def _far_end(self, velocity: float) -> float:
        """Return the place of the beam to which nothing but its limits, or the count of its drives, lets it go."""
        first, second = self._first, self._second
        if first.bounded and second.bounded:
            found = [
                limits[velocity > 0.0] - more
                for core, more in ((first, 0.0), (second, self.watch.square))
                if (limits := core.parameters.limits.position) is not None
            ]
            if found:
                return min(found) if velocity > 0.0 else max(found)
        here = led_place_of(first)
        assert here is not None
        far = _FAR * INT32_HALF / max(abs(core.parameters.units.position.factor) for core in (first, second))
        return here + math.copysign(far, velocity)

    def _square(self, command: g.GantrySquare, ticket: Ticket) -> None:
        self._require_rest(command.axes, ticket)
        watch = self.watch
        if watch.skew is None:
            raise watch.error(f"{ticket.name}: not begun")
        places = {name: led_place_of(core) for name, core in self.axes.items()}
        ends = {name: place for name, place in places.items() if place is not None}
        if command.distance is not None:
            ends[command.axis] += command.distance
        elif command.axis == self.parameters.first:
            ends[command.axis] = ends[self.parameters.second] - watch.square
        else:
            ends[command.axis] = ends[self.parameters.first] + watch.square
        left = ends[self.parameters.second] - ends[self.parameters.first] - watch.square
        if abs(left) > watch.bound:
            raise LimitError(
                f"{ticket.name}: the beam would be {abs(left):.6g} {watch.unit} out of square; {watch.bound:.6g} are allowed",
                observed=watch.places,
                remedy="move it less far, or the other way",
            )
        self._require_limits({command.axis: ends[command.axis]}, ticket)
        self._squaring = ticket
        self._lead_to(ends, command.velocity, command.acceleration, None, ticket)
        self._ends_at = None

    def _home(self, command: g.GantryHome, ticket: Ticket) -> None:
        plan = self.parameters.homing
        if plan is None:
            raise StateError(
                f"{ticket.name}: nothing says how the pair is homed",
                remedy=f"add [gantries.{self.parameters.name}.homing] to cell.toml, or say where it is: set_position(...)",
            )
        if self._is_busy:
            raise StateError(f"{ticket.name}: the pair is busy", remedy="wait for it, or halt it first")
        self._require_fit(ticket)
        for core in self.axes.values():
            core.forget_position()
        self.watch.look()
        homing = Homing(self.parameters, plan, command, self.axes, self.watch, ticket)
        homing.begin(partial(self._lead_home, command))
        self._homing = homing

    def _lead_home(
        self, command: g.GantryHome, ends: Mapping[str, float], velocity: float, ticket: Ticket
    ) -> None:
        self._require_limits(ends, ticket)
        self._lead_to(ends, velocity, command.acceleration, None, ticket)

    def _set_position(self, command: g.GantrySetPosition, ticket: Ticket) -> None:
        skew = self.watch.skew
        here = [core.image.position for core in self.axes.values()]
        still = all(core.image.standstill and core.state not in MOVING for core in self.axes.values())
        if not still or any(core.state is AxisState.STOPPING for core in self.axes.values()):
            raise StateError(f"{ticket.name}: the beam moves", remedy="set the position at standstill")
        if skew is None or None in here:
            raise self.watch.error(f"{ticket.name}: not set")
        second = command.position + self.parameters.offset + (0.0 if command.square else skew)
        for core, place in zip(self.axes.values(), (command.position, second), strict=True):
            set_place(core, place)
        self._ends_at = None
        ticket.finish(Status.DONE)

    def _lead_to(
        self,
        ends: Mapping[str, float],
        velocity: float,
        acceleration: float,
        jerk: float | None,
        ticket: Ticket,
    ) -> None:
        """Lead both along one line; velocity and so on are those of the axis that goes farther."""
        ways = [end - (led_place_of(self.axes[name]) or 0.0) for name, end in ends.items()]
        farthest = max(abs(way) for way in ways)
        by = math.hypot(*ways) / farthest if farthest else 1.0
        soft = None if jerk is None else by * jerk
        self._move_along(MoveLinear(ends, by * velocity, by * acceleration, soft), ticket)

    # -- what is refused -----------------------------------------------------------------------------------------------

    def _require_fit(self, ticket: Ticket) -> None:
        """Raise StateError where the beam cannot be moved as one: not at rest, not known, or out of square."""
        self._require_rest(self.parameters.axes, ticket)
        if self.watch.skew is None:
            raise self.watch.error(f"{ticket.name}: not begun")
        if self.watch.wide:
            raise self._too_wide(ticket.name)

    def _require_limits(self, ends: Mapping[str, float], ticket: Ticket) -> None:
        for name, end in ends.items():
            core = self.axes[name]
            if core.bounded:
                require_within_limits(
                    core.parameters, core.parameters.units.position.to_increments(end), ticket
                )


def set_place(core: AxisCore, place: float) -> None:
    """Call where an axis is ``place`` (its unit) from now on."""
    here = core.image.position
    assert here is not None
    core.confirm_position(here - core.parameters.units.position.to_increments(place))


_OWN: dict[type, Callable[[GantryCore, Any, Ticket], None]] = {
    g.GantryEnable: GantryCore._enable,
    g.GantryMove: GantryCore._move,
    g.GantryVelocity: GantryCore._turn,
    g.GantryHome: GantryCore._home,
    g.GantrySquare: GantryCore._square,
    g.GantrySetPosition: GantryCore._set_position,
}
