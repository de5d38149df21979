"""What leads an axis: the targets that were sent, and the drive's own demand (6062h) as far as it can be believed.

Theory of operation
-------------------
6062h is what the drive's position controller is led to, and so tells what pulls a standing axis. Not every drive means that by it:

- in modes without a position controller some lead a position along, others leave 6062h as it was: there it counts once it has
  moved;
- some show the target of a move at once, others the actual position: a demand that is exactly the one or the other in motion
  is *idle*, and not looked at again.

In a cyclic position mode the last target leads as well, whatever 6062h says.
"""

from __future__ import annotations

import math

from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import ENERGISED, State
from axisbus.motion.modes import POSITION_MODES, WITHOUT_POSITION_DEMAND

_M = ModeOfOperation
_CSP, _HOMING, _PP = int(_M.CYCLIC_SYNC_POSITION), int(_M.HOMING), int(_M.PROFILE_POSITION)
_ENABLED = State.OPERATION_ENABLED
_MOVED = 20  # increments: more than a quiet value wanders
_NO_CHANCE = 10  # samples in a row


class Led:
    """Holds what was sent last, and what has been found out of 6062h; positions are unwrapped increments.

    ``target`` is that of csp (None: there was none in this mode), ``set_point`` that of pp, given at ``set_point_at``; ``taken`` is
    that set-point once the axis was seen to go by it (only ``Proof`` looks). A homing runs since ``searching_since`` (infinite:
    none does). ``idle``: 6062h says nothing on this drive.
    """

    __slots__ = (
        "_before",
        "_mode",
        "_same",
        "_same_at",
        "idle",
        "searching_since",
        "set_point",
        "set_point_at",
        "taken",
        "target",
    )

    def __init__(self) -> None:
        self.idle = False
        self.target: int | None = None
        self.set_point: int | None = None
        self.set_point_at = -math.inf
        self.taken: int | None = None
        self.searching_since = math.inf
        self._mode: int | None = None
        self._before: int | None = None  # 6062h when the drive came into its mode
        self._same = self._same_at = 0

    def forget(self) -> None:
        """The drive's count is another one now."""
        self.target = self.set_point = self.taken = self._before = None

    def note(
        self, now: float, mode: int | None, demand: int | None, target: int | None, is_edge: bool
    ) -> None:
        """Take what is sent in this cycle: a target (None: none), and whether bit 4 (new set-point, homing start) goes with it."""
        if mode is None:
            return  # not known now; it has not changed by that
        if mode != self._mode:
            self._mode, self._before, self.taken = mode, demand, None
        if mode != _CSP:
            self.target = None
        elif target is not None:
            self.target = target
        if mode != _HOMING or not is_edge:
            self.searching_since = math.inf
        elif self.searching_since == math.inf:
            self.searching_since = now
        if is_edge and mode == _PP and target is not None and target != self.set_point:
            self.set_point, self.set_point_at = target, now

    def leads_on(self, mode: int | None) -> bool:
        """Whether a target in csp is all that a ``note`` of the present ``mode`` would change."""
        return mode == _CSP and mode == self._mode and self.searching_since == math.inf

    def judge(self, demand: int | None, position: int | None, state: State, mode: int | None) -> bool:
        """Return whether 6062h is the actual position: nothing that moves is time and again exactly where it is led."""
        if demand is None or demand != position:
            self._same = 0
            return False
        leads = state is _ENABLED and mode in POSITION_MODES
        if not leads or abs(demand - self._same_at) <= _MOVED:
            return False
        self._same_at = demand
        self._same += 1
        self.idle = self._same > _NO_CHANCE
        return self.idle

    def pull(self, demand: int | None, position: int | None, state: State, mode: int | None) -> int | None:
        """Return how far the axis is led from where it is; None where nobody knows, or nothing leads it."""
        if position is None or state not in ENERGISED:
            return None  # without power nothing pulls
        if demand is not None and mode in WITHOUT_POSITION_DEMAND and not self._lives(demand, mode):
            demand = None
        target = self.target
        if target is None:
            return None if demand is None else demand - position
        if demand is None or abs(target - position) > abs(demand - position):
            return target - position
        return demand - position

    def _lives(self, demand: int, mode: int | None) -> bool:
        """Whether 6062h has moved since the drive is in its present mode."""
        if mode != self._mode:
            return False
        if self._before is None:
            self._before = demand
        return abs(demand - self._before) > _MOVED
