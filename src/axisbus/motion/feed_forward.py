"""Whether the offsets of an axis may act in this cycle, and the set-point that they are computed from."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from axisbus.cia402.modes import ModeOfOperation
from axisbus.cia402.state import ENERGISED, PowerState
from axisbus.motion.cyclic.ramps import VelocityRamp
from axisbus.motion.moves.enable import EnableActivity
from axisbus.motion.moves.follow import Follow
from axisbus.motion.parameters import AxisParameters, FeedForward
from axisbus.motion.states import AxisState
from axisbus.motion.stop.active_stop import StopKind
from axisbus.motion.stop.stop_sequence import StopLevel
from axisbus.units import INT32_HALF, INT32_LEAST, whole_below

if TYPE_CHECKING:
    from axisbus.motion.axis.core import AxisCore


_ENABLED = PowerState.OPERATION_ENABLED
_CSP, _CSV = int(ModeOfOperation.CYCLIC_SYNC_POSITION), int(ModeOfOperation.CYCLIC_SYNC_VELOCITY)
_MAY_BE_ENERGISED = ENERGISED | {PowerState.UNKNOWN}
# States in which the constant torque acts; in the others the axis is being stopped, or was stopped.
_CONSTANT_TORQUE_STATES = frozenset(
    {
        AxisState.STANDSTILL,
        AxisState.DISCRETE_MOTION,
        AxisState.CONTINUOUS_MOTION,
        AxisState.SYNCHRONIZED_MOTION,
    }
)
_NOT_SENT: Offsets = (None, None)


def feed_forward_of(parameters: AxisParameters) -> FeedForwardOffsets | None:
    """Return the feed-forward of an axis; None if its cell file configures none."""
    given = parameters.feed_forward
    return FeedForwardOffsets(given, parameters) if given is not None and given.outputs else None


def offsets_of(core: AxisCore, calculator: FeedForwardOffsets) -> Offsets:
    """Return the offsets to send with the set-points of this cycle."""
    if not _is_commanded(core):
        zero = calculator.rest()
        return _NOT_SENT if _is_as_found(core) else zero
    by_position = core.image.mode == _CSP
    return calculator.offsets(_velocity(core), by_position=by_position, holds=_holds(core))


def _is_as_found(core: AxisCore) -> bool:
    """Return whether to leave the offsets as found: an enabled drive may depend on them until an enable takes it over."""
    if not core.touched:
        return True
    enables = isinstance(core.activity, EnableActivity) and core.stop_sequence is None and not core.powered
    return enables and core.image.state in _MAY_BE_ENERGISED


def _is_commanded(core: AxisCore) -> bool:
    """Return whether this master has enabled the drive, it adds its offsets to targets in this mode, and it is to stay enabled."""
    image, order, stop_sequence = core.image, core.order, core.stop_sequence
    return (
        core.powered
        and image.state is _ENABLED
        and image.mode in (_CSP, _CSV)
        and order.goal is _ENABLED
        and order.word is None
        and (stop_sequence is None or stop_sequence.level is StopLevel.HALT)
    )


def _holds(core: AxisCore) -> bool:
    stop_sequence = core.stop_sequence
    leaves = stop_sequence is not None and (
        stop_sequence.removes_power or core.stopping.kind is StopKind.SHUTDOWN
    )
    return core.state in _CONSTANT_TORQUE_STATES and not leaves


def _velocity(core: AxisCore) -> float | None:
    """Return the velocity of the set-point of this cycle, in unit/s; None if there is none."""
    order, stop_sequence, activity = core.order, core.stop_sequence, core.activity
    set_point_source = (
        stop_sequence.follow
        if stop_sequence is not None
        else None
        if activity is None
        else activity.set_point_source
    )
    if isinstance(set_point_source, Follow):
        is_commanded = (
            core.image.mode == _CSP and order.target_position is not None and set_point_source.is_under_way
        )
        return set_point_source.last_step.velocity if is_commanded else None
    if (
        isinstance(set_point_source, VelocityRamp)
        and core.image.mode == _CSV
        and order.target_velocity is not None
    ):
        return core.parameters.units.velocity.to_units(set_point_source.velocity)
    return None


# -- The offsets of one axis (60B1h, 60B2h), computed in each cycle from the velocity of its set-points ----------------
#
# Theory of operation
# A drive in csp moves evenly from the previous target to the target of this SYNC. The velocity of a set-point is the distance
# between both targets, divided by the period: exactly that of the interval which begins with this SYNC. Its acceleration is the
# difference from the previous velocity. Both are computed before the set-point is rounded to increments, because a second
# difference of rounded values is noise.
#
# The constant torque changes on a ramp, because a step would be a jolt for a controller that already holds the load. If this master
# does not command the axis, all offsets are 0 at once.


RAMP = 0.2  # seconds in which the constant torque changes from one value to another
_INT16_MOST = 32767


Offsets = tuple[int | None, int | None]  # 60B1h and 60B2h; None: not sent


class FeedForwardOffsets:
    """Holds the velocity of the previous set-point, and the present constant torque (0.1 % of rated torque)."""

    __slots__ = (
        "_by_torque",
        "_by_velocity",
        "_change",
        "_goal",
        "_inertia",
        "_max_torque",
        "_period",
        "_velocity",
        "_velocity_factor",
        "constant",
        "requested",
        "zero",
    )

    def __init__(self, given: FeedForward, parameters: AxisParameters) -> None:
        units, rated = parameters.units, parameters.units.rated_torque
        per_torque = 1000.0 / rated if rated else 0.0
        self._period = parameters.scan_period
        self._by_velocity, self._by_torque = given.velocity, given.by_torque
        self._velocity_factor = units.velocity.factor * (-1.0 if given.turned else 1.0)
        self._inertia = (given.inertia or 0.0) * per_torque  # per unit/s²
        limit = parameters.limits.torque
        max_torque = _INT16_MOST if limit is None else whole_below(abs(limit * per_torque))
        self._max_torque = min(max_torque, _INT16_MOST)
        self._velocity: float | None = None
        self.requested = (given.torque or 0.0) * per_torque  # the requested constant torque
        self.constant = self._goal = self._change = 0.0
        self.zero = self._offsets(0.0, 0.0)

    def aim(self, torque: float) -> None:
        """Request another constant torque (0.1 % of rated torque); it takes effect now, or when the axis is next commanded."""
        self.requested = torque

    def rest(self) -> Offsets:
        """Return the offsets of an axis that this master does not command: 0."""
        self._velocity = None
        self.constant = self._goal = 0.0
        return self.zero

    def offsets(self, velocity: float | None, *, by_position: bool = True, holds: bool = True) -> Offsets:
        """Return the offsets of this cycle.

        ``velocity``: velocity of the set-point in unit/s; None if the last set-point is held. ``by_position``: True in csp; False
        in csv, where the target itself is the velocity. ``holds``: whether the constant torque acts; otherwise it changes to 0.
        """
        before, self._velocity = self._velocity, velocity
        acceleration = 0.0
        if velocity is not None and before is not None:
            acceleration = (velocity - before) / self._period
        goal = self.requested if holds else 0.0
        if self.constant != goal or self._goal != goal:
            self._approach(goal)
        torque = self._inertia * acceleration + self.constant
        return self._offsets((velocity or 0.0) if by_position else 0.0, torque)

    def _approach(self, goal: float) -> None:
        if goal != self._goal:
            self._goal = goal
            self._change = abs(goal - self.constant) * self._period / RAMP
        off = goal - self.constant
        self.constant = goal if abs(off) <= self._change else self.constant + math.copysign(self._change, off)

    def _offsets(self, velocity: float, torque: float) -> Offsets:
        first = second = None
        if self._by_velocity:
            first = min(max(round(velocity * self._velocity_factor), INT32_LEAST), INT32_HALF - 1)
        if self._by_torque:
            second = min(max(round(torque), -self._max_torque), self._max_torque)
        return first, second
