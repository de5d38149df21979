"""A slave that follows its master: how it synchronises, and its set-point in each cycle.

Theory of operation
-------------------
A coupling is stepped once per cycle before the axes, like the path of a group, and leaves the set-point for its follower
(``Coupled``). It uses the position that was commanded to the master in the previous cycle: a slave is one cycle behind.

1. The slave is at standstill (or continues its motion) until synchronisation begins: with ``SyncAtPositions`` it waits for the
   master to reach the start of the synchronisation distance.
2. The slave synchronises: by its acceleration up to the required speed (``SyncAtSpeed``), or along a ``SyncCurve`` over a
   distance of the master.
3. The slave is synchronised: in each cycle it follows the gear or cam.

The axis gets nothing but positions. So every check of a path applies here as well: the limits, velocity and acceleration from cycle
to cycle, and the following error.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from axisbus.errors import AxisbusError, LimitError, StateError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.coupling.definition import SlaveReference, SyncAtPositions, SyncAtSpeed, SyncFromPresent
from axisbus.motion.coupling.master import Master
from axisbus.motion.coupling.slave_axis import Coupled, PhaseShift
from axisbus.motion.group.commands import Couple
from axisbus.motion.moves.follow import Follow

_FADE = 0.5  # seconds in which a slave's initial deviation is removed


class Engagement:
    """One slave and its master. ``position``: set-point of the slave; ``failure``: why the slave can no longer be commanded."""

    def __init__(
        self, command: Couple, master: AxisCore, slave: AxisCore, period: float, before: Follow | None
    ) -> None:
        """``before``: the path that commands the slave now; None if there is none. ``period``: scan period in seconds."""
        self.is_synchronised = False
        self.planned = False  # it commands the slave
        self.failure: AxisbusError | None = None
        # whether the failure is that the slave cannot synchronise, before any motion of it
        self.refused = False
        self.position = 0.0
        self.phase = PhaseShift(period)
        self.master = Master(master, command.master_value, period)
        self.follow = Coupled(self, slave.parameters, before)
        self._slave = slave.parameters
        self._command = command
        self._law = command.law
        self._period = period
        self._speed = 0.0  # of the slave, in its unit per s
        self._offset = 0.0  # offset of the slave from the result of its gear or cam
        self._fade: SyncCurve | None = None  # the initial deviation, by the seconds since synchronisation
        self._since = 0.0
        self._previous_master: float | None = None  # position of the master in the previous cycle
        self._next_position: Callable[[], float] = self._wait

    # -- GroupSetPointSource -------------------------------------------------------------------------------------------

    def step(self, _period: float, _begins: bool, _name: str) -> None:
        """Once per cycle, before the axes: update the set-point. An error is passed to the slave, which then brakes."""
        try:
            self.master.step()
            if self.planned:
                self._go_on()
        except AxisbusError as error:
            self.failure = self.failure or self._lost_error(error)

    @property
    def abort_error(self) -> AxisbusError | None:
        """None: the slave itself stops the motion."""
        return None

    def take_commanded(self) -> bool:
        """Return whether the slave was commanded since the last call."""
        return self.follow.take_stepped()

    # -- the slave -----------------------------------------------------------------------------------------------------

    def require_start(self, position: float, velocity: float) -> None:
        """Raise AxisbusError if a slave at ``position`` with ``velocity`` (unit/s) cannot be coupled in the master's present state.

        Uses a temporary ``Master``, because this coupling's own begins with the slave.
        """
        master = Master(self.master.core, self._command.master_value, self._period)
        try:
            master.step()
        except AxisbusError as error:
            raise self._lost_error(error, "nothing has moved") from error
        entry, law, m = self._command.entry, self._command.law, master.position
        if isinstance(entry, SyncFromPresent) and not entry.master_distance and not entry.relative:
            self._require_near(
                position + velocity * self._period - law.at(m).position + law.accumulated_lift(m)
            )
        elif isinstance(entry, SyncAtPositions) and (entry.master - m) * master.velocity > 0.0:
            self._require_far(entry, m)

    def begin_commanding(self, position: float, velocity: float) -> None:
        """Command the slave, which is at ``position`` with ``velocity`` (unit/s), from the next cycle on."""
        self.planned = True
        self._speed = velocity
        self.position = position + velocity * self._period

    def _go_on(self) -> None:
        before = self.position
        self.refused = self._next_position == self._wait
        self.position = self._next_position()
        self.refused = False
        self._speed = (self.position - before) / self._period
        self._previous_master = self.master.position

    def _wait(self) -> float:
        entry, law, m = self._command.entry, self._command.law, self.master.position
        if isinstance(entry, SyncAtSpeed):
            self._next_position = self._accelerate
            return self._next_position()
        if isinstance(entry, SyncAtPositions):
            end = self._sync_end(entry)
            if end is not None:
                self._offset = self._nearest(entry, end) - law.at(end).position
                self._begin_sync_curve(end)
                return self._next_position()
        elif not entry.master_distance:
            self._synchronise_at_once(entry.relative)
            return self._next_position()
        elif self._previous_master is not None and m != self._previous_master:
            self._offset = self.position - law.at(m).position if entry.relative else -law.accumulated_lift(m)
            self._begin_sync_curve(m + math.copysign(entry.master_distance, m - self._previous_master))
            return self._next_position()
        return self.position + self._speed * self._period

    def _accelerate(self) -> float:
        """Change the speed by the acceleration; the slave is synchronised at the required speed."""
        entry, m = self._command.entry, self.master
        assert isinstance(entry, SyncAtSpeed)
        due = self._command.law.at(m.position)
        wanted, change = due.slope * m.velocity, entry.acceleration * self._period
        speed = min(max(wanted, self._speed - change), self._speed + change)
        position = self.position + speed * self._period
        if speed == wanted:
            self._offset = position - due.position
            self._set_synchronised()
        return position

    def _begin_sync_curve(self, end: float) -> None:
        """Begin to synchronise while the master moves to ``end``."""
        m = self.master
        slope = self._speed / m.velocity if m.velocity else 0.0
        goal = self._command.law.at(end)
        start = SlaveReference(self.position + self._speed * self._period, slope, 0.0)
        self._sync_curve = SyncCurve(
            m.position, end, start, goal._replace(position=goal.position + self._offset)
        )
        self._next_position = self._follow_sync_curve

    def _follow_sync_curve(self) -> float:
        sync_curve, m = self._sync_curve, self.master.position
        if sync_curve.share(m) < 1.0:
            return sync_curve.at(m)
        self._set_synchronised()
        return self._follow_master()

    def _synchronise_at_once(self, relative: bool) -> None:
        """Synchronise at once: raise LimitError unless the slave is at its set-point, within its position window."""
        law, m = self._command.law, self.master
        due = law.at(m.position)
        here = self.position + self._speed * self._period
        self._offset = here - due.position if relative else -law.accumulated_lift(m.position)
        deviation = here - due.position - self._offset
        self._require_near(deviation)
        self._fade = (
            SyncCurve(0.0, _FADE, SlaveReference(deviation, 0.0, 0.0), SlaveReference(0.0, 0.0, 0.0))
            if deviation
            else None
        )
        self._set_synchronised()

    def _set_synchronised(self) -> None:
        self._next_position, self.is_synchronised, self._since = self._follow_master, True, 0.0

    def _follow_master(self) -> float:
        self.phase.step()
        due = self._law.position(self.master.position + self.phase.value) + self._offset
        if self._fade is None:
            return due
        self._since += self._period
        if self._since >= _FADE:
            self._fade = None
            return due
        return due + self._fade.at(self._since)

    def _sync_end(self, entry: SyncAtPositions) -> float | None:
        """Return the master's synchronisation position in the cycle in which synchronisation begins, otherwise None."""
        before, m = self._previous_master, self.master.position
        modulo = self.master.core.parameters.units.modulo
        if before is None or m == before:
            return None
        ahead = math.copysign(entry.master_distance, m - before)
        start = entry.master - ahead
        if modulo is None:
            if (entry.master - m) * (m - before) > 0.0:
                self._require_far(entry, before)
            return entry.master if min(before, m) <= start <= max(before, m) else None
        turns = math.floor((max(before, m) - start) / modulo)
        return entry.master + turns * modulo if min(before, m) <= start + turns * modulo else None

    def _nearest(self, entry: SyncAtPositions, end: float) -> float:
        """Return the slave's synchronisation position; for a modulo axis, in the turn nearest to its expected position."""
        modulo = self._slave.units.modulo
        if modulo is None:
            return entry.slave
        slope = self._command.law.at(end).slope
        likely = self.position + 0.5 * slope * (end - self.master.position)
        return entry.slave + modulo * round((likely - entry.slave) / modulo)

    # -- errors --------------------------------------------------------------------------------------------------------

    def _require_near(self, deviation: float) -> None:
        units = self._slave.units.position
        allowed = abs(units.to_units(self._slave.position_tolerance))
        if abs(deviation) <= allowed:
            return
        raise LimitError(
            f"{self._slave.name} is not at the position that belongs to the position of {self.master.name}",
            observed=f"it is {abs(deviation):.6g} {units.unit} away from it; {allowed:.6g} {units.unit} are allowed",
            remedy="move it there first, give master_start_distance (the distance of the master within which the slave "
            "reaches it), or let it begin at its present position: relative = True",
        )

    def _require_far(self, entry: SyncAtPositions, master: float) -> None:
        m = self.master
        left, unit = abs(entry.master - master), m.core.parameters.units.position.unit
        if left >= entry.master_distance or m.core.parameters.units.modulo is not None:
            return
        raise LimitError(
            f"{m.name} was too near to {entry.master:g} {unit} for {self._slave.name} to synchronise",
            observed=f"it was {left:.6g} {unit} away, master_start_distance = {entry.master_distance:g}",
            remedy=f"start {m.name} farther away, or give a shorter distance (master_start_distance = ...)",
        )

    def _lost_error(self, error: AxisbusError, then: str = "the axis was braked") -> AxisbusError:
        slave, master = self._slave.name, self.master.name
        if isinstance(error, LimitError):
            return error
        return StateError(
            f"{slave}: its master is lost: {error.message}",
            observed=error.observed,
            remedy=f"clear the error of {master} first, then couple {slave} to it again; {then}",
        )


# ----------------------------------------------------------------------------------------------------------------------
# The synchronisation curve of a slave, from its own position and slope to the required ones, over a distance of its master.


class SyncCurve:
    """A polynomial of degree five over the master's positions ``begin`` to ``end``; slope and ``bend`` do not jump at its ends."""

    __slots__ = ("_begin", "_factors", "_length", "_slope")

    def __init__(self, begin: float, end: float, start: SlaveReference, goal: SlaveReference) -> None:
        """``begin`` and ``end`` must differ; ``end`` is the lower one if the master moves backwards."""
        length = end - begin
        a, b, c = start.position, start.slope * length, 0.5 * start.bend * length**2
        position = goal.position - a - b - c
        slope = goal.slope * length - b - 2.0 * c
        bend = goal.bend * length**2 - 2.0 * c
        d = 10.0 * position - 4.0 * slope + 0.5 * bend
        e = -15.0 * position + 7.0 * slope - bend
        f = 6.0 * position - 3.0 * slope + 0.5 * bend
        self._begin, self._length = begin, length
        self._factors = a, b, c, d, e, f
        self._slope = start.slope

    def share(self, master: float) -> float:
        """Return the share of the curve that the master has passed: 0 at its beginning, 1 at its end."""
        return (master - self._begin) / self._length

    def at(self, master: float) -> float:
        """Return the slave's set-point; before the beginning, linear extrapolation."""
        a, b, c, d, e, f = self._factors
        u = self.share(master)
        if u <= 0.0:
            return a + self._slope * (master - self._begin)
        return a + u * (b + u * (c + u * (d + u * (e + u * f))))
