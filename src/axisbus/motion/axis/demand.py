"""Whether 6062h (position demand value) is what leads the axis, judged by what it does.

Theory of operation
-------------------
A drive may have 6062h in its dictionary and mean nothing by it: it stays 0, it is the target of a move at once, or it is another
name of 6064h. So a demand is believed only after it has been seen to lead the axis and to be the drive's own:

- it was where the axis is (within ``standstill_window``), and then went ahead of the axis in ``_SAMPLES`` samples in a row,
- in each of them it had moved, and farther than the axis was at the moment of the sample (a copy of 6064h is never ahead, and a
  demand that stays 0 never moves),
- in pp it was none of the set-points that were given (a demand that equals the target jumps from one set-point to the next).

A jammed axis proves its demand within these samples, because the demand runs away from it; so does any axis that lags a little.
What was seen in pp holds in every mode: there the drive makes the demand itself. What was seen in another mode holds in that mode
only, because in csp a demand that is no more than the target moves as well.
"""

from __future__ import annotations

from collections import deque

from axisbus.cia402.modes import ModeOfOperation
from axisbus.motion.modes import TORQUE_MODES
from axisbus.motion.parameters import DemandUse

_PP = int(ModeOfOperation.PROFILE_POSITION)
# In homing the drive renames its positions; under torque nothing leads to a position.
_PROVES_NOTHING = frozenset({int(ModeOfOperation.HOMING), *map(int, TORQUE_MODES)})
_SAMPLES = 3
OWN = 4.0  # increments: two values that are closer are the same; an encoder may be noisy by half of it
_SET_POINTS = 8  # that are remembered: one that comes by SDO may still be an earlier one


class DemandTrust:
    """Judges the demand of one drive; holds the modes in which it was seen to lead, and what was seen of it lately."""

    __slots__ = ("_anchored", "_before", "_given", "_seen", "_use", "_window", "everywhere", "proven")

    def __init__(self, use: DemandUse, window: float) -> None:
        """``window``: increments between demand and position within which nothing pulls a standing axis."""
        self._use = use
        self._window = window
        self.everywhere = use is not DemandUse.AUTO  # there is nothing to be judged (any more)
        self.proven: set[int | None] = set()
        self._given: deque[int] = deque(maxlen=_SET_POINTS)
        self.begin()

    def believes(self, mode: int | None) -> bool:
        """Whether the demand counts in this mode."""
        return self._use is not DemandUse.IGNORE and (self.everywhere or mode in self.proven)

    def begin(self) -> None:
        """Look again from the next sample on: the drive counts, or leads its motor, in another way now."""
        self._before: int | None = None
        self._anchored = False
        self._seen = 0

    def recount(self) -> None:
        """The drive's count is another one now."""
        self._given.clear()
        self.begin()

    def gives(self, set_point: int) -> None:
        """A set-point is given to the drive (unwrapped increments)."""
        self._given.append(set_point)

    def look(self, demand: int, lead: float, doubt: float, mode: int | None) -> None:
        """Take a new sample of a drive in *operation enabled* that is not believed yet.

        ``lead``: by how much the demand was ahead of the axis when it was sampled; ``doubt``: by how much that may be wrong.
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
