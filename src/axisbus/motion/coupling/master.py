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
from axisbus.motion.coupling.definition import MasterValue
from axisbus.motion.states import AxisState

_PATH, _TARGET, _REPORTED = "path", "target", "reported"
_UNKNOWN = frozenset({AxisState.ERRORSTOP, AxisState.HOMING})


class Master:
    """Follows one axis; ``position`` (in its unit) and ``velocity`` (per s) are those of the last step."""

    def __init__(self, core: AxisCore, master_value: MasterValue, period: float) -> None:
        """``period``: scan period in seconds."""
        self.core = core
        self.position = 0.0
        self.velocity = 0.0
        self._master_value = master_value
        self._period = period
        self._origin = core.image.origin  # fixed, so that a change of the origin does not move a slave
        self._kind: str | None = None
        self._target: int | None = None  # the last one, in increments
        self._lag = LagCorrection(period)
        self._estimator = MasterEstimator(core, master_value, period)

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
        before, self._target = self._target, self._last_target()
        path = core.active_path
        if self._master_value is not MasterValue.COMMAND or (path is None and self._target is None):
            self._use_reported()
        elif path is not None:
            position = path.last_step.position + self._moved
            self._use_commanded(_PATH, position, path.last_step.velocity * self._period)
        else:
            assert self._target is not None
            position = self._in_units(self._target)
            self._use_commanded(
                _TARGET, position, 0.0 if before is None else position - self._in_units(before)
            )

    def _lost(self) -> AxisbusError:
        core = self.core
        if core.state is AxisState.ERRORSTOP:
            observed = "" if core.error is None else core.error.message
            return StateError(f"{self.name} is in ErrorStop", observed=observed)
        if core.state is AxisState.HOMING:
            return StateError(f"{self.name} is being homed, and will count from the new home")
        return NodeError(f"the position of {self.name} is unknown", node=core.parameters.node)

    def _last_target(self) -> int | None:
        """Return the last target in increments; None if the drive controls its own motion, or the axis is not controlled."""
        core = self.core
        if core.parameters.encoder:
            return None
        return core.image.position if core.parameters.virtual else core.image.reference_tracker.target

    @property
    def _moved(self) -> float:
        """The distance by which the axis's origin has moved since the start, in its unit."""
        origin = self.core.image.origin
        return (
            0.0
            if origin == self._origin
            else self.core.parameters.units.position.to_units(origin - self._origin)
        )

    def _in_units(self, increment: int) -> float:
        return self.core.parameters.units.position.to_units(increment - self._origin)

    def _use_commanded(self, kind: str, position: float, distance: float) -> None:
        """Use a commanded position; ``distance``: distance commanded in the last cycle."""
        before, self._kind = self._kind, kind
        if before is None:
            self.position, self.velocity = position, distance / self._period
            return
        if kind is not before:
            self._lag.add(self.position - (position - distance) - self._lag.value, self.velocity)
        self._set_position(position)

    def _use_reported(self) -> None:
        estimator, before = self._estimator, self._kind
        self._kind = _REPORTED
        if before is None:
            estimator.begin(self._origin)
            estimator.step(self._origin)
            self.position, self.velocity = estimator.due, estimator.velocity
            return
        if before is not _REPORTED:
            estimator.continue_from(self.position - self._lag.value, self.velocity - self._lag.rate)
        self._lag.add(-estimator.step(self._origin), self.velocity)
        self._set_position(estimator.due)

    def _set_position(self, due: float) -> None:
        before, self.position = self.position, due + self._lag.step()
        self.velocity = (self.position - before) / self._period


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
# path from the estimate before to the corrected one is a cubic over 2n cycles, so that its velocity does not jump.
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
_REPORTED_DELAY_CYCLES = 2.0  # cycles by which a reported value is older than a commanded one
_CLOCK_MARGIN = 0.125  # of a period: a drive may answer a SYNC before the scan has read its clock
_MAX_FREQUENCY, _MIN_FREQUENCY = 3.0, 0.5  # 1/s: highest and lowest natural frequency of the correction
_CATCH_UP_MAX_SPEED_RATIO = 0.1  # of the master's speed: the highest correction speed


class LagCorrection:
    """Deviation of a position, gradually reduced to zero; ``value`` in units, ``rate`` its change in units/s."""

    def __init__(self, period: float) -> None:
        """``period``: scan period in seconds."""
        self.value = 0.0
        self.rate = 0.0
        self._period = period
        self._frequency = _MAX_FREQUENCY

    def add(self, off: float, speed: float) -> None:
        """Increase the deviation by ``off`` units; the slower the master moves, the longer the correction takes."""
        if not off:
            return
        self.value += off
        frequency = (
            math.e * _CATCH_UP_MAX_SPEED_RATIO * abs(speed / self.value)
            if speed and self.value
            else _MAX_FREQUENCY
        )
        self._frequency = min(max(frequency, _MIN_FREQUENCY), _MAX_FREQUENCY)

    def step(self) -> float:
        """Advance by one cycle and return the remaining deviation in units."""
        if self.value == 0.0 == self.rate:
            return 0.0
        frequency = self._frequency
        self.rate -= (2.0 * frequency * self.rate + frequency * frequency * self.value) * self._period
        self.value += self.rate * self._period
        return self.value


class _Transition:
    """A cubic from one position and velocity to others; times in seconds."""

    def __init__(
        self, begin: float, end: float, position: float, velocity: float, goal: float, goal_velocity: float
    ) -> None:
        self.end = end
        self._begin, self._position, self._velocity = begin, position, velocity
        seconds = end - begin
        distance, faster = goal - position - velocity * seconds, (goal_velocity - velocity) * seconds
        self._square = (3.0 * distance - faster) / seconds**2
        self._cube = (faster - 2.0 * distance) / seconds**3

    def at(self, time: float) -> tuple[float, float]:
        """Return position and velocity at a time from begin to end."""
        t = time - self._begin
        position = self._position + t * (self._velocity + t * (self._square + t * self._cube))
        return position, self._velocity + t * (2.0 * self._square + 3.0 * t * self._cube)


class MasterEstimator:
    """Follows one master by the values that its drive reports; ``velocity`` in units/s."""

    def __init__(self, core: AxisCore, master_value: MasterValue, period: float) -> None:
        """``period``: scan period in seconds."""
        self.velocity = 0.0
        self._core = core
        self._master_value = master_value
        self._period = period
        self._position = 0.0
        self._at = -math.inf  # the time of ``_position``, possibly in the future
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
        return self._position + self.velocity * (time - self._at), self.velocity

    def begin(self, origin: int) -> None:
        """Start with the values reported now; ``origin``: the increment that counts as 0."""
        core, image = self._core, self._core.image
        self._start()
        seen, self._stamp, source = self._seen()
        units = core.parameters.units
        self._position = units.position.to_units(seen - origin)
        if image.velocity is not None and units.ratio_known:
            self.velocity = units.velocity.to_units(image.velocity)
        self._at = self._sampled(self._stamp, source)

    def continue_from(self, position: float, velocity: float) -> None:
        """Start with the master's position and velocity of the last cycle, as another source gave them."""
        self._start()
        self._position, self._at, self.velocity = position, self._due_at, velocity

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
            self._correct(seen - origin, image.now - (_REPORTED_DELAY_CYCLES - 1.0) * period)
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
        demand = image.demand if self._master_value is MasterValue.COMMAND else None
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
        before = stamp + _CLOCK_MARGIN * self._period
        return max((sync for sync in self._syncs if sync <= before), default=stamp)

    def _correct(self, seen: int, at: float) -> int:
        """Extrapolate to time ``at``, and correct the estimate by the reported value; return the cycles since the value before."""
        passed = at - self._at
        cycles = min(max(round(passed / self._period), 1), _MOST_CYCLES)
        of_position, of_velocity = _SHARES[cycles]
        self._position += self.velocity * passed
        self._at = at
        off = self._core.parameters.units.position.to_units(seen) - self._position
        self._position += of_position * off
        self.velocity += of_velocity * off / max(passed, self._period)
        return cycles
