"""A slave that follows its master: how it synchronises, and its set-point in each cycle.

Theory of operation
-------------------
A coupling is stepped once per cycle before the axes, like the path of a group, and leaves the set-point for its follower
(``Coupled``). It uses the position that was commanded to the master in the previous cycle: a slave is one cycle behind.

1. The slave is at standstill (or continues its motion) until synchronisation begins: with ``AtPlace`` it waits for the master to
   reach the start of the synchronisation distance.
2. The slave synchronises: by its acceleration up to the required speed (``SyncAtSpeed``), or along a ``SyncInCurve`` over a
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
from axisbus.motion.coupling.definition import AtPlace, SlaveReference, SyncAtSpeed, SyncInPlace
from axisbus.motion.coupling.master import Master
from axisbus.motion.coupling.slave_axis import Coupled, PhaseShift
from axisbus.motion.group.commands import Couple
from axisbus.motion.moves.follow import Follow

_FADE = 0.5  # seconds in which a slave's initial deviation is removed


class Engagement:
    """One slave and its master. ``place``: set-point of the slave; ``failure``: why the slave can no longer be commanded."""

    def __init__(
        self, command: Couple, master: AxisCore, slave: AxisCore, period: float, before: Follow | None
    ) -> None:
        """``before``: the path that commands the slave now; None if there is none. ``period``: scan period in seconds."""
        self.in_step = False
        self.planned = False  # it commands the slave
        self.failure: AxisbusError | None = None
        self.refused = (
            False  # whether the failure is that the slave cannot synchronise, before any motion of it
        )
        self.place = 0.0
        self.phase = PhaseShift(period)
        self.master = Master(master, command.by, period)
        self.follow = Coupled(self, slave.parameters, before)
        self._slave = slave.parameters
        self._command = command
        self._law = command.law
        self._period = period
        self._speed = 0.0  # of the slave, in its unit per s
        self._base = 0.0  # offset of the slave from the result of its gear or cam
        self._fade: SyncInCurve | None = None  # the initial deviation, by the seconds since synchronisation
        self._since = 0.0
        self._passed: float | None = None  # position of the master in the previous cycle
        self._lead: Callable[[], float] = self._wait

    # -- GroupSetPointSource -------------------------------------------------------------------------------------------

    def step(self, _period: float, _begins: bool, _name: str) -> None:
        """Once per cycle, before the axes: update the set-point. An error is passed to the slave, which then brakes."""
        try:
            self.master.step()
            if self.planned:
                self._go_on()
        except AxisbusError as error:
            self.failure = self.failure or self._lost(error)

    @property
    def gives_up(self) -> AxisbusError | None:
        """None: the slave itself stops the motion."""
        return None

    def leads(self) -> bool:
        """Return whether the slave was commanded since the last call."""
        return self.follow.take_stepped()

    # -- the slave -----------------------------------------------------------------------------------------------------

    def require_start(self, place: float, velocity: float) -> None:
        """Raise AxisbusError if a slave at ``place`` with ``velocity`` (unit/s) cannot be coupled in the master's present state.

        Uses a temporary ``Master``, because this coupling's own begins with the slave.
        """
        master = Master(self.master.core, self._command.by, self._period)
        try:
            master.step()
        except AxisbusError as error:
            raise self._lost(error, "nothing has moved") from error
        entry, law, m = self._command.entry, self._command.law, master.place
        if isinstance(entry, SyncInPlace) and not entry.over and not entry.relative:
            self._require_near(place + velocity * self._period - law.at(m).place + law.raised(m))
        elif isinstance(entry, AtPlace) and (entry.master - m) * master.velocity > 0.0:
            self._require_far(entry, m)

    def take_up(self, place: float, velocity: float) -> None:
        """Command the slave, which is at ``place`` with ``velocity`` (unit/s), from the next cycle on."""
        self.planned = True
        self._speed = velocity
        self.place = place + velocity * self._period

    def _go_on(self) -> None:
        before = self.place
        self.refused = self._lead == self._wait
        self.place = self._lead()
        self.refused = False
        self._speed = (self.place - before) / self._period
        self._passed = self.master.place

    def _wait(self) -> float:
        entry, law, m = self._command.entry, self._command.law, self.master.place
        if isinstance(entry, SyncAtSpeed):
            self._lead = self._take_up_speed
            return self._lead()
        if isinstance(entry, AtPlace):
            end = self._met(entry)
            if end is not None:
                self._base = self._nearest(entry, end) - law.at(end).place
                self._begin_blend(end)
                return self._lead()
        elif not entry.over:
            self._join(entry.relative)
            return self._lead()
        elif self._passed is not None and m != self._passed:
            self._base = self.place - law.at(m).place if entry.relative else -law.raised(m)
            self._begin_blend(m + math.copysign(entry.over, m - self._passed))
            return self._lead()
        return self.place + self._speed * self._period

    def _take_up_speed(self) -> float:
        """Change the speed by the acceleration; the slave is synchronised at the required speed."""
        entry, m = self._command.entry, self.master
        assert isinstance(entry, SyncAtSpeed)
        due = self._command.law.at(m.place)
        wanted, change = due.slope * m.velocity, entry.acceleration * self._period
        speed = min(max(wanted, self._speed - change), self._speed + change)
        place = self.place + speed * self._period
        if speed == wanted:
            self._base = place - due.place
            self._be_in_step()
        return place

    def _begin_blend(self, end: float) -> None:
        """Begin to synchronise while the master moves to ``end``."""
        m = self.master
        slope = self._speed / m.velocity if m.velocity else 0.0
        goal = self._command.law.at(end)
        start = SlaveReference(self.place + self._speed * self._period, slope, 0.0)
        self._blend = SyncInCurve(m.place, end, start, goal._replace(place=goal.place + self._base))
        self._lead = self._go_along_blend

    def _go_along_blend(self) -> float:
        blend, m = self._blend, self.master.place
        if blend.share(m) < 1.0:
            return blend.at(m)
        self._be_in_step()
        return self._in_step()

    def _join(self, relative: bool) -> None:
        """Synchronise at once: raise LimitError unless the slave is at its set-point, within its position window."""
        law, m = self._command.law, self.master
        due = law.at(m.place)
        here = self.place + self._speed * self._period
        self._base = here - due.place if relative else -law.raised(m.place)
        off = here - due.place - self._base
        self._require_near(off)
        self._fade = (
            SyncInCurve(0.0, _FADE, SlaveReference(off, 0.0, 0.0), SlaveReference(0.0, 0.0, 0.0))
            if off
            else None
        )
        self._be_in_step()

    def _be_in_step(self) -> None:
        self._lead, self.in_step, self._since = self._in_step, True, 0.0

    def _in_step(self) -> float:
        self.phase.step()
        due = self._law.place(self.master.place + self.phase.value) + self._base
        if self._fade is None:
            return due
        self._since += self._period
        if self._since >= _FADE:
            self._fade = None
            return due
        return due + self._fade.at(self._since)

    def _met(self, entry: AtPlace) -> float | None:
        """Return the master's synchronisation position in the cycle in which synchronisation begins, otherwise None."""
        before, m = self._passed, self.master.place
        modulo = self.master.core.parameters.units.modulo
        if before is None or m == before:
            return None
        ahead = math.copysign(entry.over, m - before)
        gate = entry.master - ahead
        if modulo is None:
            if (entry.master - m) * (m - before) > 0.0:
                self._require_far(entry, before)
            return entry.master if min(before, m) <= gate <= max(before, m) else None
        turns = math.floor((max(before, m) - gate) / modulo)
        return entry.master + turns * modulo if min(before, m) <= gate + turns * modulo else None

    def _nearest(self, entry: AtPlace, end: float) -> float:
        """Return the slave's synchronisation position; for a modulo axis, in the turn nearest to its expected position."""
        modulo = self._slave.units.modulo
        if modulo is None:
            return entry.slave
        slope = self._command.law.at(end).slope
        likely = self.place + 0.5 * slope * (end - self.master.place)
        return entry.slave + modulo * round((likely - entry.slave) / modulo)

    # -- errors --------------------------------------------------------------------------------------------------------

    def _require_near(self, off: float) -> None:
        units = self._slave.units.position
        allowed = abs(units.to_units(self._slave.place_window))
        if abs(off) <= allowed:
            return
        raise LimitError(
            f"{self._slave.name} is not at the position that belongs to the position of {self.master.name}",
            observed=f"it is {abs(off):.6g} {units.unit} away from it; {allowed:.6g} {units.unit} are allowed",
            remedy="move it there first, give master_start_distance (the distance of the master within which the slave "
            "reaches it), or let it begin at its present position: relative = True",
        )

    def _require_far(self, entry: AtPlace, master: float) -> None:
        m = self.master
        left, unit = abs(entry.master - master), m.core.parameters.units.position.unit
        if left >= entry.over or m.core.parameters.units.modulo is not None:
            return
        raise LimitError(
            f"{m.name} was too near to {entry.master:g} {unit} for {self._slave.name} to synchronise",
            observed=f"it was {left:.6g} {unit} away, master_start_distance = {entry.over:g}",
            remedy=f"start {m.name} farther away, or give a shorter distance (master_start_distance = ...)",
        )

    def _lost(self, error: AxisbusError, then: str = "the axis was braked") -> AxisbusError:
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


class SyncInCurve:
    """A polynomial of degree five over the master's positions ``begin`` to ``end``; slope and ``bend`` do not jump at its ends."""

    __slots__ = ("_begin", "_factors", "_length", "_slope")

    def __init__(self, begin: float, end: float, start: SlaveReference, goal: SlaveReference) -> None:
        """``begin`` and ``end`` must differ; ``end`` is the lower one if the master moves backwards."""
        length = end - begin
        a, b, c = start.place, start.slope * length, 0.5 * start.bend * length**2
        place = goal.place - a - b - c
        slope = goal.slope * length - b - 2.0 * c
        bend = goal.bend * length**2 - 2.0 * c
        d = 10.0 * place - 4.0 * slope + 0.5 * bend
        e = -15.0 * place + 7.0 * slope - bend
        f = 6.0 * place - 3.0 * slope + 0.5 * bend
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
