"""Position and velocity of a coupling's master, without jumps: commanded values if the master controls it, else reported ones.

Theory of operation
-------------------
If this program controls the axis, its position is known exactly: the path of a trajectory, the last target in csp, a virtual axis.
Values reported by a drive (``MasterEstimator``) are whole increments and come at their own times. They are therefore filtered, and
extrapolated to the time at which a target takes effect.

The source of the position changes from command to command, and the sources differ by a following error or by one cycle. A drive
that controls its own motion continues during cycles that the computer misses; its slave gets no targets meanwhile and lags. Both
deviations are removed gradually (``LagCorrection``): the slave never jumps, and is synchronised again within a second or two.
"""

from __future__ import annotations

import math
from collections import deque

from axisbus.cia402.port import ValueTransport
from axisbus.errors import AxisbusError, NodeError, StateError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.coupling.definition import By
from axisbus.motion.states import AxisState

_PATH, _TARGET, _TOLD = "path", "target", "told"
_UNKNOWN = frozenset({AxisState.ERRORSTOP, AxisState.HOMING})


class Master:
    """Follows one axis; ``place`` (in its unit) and ``velocity`` (per s) are those of the last step."""

    def __init__(self, core: AxisCore, by: By, period: float) -> None:
        """``period``: scan period in seconds."""
        self.core = core
        self.place = 0.0
        self.velocity = 0.0
        self._by = by
        self._period = period
        self._origin = core.image.origin  # fixed, so that a change of the origin does not move a slave
        self._kind: str | None = None
        self._target: int | None = None  # the last one, in increments
        self._debt = LagCorrection(period)
        self._told = MasterEstimator(core, by, period)

    @property
    def name(self) -> str:
        """The name of the axis."""
        return self.core.parameters.name

    def step(self) -> None:
        """Update position and velocity from the last cycle's commanded or reported values; once per cycle, before the axes.

        Raises:
            AxisbusError: the axis is lost, homing or in ErrorStop, so its position is unknown.
        """
        core, image = self.core, self.core.image
        if core.state in _UNKNOWN or image.position is None or not image.operational:
            raise self._lost()
        before, self._target = self._target, self._leads_to()
        path = core.leading_path
        if self._by is not By.COMMAND or (path is None and self._target is None):
            self._take_told()
        elif path is not None:
            place = path.last_step.position + self._moved
            self._take_led(_PATH, place, path.last_step.velocity * self._period)
        else:
            assert self._target is not None
            place = self._counted(self._target)
            self._take_led(_TARGET, place, 0.0 if before is None else place - self._counted(before))

    def _lost(self) -> AxisbusError:
        core = self.core
        if core.state is AxisState.ERRORSTOP:
            observed = "" if core.error is None else core.error.message
            return StateError(f"{self.name} is in ErrorStop", observed=observed)
        if core.state is AxisState.HOMING:
            return StateError(f"{self.name} is being homed, and will count from the new home")
        return NodeError(f"the position of {self.name} is unknown", node=core.parameters.node)

    def _leads_to(self) -> int | None:
        """Return the last target in increments; None if the drive controls its own motion, or the axis is not controlled."""
        core = self.core
        if core.parameters.encoder:
            return None
        return core.image.position if core.parameters.virtual else core.image.led.target

    @property
    def _moved(self) -> float:
        """The distance by which the axis's origin has moved since the start, in its unit."""
        origin = self.core.image.origin
        return (
            0.0
            if origin == self._origin
            else self.core.parameters.units.position.to_units(origin - self._origin)
        )

    def _counted(self, increment: int) -> float:
        return self.core.parameters.units.position.to_units(increment - self._origin)

    def _take_led(self, kind: str, place: float, went: float) -> None:
        """Use a commanded position; ``went``: distance commanded in the last cycle."""
        before, self._kind = self._kind, kind
        if before is None:
            self.place, self.velocity = place, went / self._period
            return
        if kind is not before:
            self._debt.add(self.place - (place - went) - self._debt.value, self.velocity)
        self._go_to(place)

    def _take_told(self) -> None:
        told, before = self._told, self._kind
        self._kind = _TOLD
        if before is None:
            told.begin(self._origin)
            told.step(self._origin)
            self.place, self.velocity = told.due, told.velocity
            return
        if before is not _TOLD:
            told.go_on_from(self.place - self._debt.value, self.velocity - self._debt.rate)
        self._debt.add(-told.step(self._origin), self.velocity)
        self._go_to(told.due)

    def _go_to(self, due: float) -> None:
        before, self.place = self.place, due + self._debt.step()
        self.velocity = (self.place - before) / self._period


# ----------------------------------------------------------------------------------------------------------------------
# Estimate the position of a coupling's master from the values that its drive reports, and remove a slave's lag gradually.
#
# Used if the drive controls the master's motion (pp, pv), or if the slave follows the actual position: the library then knows only
# sampled and quantised values of the master.
#
# Theory of operation
# Reported positions are whole increments, so their differences are too coarse a velocity for a slave. A filter of second order
# (``_SHARES``) has no lag at constant speed, and quantisation does not shake the slave. A value that answers a SYNC was sampled
# at that SYNC. The estimate extrapolates it, with the estimated velocity, to the time at which a target takes effect. That time
# lies on the grid of the scan, which a late cycle does not shift. So neither a late cycle nor a lost frame looks like a change of
# speed.
#
# If the demand value (6062h) becomes known while the master moves, it is not used before the master is at standstill. It is ahead
# of the actual position, and a slave that changed from one to the other would jump.
#
# On a busy bus, the drive sends the demand only at every n-th SYNC, but the position at every SYNC. An estimate from such a demand
# would not notice for several cycles that the master has begun to move, and its slave would then jump. Such a demand is not used.
#
# A position that comes only at every n-th cycle corrects the estimate by so much at once that a slave would jump. Then the master's
# course from the estimate before to the corrected one is a cubic over 2n cycles, so that its velocity does not jump.
#
# During skipped cycles the drive keeps moving. The distance that it covers without a target for the slave becomes a lag of the
# slave. A ``LagCorrection`` removes the lag like a critically damped spring: the slave's speed never jumps. The correction speed
# is at most a tenth of the master's, as long as that is enough to remove the lag within a few seconds.


_CYCLES = 4.0  # the time constant of the filter, in scan periods
_MOST_CYCLES = 32  # from one value to the next; rarer ones count as coming so often
# Of the residual, to correct position and velocity: by the cycles from one value to the next.
_SHARES = [
    (1.0 - theta**2, (1.0 - theta) ** 2)
    for theta in (math.exp(-n / _CYCLES) for n in range(_MOST_CYCLES + 1))
]
_LATE = 2.0  # cycles by which a reported value is older than a commanded one
_BEFORE = 0.125  # of a period: a drive may answer a SYNC before the scan has read its clock
_SOON, _AT_LEAST = 3.0, 0.5  # 1/s: highest and lowest natural frequency of the correction
_FASTER = 0.1  # of the master's speed: the highest correction speed


class LagCorrection:
    """Deviation of a position, gradually reduced to zero; ``value`` in units, ``rate`` its change in units/s."""

    def __init__(self, period: float) -> None:
        """``period``: scan period in seconds."""
        self.value = 0.0
        self.rate = 0.0
        self._period = period
        self._pull = _SOON

    def add(self, off: float, speed: float) -> None:
        """Increase the deviation by ``off`` units; the slower the master moves, the longer the correction takes."""
        if not off:
            return
        self.value += off
        pull = math.e * _FASTER * abs(speed / self.value) if speed and self.value else _SOON
        self._pull = min(max(pull, _AT_LEAST), _SOON)

    def step(self) -> float:
        """Advance by one cycle and return the remaining deviation in units."""
        if self.value == 0.0 == self.rate:
            return 0.0
        pull = self._pull
        self.rate -= (2.0 * pull * self.rate + pull * pull * self.value) * self._period
        self.value += self.rate * self._period
        return self.value


class _Transition:
    """A cubic from one place and velocity to others; times in seconds."""

    def __init__(
        self, begin: float, end: float, place: float, velocity: float, goal: float, goal_velocity: float
    ) -> None:
        self.end = end
        self._begin, self._place, self._velocity = begin, place, velocity
        seconds = end - begin
        way, faster = goal - place - velocity * seconds, (goal_velocity - velocity) * seconds
        self._square = (3.0 * way - faster) / seconds**2
        self._cube = (faster - 2.0 * way) / seconds**3

    def at(self, time: float) -> tuple[float, float]:
        """Return place and velocity at a time from begin to end."""
        t = time - self._begin
        place = self._place + t * (self._velocity + t * (self._square + t * self._cube))
        return place, self._velocity + t * (2.0 * self._square + 3.0 * t * self._cube)


class MasterEstimator:
    """Follows one master by the values that its drive reports; ``velocity`` in units/s."""

    def __init__(self, core: AxisCore, by: By, period: float) -> None:
        """``period``: scan period in seconds."""
        self.velocity = 0.0
        self._core = core
        self._by = by
        self._period = period
        self._place = 0.0
        self._at = -math.inf  # the time of ``_place``, possibly in the future
        self._due_at = -math.inf
        self._stamp = -math.inf
        self._by_demand = False  # 6062h instead of 6064h gives the master's position
        self._syncs: deque[float] = deque(maxlen=4)
        self._transition: _Transition | None = None

    @property
    def due(self) -> float:
        """The expected position of the master when a target of this cycle takes effect."""
        return self._expected(self._due_at)[0]

    def _expected(self, time: float) -> tuple[float, float]:
        """Return the expected position and velocity at a time (s)."""
        if self._transition is not None and time < self._transition.end:
            return self._transition.at(time)
        return self._place + self.velocity * (time - self._at), self.velocity

    def begin(self, origin: int) -> None:
        """Start with the values reported now; ``origin``: the increment that counts as 0."""
        core, image = self._core, self._core.image
        self._start()
        seen, self._stamp, source = self._seen()
        units = core.parameters.units
        self._place = units.position.to_units(seen - origin)
        if image.velocity is not None and units.ratio_known:
            self.velocity = units.velocity.to_units(image.velocity)
        self._at = self._sampled(self._stamp, source)

    def go_on_from(self, place: float, velocity: float) -> None:
        """Start with the master's position and velocity of the last cycle, as another source gave them."""
        self._start()
        self._place, self._at, self.velocity = place, self._due_at, velocity

    def step(self, origin: int) -> float:
        """Process the last cycle's values; return the distance that the drive covered in cycles skipped before it."""
        image, period = self._core.image, self._period
        self._syncs.append(image.now)
        self._due_at += period
        skipped = round((image.now + period - self._due_at) / period)
        self._due_at += skipped * period
        seen, stamp, source = self._seen()
        # A value expected by SYNC or by request that did not come is late or lost. An event-driven value that did not come is
        # unchanged.
        if stamp != self._stamp:
            before = self._due_at - period
            expected = self._expected(before)
            cycles = self._correct(seen - origin, self._sampled(stamp, source))
            self._transition = None
            if cycles > 1:
                end = before + 2 * cycles * period
                self._transition = _Transition(before, end, *expected, *self._expected(end))
        elif source is ValueTransport.EVENT_PDO:
            self._correct(seen - origin, image.now - (_LATE - 1.0) * period)
        self._stamp = stamp
        return self.velocity * skipped * period

    def _start(self) -> None:
        now = self._core.image.now
        self._by_demand = self._core.image.demand is not None and self._comes_often
        self._due_at = now
        self._transition = None
        self._syncs.clear()
        self._syncs.append(now - self._period)

    def _seen(self) -> tuple[int, float, ValueTransport | None]:
        """Return the reported position in increments, its time stamp, and its transport."""
        core, image = self._core, self._core.image
        inputs = core.capabilities.inputs
        demand = image.demand if self._by is By.COMMAND else None
        self._by_demand = demand is not None and (self._by_demand or (image.standstill and self._comes_often))
        if demand is not None and self._by_demand:
            return demand, image.demand_stamp, inputs.get("demand")
        assert image.position is not None  # otherwise the node is lost
        return image.position, image.position_stamp, inputs.get("position")

    @property
    def _comes_often(self) -> bool:
        """Whether the demand comes as often as the position; if it is sent on change, it comes in each cycle of a motion."""
        core = self._core
        return (
            core.capabilities.inputs.get("demand") is ValueTransport.EVENT_PDO
            or not core.image.demand_is_rarer
        )

    def _sampled(self, stamp: float, source: ValueTransport | None) -> float:
        """Return the sampling time of a value that arrived at ``stamp``."""
        if source is not ValueTransport.SYNC_PDO:
            return stamp
        before = stamp + _BEFORE * self._period
        return max((sync for sync in self._syncs if sync <= before), default=stamp)

    def _correct(self, seen: int, at: float) -> int:
        """Extrapolate to time ``at``, and correct the estimate by the reported value; return the cycles since the value before."""
        passed = at - self._at
        cycles = min(max(round(passed / self._period), 1), _MOST_CYCLES)
        of_place, of_velocity = _SHARES[cycles]
        self._place += self.velocity * passed
        self._at = at
        off = self._core.parameters.units.position.to_units(seen) - self._place
        self._place += of_place * off
        self.velocity += of_velocity * off / max(passed, self._period)
        return cycles
