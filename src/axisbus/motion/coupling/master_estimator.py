"""Where a master that its drive leads will be, by what that tells; and how what a slave is behind is taken back.

Theory of operation
-------------------
What comes in whole increments has differences that are no velocity for a slave. So it goes through a filter of second order
(``_SHARES``): nothing is late at constant speed, and what is rounded away does not shake the slave. What answers a SYNC was sampled
at it: as far as the velocity is known, it is carried on from there to when a target would take effect. That is the grid of the
scan, which a cycle that comes late does not move; so neither it nor a lost frame is seen as a change of speed.

A demand (6062h) that becomes known in motion is not taken before the master is at standstill: it is ahead of the position, and a
slave that changed from one to the other would be jolted.

Over cycles that were skipped the drive goes on, and what it made without a target of the slave is a debt of that. A
``LagCorrection`` is taken back as a spring with critical damping draws in: its speed never jumps, and is a tenth of the master's,
as far as that is enough for a few seconds.
"""

from __future__ import annotations

import math
from collections import deque

from axisbus.cia402.port import ValueTransport
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.coupling.sync_options import By

_CYCLES = 4.0  # the time constant of the filter
_THETA = math.exp(-1.0 / _CYCLES)
_SHARES = 1.0 - _THETA**2, (1.0 - _THETA) ** 2  # of what is off, that place and velocity are corrected by
_LATE = 2.0  # cycles that what is told is older than what is led
_BEFORE = 0.125  # of a period: a drive may answer a SYNC before the scan has looked at its clock
_SOON, _AT_LEAST = 3.0, 0.5  # 1/s, of a debt that is taken back
_FASTER = 0.1  # of the master's speed, at most, by which one is


class LagCorrection:
    """What a place is off from where it is due, on its way to nothing; ``value`` in units, ``rate`` per second."""

    def __init__(self, period: float) -> None:
        """``period``: of the scan, in seconds."""
        self.value = 0.0
        self.rate = 0.0
        self._period = period
        self._pull = _SOON

    def add(self, off: float, speed: float) -> None:
        """Be ``off`` more from now on; the slower the master, the longer that is taken back."""
        if not off:
            return
        self.value += off
        pull = math.e * _FASTER * abs(speed / self.value) if speed and self.value else _SOON
        self._pull = min(max(pull, _AT_LEAST), _SOON)

    def step(self) -> float:
        """Return what is left a cycle later."""
        if self.value == 0.0 == self.rate:
            return 0.0
        pull = self._pull
        self.rate -= (2.0 * pull * self.rate + pull * pull * self.value) * self._period
        self.value += self.rate * self._period
        return self.value


class MasterEstimator:
    """Follows one master by what its drive tells; ``velocity`` in units per second."""

    def __init__(self, core: AxisCore, by: By, period: float) -> None:
        """``period``: of the scan, in seconds."""
        self.velocity = 0.0
        self._core = core
        self._by = by
        self._period = period
        self._place = 0.0
        self._at = -math.inf  # when it was, or will have been, there
        self._due_at = -math.inf
        self._stamp = -math.inf
        self._by_demand = False  # 6062h, not 6064h, tells where the master is
        self._syncs: deque[float] = deque(maxlen=4)

    @property
    def due(self) -> float:
        """Where the master will be when a target of this cycle takes effect."""
        return self._place + self.velocity * (self._due_at - self._at)

    def begin(self, origin: int) -> None:
        """Begin with what is told now; ``origin`` is the increment that counts as 0."""
        core, image = self._core, self._core.image
        self._start()
        seen, self._stamp, source = self._seen()
        units = core.parameters.units
        self._place = units.position.to_units(seen - origin)
        if image.velocity is not None and units.ratio_known:
            self.velocity = units.velocity.to_units(image.velocity)
        self._at = self._sampled(self._stamp, source)

    def go_on_from(self, place: float, velocity: float) -> None:
        """Begin with where something else had the master in the last cycle."""
        self._start()
        self._place, self._at, self.velocity = place, self._due_at, velocity

    def step(self, origin: int) -> float:
        """Take what came in the last cycle, and return the way of the drive through cycles that were skipped before it."""
        image, period = self._core.image, self._period
        self._syncs.append(image.now)
        self._due_at += period
        skipped = round((image.now + period - self._due_at) / period)
        self._due_at += skipped * period
        seen, stamp, source = self._seen()
        # What comes with each SYNC, or is asked for, and did not come is late or lost; what comes by itself has not changed.
        if stamp != self._stamp:
            self._correct(seen - origin, self._sampled(stamp, source))
        elif source is ValueTransport.EVENT_PDO:
            self._correct(seen - origin, image.now - (_LATE - 1.0) * period)
        self._stamp = stamp
        return self.velocity * skipped * period

    def _start(self) -> None:
        now = self._core.image.now
        self._by_demand = self._core.image.demand is not None
        self._due_at = now
        self._syncs.clear()
        self._syncs.append(now - self._period)

    def _seen(self) -> tuple[int, float, ValueTransport | None]:
        """Return what the drive tells in increments, its stamp, and how it comes."""
        core, image = self._core, self._core.image
        inputs = core.capabilities.inputs
        demand = image.demand if self._by is By.COMMAND else None
        self._by_demand = demand is not None and (self._by_demand or image.standstill)
        if demand is not None and self._by_demand:
            return demand, image.demand_stamp, inputs.get("demand")
        assert image.position is not None  # else it is lost
        return image.position, image.position_stamp, inputs.get("position")

    def _sampled(self, stamp: float, source: ValueTransport | None) -> float:
        """Return when what came at ``stamp`` was so."""
        if source is not ValueTransport.SYNC_PDO:
            return stamp
        before = stamp + _BEFORE * self._period
        return max((sync for sync in self._syncs if sync <= before), default=stamp)

    def _correct(self, seen: int, at: float) -> None:
        """Go on to ``at`` as before, and correct that by what was seen."""
        passed = at - self._at
        self._place += self.velocity * passed
        self._at = at
        off = self._core.parameters.units.position.to_units(seen) - self._place
        self._place += _SHARES[0] * off
        self.velocity += _SHARES[1] * off / max(passed, self._period)
