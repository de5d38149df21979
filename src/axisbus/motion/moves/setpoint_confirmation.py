"""Confirm that a drive has taken a set-point, from its axis's behaviour, if bit 12 of the statusword proves nothing.

Theory of operation
-------------------
Evidence since the last edge of bit 4, in values received after it:

- 6062h or 6064h has come nearer to the target, but not because it moves to the previous set-point (it moves away from that one);
- bit 10 falls on an axis that was at standstill, or is set again when the axis is nearer to this target than to the previous one.

Neither can be seen if the axis is already at its target, or if the drive had taken the same target before. Then it is enough that
the axis is there for a while after the edge. If an axis comes no nearer to its target for a time, it has not taken the target: the
move ends with an error, wherever the axis is.
"""

from __future__ import annotations

import math

from axisbus.cia402 import statusword as sw
from axisbus.errors import SetPointError
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.moves.activity import present_speed, where_text
from axisbus.motion.moves.profile import MoveProfile
from axisbus.motion.moves.setpoint import SetPoint
from axisbus.motion.moves.setpoint_without_ack import TimedSetPoint
from axisbus.motion.parameters import AxisParameters

_STARTS = 0.3  # seconds after which a drive has begun to move to its old target, unless something holds it
_TURNS = 2.0  # seconds to reverse, if the deceleration is not known


def confirmation_for(
    point: SetPoint, profile: MoveProfile, parameters: AxisParameters
) -> SetPointConfirmation | None:
    """Return the confirmation that a set-point needs, None if bit 12 is sufficient."""
    return SetPointConfirmation(point, profile, parameters) if isinstance(point, TimedSetPoint) else None


class _ApproachMonitor:
    """One position between ``old`` and ``new``; holds its longest distance to the new target and its shortest to both."""

    __slots__ = ("_farthest", "_nearest_old", "_new", "_old", "best")

    def __init__(self, new: int, old: int | None) -> None:
        self._new, self._old = new, old
        self._farthest = 0.0
        self._nearest_old = math.inf
        self.best = math.inf  # the shortest distance to the target

    def shows(self, position: int, tolerance: float) -> bool:
        """Evaluate a position; return whether it has come nearer to the new target, and not because it moves to the old one."""
        new = abs(position - self._new)
        self._farthest = max(self._farthest, new)
        nearer = new < self._farthest - tolerance
        if self._old is None or abs(self._old - self._new) <= tolerance:
            return nearer
        old = abs(position - self._old)
        self._nearest_old = min(self._nearest_old, old)
        return nearer and old > self._nearest_old + tolerance

    def gains(self, position: int, tolerance: float) -> bool:
        """Return whether it is closer to the target than at any time before."""
        distance = abs(position - self._new)
        if distance >= self.best - tolerance:
            return False
        self.best = distance
        return True


class SetPointConfirmation:
    """Holds the state at the last edge, and the evidence since; ``seen``: the set-point was taken."""

    __slots__ = (
        "_allowed",
        "_approaches",
        "_bit_fell",
        "_edge",
        "_gained_at",
        "_had_same_target",
        "_old",
        "_parameters",
        "_point",
        "_profile",
        "_tolerance",
        "_was_at_standstill",
        "seen",
    )

    def __init__(self, point: TimedSetPoint, profile: MoveProfile, parameters: AxisParameters) -> None:
        self._point = point
        self._profile = profile
        self._parameters = parameters
        self._tolerance = parameters.standstill_tolerance
        self._edge = math.inf
        self._old: int | None = None  # the previous set-point, in unwrapped increments
        self._had_same_target = False  # it had taken the same target before, and moves there anyway
        self._was_at_standstill = False  # with bit 10, before the edge
        self._bit_fell = False  # bit 10, since then
        self._approaches: tuple[_ApproachMonitor, _ApproachMonitor] = (
            _ApproachMonitor(point.target, None),
            _ApproachMonitor(point.target, None),
        )
        self._gained_at = self._allowed = 0.0
        self.seen = False

    def step(self, image: AxisImage) -> None:
        """Evaluate this cycle's values, after the set-point's own step.

        Raises:
            SetPointError: for too long, no evidence shows that the drive has taken it.
        """
        if self._point.edge_at != self._edge:
            self._begin(image)
        elif self._edge < math.inf:
            self._look(image)
        if self.seen or self._had_same_target:
            image.reference_tracker.taken = self._point.target

    def suffices(self, image: AxisImage) -> bool:
        """Whether an axis at rest within its window, with bit 10, has ended its move: it moved there, or it is exactly there."""
        if self.seen:
            return True
        position, demand = self._since_edge(image)
        is_expected_there = self._had_same_target or any(
            self._is_there(now) for now in (position, demand) if now is not None
        )
        wait = self._parameters.timing.settle if self._was_at_standstill else _STARTS
        return is_expected_there and image.now >= self._edge + wait

    # -- state before the edge ---------------------------------------------------------------------------------------

    def _begin(self, image: AxisImage) -> None:
        first = self._edge == math.inf
        self._edge = image.now
        if first:
            self._old = image.reference_tracker.set_point
            self._had_same_target = self._old == self._point.target == image.reference_tracker.taken
            image.reference_tracker.taken = None
        word = image.statusword or 0
        at_rest = image.position is None or image.standstill
        self._was_at_standstill = at_rest and bool(word & sw.TARGET_REACHED) and not self._point.from_halt
        if self._was_at_standstill:
            self._old = image.position  # no set-point moves it any more
        self._approaches = (
            _ApproachMonitor(self._point.target, self._old),
            _ApproachMonitor(self._point.target, self._old),
        )
        for approach, now in zip(self._approaches, (image.position, image.demand), strict=True):
            if now is not None:
                approach.shows(now, self._tolerance)
                approach.gains(now, 0.0)
        self._gained_at = image.now
        self._allowed = self._time(image)

    def _time(self, image: AxisImage) -> float:
        """Return the time within which the axis must approach its target: to begin, to reverse, and, if slow, to move visibly."""
        speed, ramp = self._profile.speed, self._profile.down
        moving = present_speed(image, self._parameters)
        turn = 2.0 * moving / ramp if ramp else _TURNS
        bit = 2.0 * (self._tolerance + 1.0) / speed if speed else _TURNS
        return self._parameters.timing.acknowledge + turn + bit

    # -- evidence since the edge -------------------------------------------------------------------------------------

    def _look(self, image: AxisImage) -> None:
        position, demand = self._since_edge(image)
        for approach, now in zip(self._approaches, (position, demand), strict=True):
            if now is None:
                continue
            if approach.shows(now, self._tolerance):
                self.seen = True
            if approach.gains(now, self._tolerance) or self._is_there(now):
                self._gained_at = image.now
        self.seen = self.seen or self._by_word(image, position)
        if not self.seen and not self._had_same_target and image.now > self._gained_at + self._allowed:
            raise self._unseen(image)

    def _since_edge(self, image: AxisImage) -> tuple[int | None, int | None]:
        """Position and demand, if they were received after the edge."""
        position = image.position if image.position_stamp > self._edge else None
        return position, image.demand if image.demand_stamp > self._edge else None

    def _by_word(self, image: AxisImage, position: int | None) -> bool:
        if image.statusword is None or image.statusword_stamp <= self._edge:
            return False
        if not image.statusword & sw.TARGET_REACHED:
            self._bit_fell = True
            return self._was_at_standstill
        if not self._bit_fell or position is None or self._old is None:
            return False
        return abs(position - self._point.target) < abs(position - self._old)

    def _is_there(self, position: int) -> bool:
        return abs(position - self._point.target) <= self._tolerance

    def _unseen(self, image: AxisImage) -> SetPointError:
        name = self._parameters.name
        word = "no fresh statusword" if image.statusword is None else f"statusword 0x{image.statusword:04X}"
        return SetPointError(
            f"{name}: no sign that the drive has accepted the set-point",
            axis=name,
            observed=f"position {where_text(image, self._parameters)}, target {self._target_text(image)}; neither 6064h nor "
            f"6062h has come nearer to it for {image.now - self._gained_at:.2g} s after the edge of bit 4, or only "
            f"by the move to the previous target; {word}",
            remedy="check whether the axis is blocked, whether the target lies within the drive's own limits (607Dh), and that "
            "profile velocity and acceleration (6081h, 6083h) are not 0; a drive that begins late needs a longer acknowledge_time "
            f'in [axes.{name}], and handshake = "on-change" there needs 6064h (better 6062h, too) in a TPDO',
        )

    def _target_text(self, image: AxisImage) -> str:
        units = self._parameters.units.position
        return f"{units.to_units(self._point.target - image.origin):g} {units.unit}"
