"""Decide from its behaviour whether 6062h (position demand value) is the set-point of the drive's position controller.

Theory of operation
-------------------
A drive may have 6062h in its dictionary without this meaning: 6062h stays 0, it jumps to the target of a move at once, or it is a
copy of 6064h. So a demand is trusted only after it has been seen to be ahead of the axis and to be the drive's own:

- it was at the axis's position (within ``standstill_window``), and then went ahead of the axis in ``_SAMPLES`` consecutive samples,
- in each of them it had moved, and was ahead of the axis's position at the moment of the sample (a copy of 6064h is never ahead,
  and a demand that stays 0 never moves),
- in pp it was none of the given set-points (a demand that equals the target jumps from one set-point to the next).

A jammed axis proves its demand within these samples, because the demand runs away from it; so does any axis that lags a little. A
proof in pp is valid in every mode, because in pp the drive generates the demand itself. A proof in another mode is valid in that
mode only, because in csp a demand that is only the target moves as well.
"""

from __future__ import annotations

from collections import deque

from axisbus.cia402.modes import ModeOfOperation
from axisbus.motion.modes import TORQUE_MODES
from axisbus.motion.parameters import DemandUse

_PP = int(ModeOfOperation.PROFILE_POSITION)
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

    def believes(self, mode: int | None) -> bool:
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

    def gives(self, set_point: int) -> None:
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
        own = ahead and not (mode == _PP and any(abs(demand - each) <= OWN for each in self._given))
        self._seen = self._seen + 1 if own and self._anchored else 0
        self._anchored = abs(lead) <= self._window or (self._anchored and own)
        if self._seen >= _SAMPLES:
            self.proven.add(mode)
            self.everywhere = mode == _PP
