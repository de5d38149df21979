"""A slave led by its master: how it comes into step, and where it is due in each cycle.

Theory of operation
-------------------
A joint is stepped once per cycle before the axes, as a group's line is, and leaves the place that is due for its follower
(``Coupled``). What it goes by is where the master was led to in the cycle before: a slave is one cycle behind.

1. It stands (or goes on as it did) until it may begin: ``AtPlace`` waits until the master comes by.
2. It comes into step: by its acceleration up to the speed that is due (``SyncAtSpeed``), or on a ``SyncInCurve`` while its master
   goes on.
3. It is in step: where the law says, each cycle.

Nothing of it is told to the axis but places, so what is watched on every path holds on this one too: the limits, velocity and
acceleration from cycle to cycle, the following error.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from axisbus.errors import AxisbusError, LimitError, StateError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.coupling.gear_and_cam import SlaveReference
from axisbus.motion.coupling.master import Master
from axisbus.motion.coupling.phase import PhaseShift
from axisbus.motion.coupling.slave_axis import Coupled
from axisbus.motion.coupling.sync_in_curve import SyncInCurve
from axisbus.motion.coupling.sync_options import AtPlace, SyncAtSpeed, SyncInPlace
from axisbus.motion.group.commands import Couple
from axisbus.motion.moves.follow import Follow

_FADE = 0.5  # seconds in which what a slave is off is taken back


class Engagement:
    """One slave and its master; ``place`` is where the slave is due, ``failure`` why it can be led no more."""

    def __init__(
        self, command: Couple, master: AxisCore, slave: AxisCore, period: float, before: Follow | None
    ) -> None:
        """``before``: what leads the slave along a path now, if anything does; ``period`` of the scan in seconds."""
        self.in_step = False
        self.planned = False  # it leads the slave
        self.failure: AxisbusError | None = None
        self.refused = (
            False  # the failure is that the slave cannot come into step, and nothing of it has moved
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
        self._base = 0.0  # where the slave is when its law says 0
        self._fade: SyncInCurve | None = None  # what it is off, by its seconds in step
        self._since = 0.0
        self._passed: float | None = None  # where the master was in the cycle before
        self._lead: Callable[[], float] = self._wait

    # -- what a group's command asks of what leads its axes -----------------------------------------------------------

    def step(self, _period: float, _begins: bool, _name: str) -> None:
        """Once per cycle, before the axes; what goes wrong is told to the slave, which brakes then."""
        try:
            self.master.step()
            if self.planned:
                self._go_on()
        except AxisbusError as error:
            self.failure = self.failure or self._lost(error)

    @property
    def gives_up(self) -> AxisbusError | None:
        """Nothing: its slave breaks off by itself."""
        return None

    def leads(self) -> bool:
        """Whether the slave was led since this was asked last."""
        return self.follow.take_stepped()

    # -- the slave -----------------------------------------------------------------------------------------------------

    def require_start(self, place: float, velocity: float) -> None:
        """Raise AxisbusError where the slave, at ``place`` with ``velocity`` (unit/s), could not be led as the master is now.

        A master of its own looks: that of this joint begins with the slave.
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
        """Lead the slave, which is at ``place`` with ``velocity`` (unit/s), from the next cycle on."""
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
        """Change the speed by the acceleration; in step once it is the one that is due."""
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
        """Come into step while the master goes on to ``end``."""
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
        """Be in step from here: where the slave is must be where it is due, and as fast, within what it may do in a cycle."""
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
        """Return where the master will be when both are to be at their places, in the cycle in which it comes near; else None."""
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
        """Return the slave's place for the meeting; of an endless one, the turn that is nearest to where it comes by itself."""
        modulo = self._slave.units.modulo
        if modulo is None:
            return entry.slave
        slope = self._command.law.at(end).slope
        likely = self.place + 0.5 * slope * (end - self.master.place)
        return entry.slave + modulo * round((likely - entry.slave) / modulo)

    # -- what is wrong -------------------------------------------------------------------------------------------------

    def _require_near(self, off: float) -> None:
        units = self._slave.units.position
        allowed = abs(units.to_units(self._slave.place_window))
        if abs(off) <= allowed:
            return
        raise LimitError(
            f"{self._slave.name} does not stand where it is due for where {self.master.name} is",
            observed=f"it is {abs(off):.6g} {units.unit} off, of which {allowed:.6g} {units.unit} are allowed",
            remedy="move it there first, give master_start_distance (the distance of the master within which it gets there), "
            "or let it begin at its present position: relative = True",
        )

    def _require_far(self, entry: AtPlace, master: float) -> None:
        m = self.master
        left, unit = abs(entry.master - master), m.core.parameters.units.position.unit
        if left >= entry.over or m.core.parameters.units.modulo is not None:
            return
        raise LimitError(
            f"{m.name} was nearer to {entry.master:g} {unit} than {self._slave.name} needs to come into step",
            observed=f"it was {left:.6g} {unit} away, master_start_distance = {entry.over:g}",
            remedy=f"let {m.name} come from farther away, or give a shorter way (master_start_distance = ...)",
        )

    def _lost(self, error: AxisbusError, then: str = "the axis was braked") -> AxisbusError:
        slave, master = self._slave.name, self.master.name
        if isinstance(error, LimitError):
            return error
        return StateError(
            f"{slave}: its master is lost: {error.message}",
            observed=error.observed,
            remedy=f"see to {master} first, then couple {slave} to it anew; {then}",
        )
