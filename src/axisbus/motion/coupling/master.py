"""Where the master of a slave is, and how fast, without a jump: by what leads it where that is ours, else by what its drive tells.

Theory of operation
-------------------
What this program itself leads is known to any fraction: the path of a trajectory, or the last target in csp. What a drive tells
comes in whole increments; differences of that are no velocity that a slave could follow. So it goes through a filter of second
order (``_SHARES``): nothing is late at constant speed, and what is rounded away does not shake the slave. It was sampled at a SYNC
before, too: as far as the velocity is known, it is carried on to where a target would be (``_LATE``).

What leads the master changes from command to command, and the kinds differ by a following error or a cycle. What they differ by
when one takes over from another is taken back little by little (``_KEPT``).
"""

from __future__ import annotations

import math

from axisbus.cia402.port import Source
from axisbus.errors import AxisbusError, NodeError, StateError
from axisbus.motion.axis.core import AxisCore
from axisbus.motion.coupling.entries import By
from axisbus.motion.states import AxisState

_KEPT = 0.98  # of what two kinds differ by, per cycle
_CYCLES = 4.0  # the time constant of the filter
_THETA = math.exp(-1.0 / _CYCLES)
_SHARES = 1.0 - _THETA**2, (1.0 - _THETA) ** 2  # of what is off, that place and velocity are corrected by
_LATE = 2.0  # cycles that what is told is older than what is led
_PATH, _TARGET, _TOLD = "path", "target", "told"


class Master:
    """Follows one axis; ``place`` (its unit) and ``velocity`` (per s) are those of the last step."""

    def __init__(self, core: AxisCore, by: By, period: float) -> None:
        """``period``: of the scan, in seconds."""
        self.core = core
        self.place = 0.0
        self.velocity = 0.0
        self._by = by
        self._period = period
        self._origin = core.image.origin  # what is counted anew meanwhile moves no slave
        self._kind: str | None = None
        self._off = 0.0
        self._filtered = 0.0
        self._stamp = -math.inf

    @property
    def name(self) -> str:
        """The axis."""
        return self.core.parameters.name

    def step(self) -> None:
        """Once per cycle, before the axes: see where it was led to, or is, in the cycle before.

        Raises:
            AxisbusError: it is lost: nobody knows where it will be.
        """
        lost = self._lost()
        if lost is not None:
            raise lost
        led = self._led() if self._by is By.COMMAND else None
        if led is None:
            self._take_told()
        else:
            self._take_led(*led)

    def _lost(self) -> AxisbusError | None:
        core, image = self.core, self.core.image
        if core.state is AxisState.ERRORSTOP:
            observed = "" if core.error is None else core.error.message
            return StateError(f"{self.name} is in ErrorStop", observed=observed)
        if core.state is AxisState.HOMING:
            return StateError(f"{self.name} is being homed, and counts anew")
        if image.position is None or not image.operational:
            return NodeError(f"nobody knows where {self.name} is", node=core.parameters.node)
        return None

    def _led(self) -> tuple[str, float] | None:
        """Return by what kind of value it is led exactly, and where to; None where its drive leads itself."""
        path, core = self.core.leading_path, self.core
        units, counted = core.parameters.units.position, core.image.origin - self._origin
        if path is not None:
            return _PATH, path.last_step.position + units.to_units(counted)
        target = core.image.led.target
        return None if target is None else (_TARGET, units.to_units(target - self._origin))

    def _take_led(self, kind: str, led: float) -> None:
        path = self.core.leading_path
        if self._kind is None:
            self.place, self.velocity = led, 0.0 if path is None else path.last_step.velocity
            self._kind = kind
            return
        if kind != self._kind:
            self._kind, self._off = kind, self.place - led
        self._off *= _KEPT
        before, self.place = self.place, led + self._off
        self.velocity = (self.place - before) / self._period

    def _take_told(self) -> None:
        image, units = self.core.image, self.core.parameters.units
        demand = image.demand if self._by is By.COMMAND else None
        if demand is None:
            told, stamp, source = image.position, image.position_stamp, "position"
        else:
            told, stamp, source = demand, image.demand_stamp, "demand"
        assert told is not None  # else it is lost
        seen = units.position.to_units(told - self._origin)
        if self._kind is None:
            self._filtered = seen
            if image.velocity is not None and units.ratio_known:
                self.velocity = units.velocity.to_units(image.velocity)
        elif self._kind is not _TOLD:
            self._filtered = self.place - self.velocity * _LATE * self._period
        self._kind = _TOLD
        # What comes with each SYNC and did not come is a frame that was lost; what comes by itself has not changed.
        by_sync = self.core.capabilities.inputs.get(source) is Source.SYNC_PDO
        self._filter(seen, is_new=stamp != self._stamp or not by_sync)
        self._stamp = stamp
        self.place = self._filtered + self.velocity * _LATE * self._period

    def _filter(self, seen: float, *, is_new: bool) -> None:
        """Go on as before, and correct that by what was seen."""
        self._filtered += self.velocity * self._period
        if is_new:
            off = seen - self._filtered
            self._filtered += _SHARES[0] * off
            self.velocity += _SHARES[1] * off / self._period
