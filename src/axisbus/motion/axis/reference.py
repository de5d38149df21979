"""The set-points of an axis: the targets that were sent, and the drive's own demand (6062h) as far as it can be trusted.

Theory of operation
-------------------
6062h is the set-point of the drive's position controller, and so shows what pulls an axis at standstill. Some drives use 6062h for
something else: ``DemandTrust`` decides whether it counts. In modes without a position controller some drives update 6062h, others
leave it unchanged. In these modes it counts once it has moved.

The demand is compared with the position at its own sample time (``AxisImage.lead``). Samples from before the present mode, power or
count are not compared at all (``since``). In a cyclic position mode the last target counts as well, whatever the value of 6062h.

In *quick stop active* a drive ignores 607Ah: it brakes from the last target with the velocity of that target, and holds the
position at which it stops. So the last target is no pull if the axis has passed it by about the braking distance, or by any
distance if 6062h is trusted. If the axis has not passed it, something may hold the axis, and the target still counts, even if 6062h
is stuck as well.
"""

from __future__ import annotations

import math

from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.motion.axis.demand import DemandTrust
from axisbus.motion.modes import WITHOUT_POSITION_DEMAND
from axisbus.motion.parameters import DemandUse

_M = ModeOfOperation
_CSP, _HOMING, _PP = int(_M.CYCLIC_SYNC_POSITION), int(_M.HOMING), int(_M.PROFILE_POSITION)
_MOVED = 20  # increments: more than the noise of a constant value
_BRAKES = 1.25  # factor by which a braking distance may differ from the ramp's; a larger difference counts as a pull
# Cycles: a target is taken with the next SYNC and reached with the SYNC after it; the quick stop may be earlier.
_ON_ITS_WAY = 2.0


class ReferenceTracker:
    """Holds the last outputs, and the results about 6062h; positions are unwrapped increments.

    ``target`` is the target of csp (None: there was none in this mode). ``set_point`` is the set-point of pp, given at
    ``set_point_at``; ``taken`` is that set-point once the axis was seen to move to it (only ``SetPointConfirmation`` checks this).
    ``searching_since``: when the running homing began (infinite: none runs). ``since``: a demand received at or before this moment
    is outdated. ``trust``: whether 6062h counts. ``rate`` is the last step of the target, in increments per cycle. ``idle``: in pp,
    no set-point was given since the drive was seen without power or in another mode.
    """

    __slots__ = (
        "_before",
        "_mode",
        "_quick",
        "idle",
        "rate",
        "searching_since",
        "set_point",
        "set_point_at",
        "since",
        "taken",
        "target",
        "trust",
    )

    def __init__(
        self, use: DemandUse = DemandUse.AUTO, window: float = math.inf, quick: float | None = None
    ) -> None:
        """``window``: see ``DemandTrust``; ``quick``: deceleration of a quick stop in increments per cycle² (None: not known)."""
        self._quick = quick
        self.idle = False
        self.trust = DemandTrust(use, window)
        self.since = -math.inf
        self._mode: int | None = None
        self.forget(-math.inf)

    def drop_set_point(self) -> None:
        """Discard the set-point and the search of a homing: they no longer move the axis."""
        self.set_point: int | None = None
        self.set_point_at = -math.inf
        self.taken: int | None = None
        self.searching_since = math.inf

    def forget(self, now: float) -> None:
        """Discard all outputs, and the present demand: none of them moves the axis any more."""
        self.drop_set_point()
        self.target: int | None = None
        self.rate = 0
        self._before: int | None = None  # 6062h when the drive changed to its mode
        self.begin(now)

    def begin(self, now: float) -> None:
        """Compare no demand that was received until ``now``."""
        self.since = now
        self.trust.begin()

    def recount(self, now: float) -> None:
        """Start again: the drive's count has another origin now."""
        self.forget(now)
        self.trust.recount()

    def note(
        self, now: float, mode: int | None, demand: int | None, target: int | None, is_edge: bool
    ) -> None:
        """Record this cycle's outputs: a target (None: none), and whether bit 4 (new set-point, homing start) is set with it."""
        if mode is None:
            return  # unknown now, but not changed
        if mode != self._mode:
            if self._mode == _PP:
                self.set_point, self.set_point_at = None, -math.inf  # the drive has left pp
            self.idle = self.idle or self._mode is not None
            self._mode, self._before, self.taken = mode, demand, None
            self.begin(now)
        if mode != _CSP:
            self.target = None
        elif target is not None:
            self.rate = 0 if self.target is None else target - self.target
            self.target = target
        if mode != _HOMING or not is_edge:
            self.searching_since = math.inf
        elif self.searching_since == math.inf:
            self.searching_since = now
        if is_edge and mode == _PP:
            self.idle = False
        if is_edge and mode == _PP and target is not None and target != self.set_point:
            self.set_point, self.set_point_at = target, now
            self.trust.gives(target)

    def hold_back(self, now: float) -> None:
        """Note that an override of 0 keeps the axis at standstill until ``now``: the time of its set-point starts then."""
        if self.set_point is not None:
            self.set_point_at = now

    def leads_on(self, mode: int | None) -> bool:
        """Whether a ``note`` in the present ``mode`` would change nothing but a csp target."""
        return mode == _CSP and mode == self._mode and self.searching_since == math.inf

    def counts(self, demand: int | None, mode: int | None) -> bool:
        """Whether ``demand``, if it is trusted, is the motor's set-point in this mode."""
        if demand is None:
            return False
        return mode not in WITHOUT_POSITION_DEMAND or self._lives(demand, mode)

    def may_count(self, demand: int, mode: int | None) -> bool:
        """Whether a trusted ``demand`` may be the set-point in this mode; True if its value at the mode change is unknown."""
        return self._before is None or self.counts(demand, mode)

    def pull(self, lead: float | None, position: int | None, state: PowerState) -> float | None:
        """Return the distance to which the axis is pulled from its position; None if it is unknown, or nothing pulls.

        ``lead``: the distance of the demand ahead of the axis when it was sampled; None if the demand does not count.
        """
        if position is None or state not in ENERGISED:
            return None  # nothing pulls without power
        target = self.target
        if target is None or (
            state is PowerState.QUICK_STOP_ACTIVE and self._has_braked(target, lead, position)
        ):
            return lead
        if lead is None or abs(target - position) > abs(lead):
            return target - position
        return lead

    def _has_braked(self, target: int, lead: float | None, position: int) -> bool:
        """Whether the axis has passed its last target by the braking distance of a quick stop (see the module)."""
        past = (position - target) * self.rate / (abs(self.rate) or 1)
        if lead is not None:
            return past > 0.0
        if past <= 0.0 or not self._quick:
            return False
        way, late = 0.5 * self.rate * self.rate / self._quick, _ON_ITS_WAY * abs(self.rate)
        return way / _BRAKES - late <= past <= way * _BRAKES + late

    def _lives(self, demand: int, mode: int | None) -> bool:
        """Whether 6062h has moved since the drive changed to its present mode."""
        if mode != self._mode:
            return False
        if self._before is None:
            self._before = demand
        return abs(demand - self._before) > _MOVED
