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
is stuck as well. If the ramp of the quick stop is unknown, the braking distance follows from the last velocity and the time until
the axis was at rest: an axis that falls, or meets an obstacle, goes another distance in its time.
"""

from __future__ import annotations

import math
from collections import deque

from axisbus.cia402.controlword import PowerCommand
from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.port import Outputs
from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.motion.modes import TORQUE_MODES, WITHOUT_POSITION_DEMAND
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
    ``homing_since``: when the running homing began (infinite: none runs). ``since``: a demand received at or before this moment
    is outdated. ``trust``: whether 6062h counts. ``rate`` is the last step of the target, in increments per cycle. ``idle``: in pp,
    no set-point was given since the drive was seen without power or in another mode.
    """

    __slots__ = (
        "_before",
        "_mode",
        "_period",
        "_quick",
        "_targets_ended_at",
        "homing_since",
        "idle",
        "rate",
        "set_point",
        "set_point_at",
        "since",
        "taken",
        "target",
        "trust",
    )

    def __init__(
        self,
        use: DemandUse = DemandUse.AUTO,
        window: float = math.inf,
        quick: float | None = None,
        period: float = 1.0,
    ) -> None:
        """``window``: see ``DemandTrust``; ``quick``: deceleration of a quick stop in increments per cycle² (None: not known).

        ``period``: seconds of a cycle.
        """
        self._quick = quick
        self._period = period
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
        self.homing_since = math.inf

    def forget(self, now: float) -> None:
        """Discard all outputs, and the present demand: none of them moves the axis any more."""
        self.drop_set_point()
        self.target: int | None = None
        self.rate = 0
        self._targets_ended_at: float | None = None  # when the targets of csp ended; None: they go on
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
            self.target, self._targets_ended_at = target, None
        elif self._targets_ended_at is None:
            self._targets_ended_at = now
        if mode != _HOMING or not is_edge:
            self.homing_since = math.inf
        elif self.homing_since == math.inf:
            self.homing_since = now
        if is_edge and mode == _PP:
            self.idle = False
        if is_edge and mode == _PP and target is not None and target != self.set_point:
            self.set_point, self.set_point_at = target, now
            self.trust.add_set_point(target)

    def postpone_set_point(self, now: float) -> None:
        """Note that an override of 0, or a halt, holds the axis until ``now``: the time of its set-point starts then."""
        if self.set_point is not None:
            self.set_point_at = now

    def only_target_would_change(self, mode: int | None) -> bool:
        """Whether a ``note`` in the present ``mode`` would change nothing but a csp target."""
        return mode == _CSP and mode == self._mode and self.homing_since == math.inf

    def counts(self, demand: int | None, mode: int | None) -> bool:
        """Whether ``demand``, if it is trusted, is the motor's set-point in this mode."""
        if demand is None:
            return False
        return mode not in WITHOUT_POSITION_DEMAND or self._has_moved(demand, mode)

    def may_count(self, demand: int, mode: int | None) -> bool:
        """Whether a trusted ``demand`` may be the set-point in this mode; True if its value at the mode change is unknown."""
        return self._before is None or self.counts(demand, mode)

    def pull(
        self, lead: float | None, position: int | None, state: PowerState, rests: float = math.inf
    ) -> float | None:
        """Return the distance to which the axis is pulled from its position; None if it is unknown, or nothing pulls.

        ``lead``: the distance of the demand ahead of the axis when it was sampled; None if the demand does not count. ``rests``:
        when the axis came to rest, in seconds of the scan's clock (infinite: it moves, or this is unknown).
        """
        if position is None or state not in ENERGISED:
            return None  # nothing pulls without power
        target = self.target
        if target is None or (
            state is PowerState.QUICK_STOP_ACTIVE and self._has_braked(target, lead, position, rests)
        ):
            return lead
        if lead is None or abs(target - position) > abs(lead):
            return target - position
        return lead

    def _has_braked(self, target: int, lead: float | None, position: int, rests: float) -> bool:
        """Whether the axis has passed its last target by the braking distance of a quick stop (see the module)."""
        past = (position - target) * self.rate / (abs(self.rate) or 1)
        if lead is not None:
            return past > 0.0
        distance, late = self._braking_distance(rests), _ON_ITS_WAY * abs(self.rate)
        return (
            past > 0.0
            and distance is not None
            and distance / _BRAKES - late <= past <= distance * _BRAKES + late
        )

    def _braking_distance(self, rests: float) -> float | None:
        """Return the distance of a quick stop from the last target, by its ramp, else by its time; None if it is unknown."""
        if self._quick:
            return 0.5 * self.rate * self.rate / self._quick
        if self._targets_ended_at is None or not self._targets_ended_at < rests < math.inf:
            return None
        return 0.5 * abs(self.rate) * (rests - self._targets_ended_at) / self._period

    def _has_moved(self, demand: int, mode: int | None) -> bool:
        """Whether 6062h has moved since the drive changed to its present mode."""
        if mode != self._mode:
            return False
        if self._before is None:
            self._before = demand
        return abs(demand - self._before) > _MOVED


# ----------------------------------------------------------------------------------------------------------------------
# Decide from its behaviour whether 6062h (position demand value) is the set-point of the drive's position controller.
#
# Theory of operation
# A drive may have 6062h in its dictionary without this meaning: 6062h stays 0, it jumps to the target of a move at once, or it is a
# copy of 6064h. So a demand is trusted only after it has been seen to be ahead of the axis and to be the drive's own:
#
# - it was at the axis's position (within ``standstill_window``), and then went ahead of the axis in ``_SAMPLES`` consecutive
#   samples,
# - in each of them it had moved, and was ahead of the axis's position at the moment of the sample (a copy of 6064h is never ahead,
#   and a demand that stays 0 never moves),
# - in pp it was none of the given set-points (a demand that equals the target jumps from one set-point to the next).
#
# A jammed axis proves its demand within these samples, because the demand runs away from it; so does any axis that lags a little. A
# proof in pp is valid in every mode, because in pp the drive generates the demand itself. A proof in another mode is valid in that
# mode only, because in csp a demand that is only the target moves as well.


_DEMAND_PP = int(ModeOfOperation.PROFILE_POSITION)
# In homing the drive changes the origin of its positions; under torque there is no commanded position.
_PROVES_NOTHING = frozenset({int(ModeOfOperation.HOMING), *map(int, TORQUE_MODES)})
_SAMPLES = 3
OWN = 4.0  # increments: two values that are closer are the same; an encoder may have a noise of half of it
_SET_POINTS = 8  # that are remembered: a demand that arrives by SDO may still be an earlier set-point


class DemandTrust:
    """Judges the demand of one drive; holds the modes in which it is proven, and the recent observations."""

    __slots__ = ("_anchored", "_before", "_given", "_seen", "_use", "_window", "everywhere", "proven")

    def __init__(self, use: DemandUse, window: float) -> None:
        """``window``: increments between demand and position within which nothing pulls an axis at standstill."""
        self._use = use
        self._window = window
        self.everywhere = use is not DemandUse.AUTO  # no judgement is needed (any more)
        self.proven: set[int | None] = set()
        self._given: deque[int] = deque(maxlen=_SET_POINTS)
        self.begin()

    def trusts(self, mode: int | None) -> bool:
        """Whether the demand counts in this mode."""
        return self._use is not DemandUse.IGNORE and (self.everywhere or mode in self.proven)

    def begin(self) -> None:
        """Start the observation again with the next sample: the drive's count, or its control of the motor, has changed."""
        self._before: int | None = None
        self._anchored = False
        self._seen = 0

    def recount(self) -> None:
        """Start again: the drive's count has another origin now."""
        self._given.clear()
        self.begin()

    def add_set_point(self, set_point: int) -> None:
        """Record a set-point given to the drive (unwrapped increments)."""
        self._given.append(set_point)

    def look(self, demand: int, lead: float, doubt: float, mode: int | None) -> None:
        """Evaluate a new sample of a drive in *operation enabled* whose demand is not trusted yet.

        ``lead``: the distance of the demand ahead of the axis when it was sampled; ``doubt``: the possible error of this distance.
        """
        before, self._before = self._before, demand
        if mode is None or mode in _PROVES_NOTHING:
            return
        ahead = before is not None and abs(lead) > OWN + doubt and (demand - before) * lead > 0
        own = ahead and not (mode == _DEMAND_PP and any(abs(demand - each) <= OWN for each in self._given))
        self._seen = self._seen + 1 if own and self._anchored else 0
        self._anchored = abs(lead) <= self._window or (self._anchored and own)
        if self._seen >= _SAMPLES:
            self.proven.add(mode)
            self.everywhere = mode == _DEMAND_PP


# -- Outputs sent so recently that the drive's inputs may not answer them yet ------------------------------------------


# Scan periods: to the SYNC that makes the output effective, to the SYNC that samples the answer, and to the cycle that reads it;
# less half a period, because times do not add up exactly.
_ANSWERED = 2.5
_ENABLE = PowerCommand.ENABLE_OPERATION.word
_MODE_TAKEN = 3.5  # a drive evaluates 6060h in a slower task


class PendingOutputs:
    """Holds the last controlword (``word``) and mode that were sent, and their times in seconds of the scan's clock."""

    __slots__ = ("_enabled_until", "_mode", "_mode_since", "_period", "_word_since", "word")

    def __init__(self, period: float) -> None:
        """``period``: scan period in seconds."""
        self._period = period
        self.word: int | None = None
        self._mode: int | None = None
        self._word_since = self._mode_since = self._enabled_until = -math.inf

    def note(self, outputs: Outputs, now: float) -> None:
        """Record the outputs of this cycle; None leaves a value unchanged."""
        word, mode = outputs.controlword, outputs.mode
        if word is not None and word != self.word:
            if self._enables:
                self._enabled_until = now
            self.word, self._word_since = word, now
        if mode is not None and mode != self._mode:
            self._mode, self._mode_since = mode, now

    @property
    def _enables(self) -> bool:
        return self.word is not None and self.word & _ENABLE == _ENABLE

    def may_enable(self, now: float) -> bool:
        """Whether the last word is *enable operation*, or an earlier such word may still take effect before the last one does."""
        return self._enables or now < self._enabled_until + _ANSWERED * self._period

    def word_answered(self, now: float) -> bool:
        """Whether the state shown at ``now`` is the answer to the last controlword, and no earlier word can still take effect."""
        return now >= self._word_since + _ANSWERED * self._period

    def awaits_mode(self, shown: int | None, since: float) -> bool:
        """Whether a mode other than the one shown was requested at ``since`` or later."""
        return self._mode is not None and self._mode != shown and self._mode_since >= since

    def mode_answered(self, now: float) -> bool:
        """Whether the mode shown at ``now`` is the answer to the last requested mode."""
        return now >= self._mode_since + _MODE_TAKEN * self._period
