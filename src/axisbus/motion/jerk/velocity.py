"""A velocity with limited jerk that the master commands in csp: for drives without a profile jerk, and for virtual axes.

Theory of operation
-------------------
A ``SoftRamp`` commands the axis, from standstill or from its present path: with the velocity of that path, and its acceleration if
it is known. The next command continues from both. Only a jerk-limited move cannot start with an acceleration, so it first lets the
ramp ``settle``.

A requested halt brakes on the ramp (``brakes_softly``). Every other stop, and a halt without enough room, brakes at once with the
axis's own deceleration, as hard as without a jerk limit. In each cycle the master checks that this is still possible within the
position limits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from axisbus.errors import LimitError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.jerk.online_profile import ReferenceState, SoftRamp, VelocityRamps, stopping_distance
from axisbus.motion.moves.continuous_motion import VELOCITY_FLOOR, VELOCITY_SHARE, velocity_missed
from axisbus.motion.moves.csp_move import PathHandover
from axisbus.motion.moves.follow import Follow
from axisbus.motion.moves.profile import MoveProfile, braking_distance
from axisbus.motion.override import scaled
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.position_limits import widened
from axisbus.motion.stop_deceleration import CommandedMotion
from axisbus.motion.velocity_estimator import VelocityEstimator


@dataclass(frozen=True, slots=True)
class _RampTrajectory:
    """The set-points of a ramp as a trajectory; only the present position is available."""

    ramp: SoftRamp
    top_acceleration: float
    duration: float = 1.0

    def position(self, _t: float) -> float:
        """Return the position of this cycle."""
        return self.ramp.reference.position


def ramps_of(profile: MoveProfile, parameters: AxisParameters) -> VelocityRamps:
    """Return the ramps of a profile that has all of its ratios, and a jerk."""
    assert profile.up
    assert profile.down
    assert profile.softness
    unit, top = abs(parameters.units.position.factor), parameters.limits.velocity
    return VelocityRamps(
        profile.up / unit, profile.down / unit, profile.softness, math.inf if top is None else top
    )


def settled_from(before: Follow, ramps: VelocityRamps, period: float) -> ReferenceState:
    """Return the state of an axis after its acceleration has been reduced to 0, from its present path."""
    step = before.last_step
    return SoftRamp(ReferenceState(step.position, step.velocity, before.acceleration), ramps).settled(period)


class JerkLimitedVelocity(PathHandover):
    """One axis at a velocity; ends well when it is reached, and continues to move. Holds its ramp, once it has begun."""

    keeps_moving = True
    ends_at_rest = False
    foresees = False

    def __init__(
        self,
        profile: MoveProfile,
        parameters: AxisParameters,
        gate: StartBarrier,
        before: Follow | None = None,
        *,
        bounded: bool | None = None,
    ) -> None:
        """``profile`` with a signed velocity, all of its ratios, and a jerk.

        ``before``: the path that commands the axis now, None at rest; ``bounded``: whether the position limits apply, None: as for
        ``before``.
        """
        super().__init__(parameters, gate, before)
        self._ramps = ramps_of(profile, parameters)
        self._bounded = bounded
        self._settles = False
        self._reached = VelocityReached(profile, parameters)
        self._factor = 1.0  # the override of the commanded velocity
        self.ramp: SoftRamp | None = None
        self.brakes_softly = False
        self.commanded = self._commanded_motion()

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True once the velocity is reached, unless an override of 0 holds the axis. Must be stepped further to keep it."""
        self._override(image.override)
        before = self._before
        if before is not None:
            if self._is_given_up or not self._gate.pass_through(self):
                self._step_previous_path(before, image, order)
                return False
            self._take_over(before)
        ramp, reached = self.ramp, False
        if ramp is None and self._prepared:
            here = self._units.to_units(self.reference(image) - image.origin)
            self._begin_ramp(ReferenceState(here))
        elif ramp is not None and self._is_on(ramp):
            reached = self._advance(ramp, image)
        super().step(image, order)
        return reached and self._factor > 0.0

    def begin_braking(self) -> bool:
        """Begin to brake: on the ramp if the halt is a soft one, else with the axis's own deceleration."""
        if self._before is None and not self.brakes_softly and self.brake_alone():
            return True
        return super().begin_braking()

    def brake_softly(self) -> None:
        """Make the next halt as soft as the velocity command."""
        path = self.commanding_path
        if isinstance(path, JerkLimitedVelocity):
            path.brakes_softly = True

    def brake_hard(self) -> None:
        """Make a soft halt brake with the axis's own deceleration from now on."""
        self.brakes_softly = False
        if self._before is not None:
            self._before.brake_hard()

    def settle(self) -> bool:
        """Reduce the acceleration to 0, and keep the velocity that results; return whether this is done."""
        ramp, settles = self.ramp, self._settles
        if self._before is not None:
            self._settles = True  # as soon as it commands the axis
            return False
        if ramp is None or not self._is_on(ramp):
            return True
        self._settles = True
        if not settles:
            self.brakes_softly = ramp.braking = False  # a halt that is interrupted
            ramp.settle(self._period)
        return ramp.at_goal

    @property
    def settled(self) -> ReferenceState:
        """The commanded state after ``settle``, including the superimposed distance."""
        ramp = self.ramp
        if self._before is not None:
            return settled_from(self._before, self._ramps, self._period)
        if ramp is None or not self._is_on(ramp):
            return ReferenceState(*self.last_step)
        off, reference = self.last_step.position - ramp.reference.position, ramp.settled(self._period)
        return reference._replace(position=reference.position + off)

    @property
    def waits(self) -> bool:
        """Whether it was commanded at standstill, and has moved nothing yet."""
        return self._before is None and not self._running

    def require_stop_within_limits(self) -> None:
        """Raise LimitError if the axis would come to rest beyond its position limits on the ramps of the command."""
        limits, before = self._parameters.limits.position, self._before
        if limits is None or before is None or not self._bounded:
            return
        step, unit = before.last_step, self._units
        reference = ReferenceState(step.position, step.velocity, before.acceleration)
        turns = self._reached.goal * reference.velocity <= 0.0
        distance = (
            stopping_distance(reference, self._ramps)
            if turns
            else self._hard_stopping_distance(reference.velocity)
        )
        stop = reference.position + math.copysign(distance, reference.velocity)
        low, high = widened(limits, reference.position, abs(unit.to_units(1)))
        if low <= stop <= high:
            return
        raise LimitError(
            f"{self._parameters.name}: the axis could not stop within the position limits with that deceleration and that jerk",
            observed=f"from its present speed of {reference.velocity:g} {unit.unit}/s it would stop at {stop:g} {unit.unit}; "
            f"the allowed range is {limits[0]:g} to {limits[1]:g}",
            remedy="give a higher deceleration or more jerk, or halt the axis first; the previous command continues",
        )

    @property
    def acceleration(self) -> float:
        """The present acceleration of the commanded motion (unit/s²)."""
        ramp = self.ramp
        on_ramp = ramp is not None and self._is_on(ramp) and self._addition is None
        return ramp.reference.acceleration if ramp is not None and on_ramp else super().acceleration

    def resume(self, before: Follow) -> None:
        """Continue from the last target of ``before``."""
        super().resume(before)
        self._set_limits_again(before.last_step.position)

    def _start(self, image: AxisImage) -> None:
        super()._start(image)
        self._set_limits_again(self._units.to_units(self.reference(image) - image.origin))

    def _set_limits_again(self, here: float) -> None:
        """Apply the position limits, or none before the axis is homed; an axis at rest beyond them may move back."""
        if self._bounded is not None:
            self._set_limits(self._parameters.limits.position if self._bounded else None, here)

    def _is_on(self, ramp: SoftRamp) -> bool:
        """Whether its ramp commands the axis, and no other braking."""
        return self._running and self.clock is ramp

    def _override(self, factor: float) -> None:
        """Command the velocity under another override, and restart the check that the axis reaches it."""
        if factor == self._factor:
            return
        self._factor = factor
        self._reached.override(factor)
        self.commanded = self._commanded_motion()
        if self.ramp is not None and not self._settles:
            self.ramp.goal = self._reached.goal

    def _take_over(self, before: Follow) -> None:
        step = before.last_step
        self._begin_ramp(ReferenceState(step.position, step.velocity, before.acceleration))
        self.resume(before)
        self._before = None

    def _begin_ramp(self, reference: ReferenceState) -> None:
        self.ramp = ramp = SoftRamp(reference, self._ramps)
        ramp.goal = self._reached.goal
        if self._settles:
            ramp.settle(self._period)
        self.guide_by(ramp, _RampTrajectory(ramp, self._ramps.hardest))

    def _advance(self, ramp: SoftRamp, image: AxisImage) -> bool:
        """Advance by one cycle; return whether the velocity is reached. On an error the axis brakes in the same cycle."""
        reached, self.brakes_along = False, True
        if not ramp.braking and not self._settles:
            reached = self._reached.step(image, at_goal=ramp.at_goal)
        self._check_stop_within_limits(ramp)
        self.brakes_along = False
        if self._is_on(ramp):
            ramp.advance(self._period)
        return reached

    def _commanded_motion(self) -> CommandedMotion:
        """Return the commanded motion for the monitoring of the limits: a stop brakes with the axis's own deceleration."""
        unit, hard = abs(self._units.factor), self._parameters.path_deceleration
        down = hard or self._ramps.down
        soft = 0.0 if hard else 2.0 * self._ramps.hardest / self._ramps.jerk
        goal = self._reached.goal * self._units.factor
        return CommandedMotion(goal, self._ramps.up * unit, down * unit, by_core=True, soft=soft)

    def _hard_stopping_distance(self, velocity: float) -> float:
        """Return the distance to rest for any stop but a soft halt."""
        hard = self._parameters.path_deceleration
        return (
            braking_distance(velocity, hard)
            if hard
            else stopping_distance(ReferenceState(0.0, velocity), self._ramps)
        )

    def _check_stop_within_limits(self, ramp: SoftRamp) -> None:
        """Raise LimitError, or brake a soft halt harder, if the axis could not stay within its limits after this cycle.

        Raises:
            LimitError: its velocity moves it out of the limits.
        """
        limits, after = self._limits, ramp.next(self._period)
        if limits is None:
            return
        position = after.position + self.shifted
        stop = position + math.copysign(self._hard_stopping_distance(after.velocity), after.velocity)
        outside = stop > limits.high if after.velocity > 0.0 else stop < limits.low
        if not outside:
            return
        if not ramp.braking:
            raise self._limit_error(after, stop)
        self.brakes_softly = False
        self.brake_alone()

    def _limit_error(self, reference: ReferenceState, stop: float) -> LimitError:
        name, unit, limits = self._parameters.name, self._units.unit, self._edges
        seen = f"at {reference.position:g} {unit}, with {reference.velocity:g} {unit}/s, it would stop at {stop:g} {unit}"
        if limits is None:
            return self._count_exceeded("its velocity", seen, "braked")
        return LimitError(
            f"{name}: about to leave its position limits",
            observed=f"{seen}; the allowed range is {limits[0]:g} to {limits[1]:g}",
            remedy="move back into the limits; the axis was braked, to stop within them",
        )


# ----------------------------------------------------------------------------------------------------------------------
# Whether an axis has reached the velocity that the master commands: from the measured values, not from the sent ones.


_FILTER = 0.2  # share of a new sample in the mean of a noisy velocity
_MARGIN = 2.0  # seconds that the axis may be late, in addition to four times its ramp


class VelocityReached:
    """Holds the commanded velocity under the override, its measured values, and the remaining time."""

    def __init__(self, profile: MoveProfile, parameters: AxisParameters) -> None:
        """``profile`` with a signed velocity, all of its ratios, and a jerk."""
        assert profile.speed is not None
        units, velocity = parameters.units, profile.velocity
        sign = math.copysign(1.0, units.velocity.to_units(velocity)) if velocity else 0.0
        self._asked = sign * profile.speed / abs(units.position.factor)  # unit/s
        self._profile = profile
        self._parameters = parameters
        self._track = VelocityEstimator()  # of the positions, for a drive whose 606Ch is not received
        self._mean: float | None = None
        self.override(1.0)

    def override(self, factor: float) -> None:
        """Restart the check with the velocity under another override."""
        limit, asked = self._parameters.limits.velocity, self._asked
        speed = abs(asked) * factor
        speed = speed if limit is None else min(speed, max(limit, abs(asked)))
        self.goal = math.copysign(speed, asked) if asked else 0.0
        self._target = scaled(self._profile.velocity, factor, self._parameters)
        self._deadline: float | None = None
        self._is_there = False

    def step(self, image: AxisImage, *, at_goal: bool) -> bool:
        """Return whether the velocity is reached, or was; ``at_goal``: the set-points no longer change.

        Raises:
            MotionTimeout: the time for it has passed.
        """
        self._track.take(image.position, image.position_stamp)
        if self._deadline is None:
            self._deadline = image.now + self._allowed(abs(self._measured(image) or 0.0))
        if self._is_there:
            return True
        self._is_there = at_goal and self._in_velocity(image)
        if not self._is_there and image.now > self._deadline:
            raise velocity_missed(image, self._parameters, self._target)
        return self._is_there

    def _measured(self, image: AxisImage) -> float | None:
        """Return the velocity in unit/s, from 606Ch, else from the positions; None if neither is known yet."""
        units = self._parameters.units
        if image.velocity is not None:
            return units.velocity.to_units(image.velocity)
        return units.position.to_units(self._track.motion[0]) if self._track.is_known else None

    def _in_velocity(self, image: AxisImage) -> bool:
        """Whether the velocity (or its mean, if it is noisy) has reached the goal; more than half of it is always required."""
        goal, velocity = self.goal, self._measured(image)
        if velocity is None:
            return False
        self._mean = velocity if self._mean is None else self._mean + _FILTER * (velocity - self._mean)
        floor = abs(self._parameters.units.velocity.to_units(VELOCITY_FLOOR))
        off = min(abs(velocity - goal), abs(self._mean - goal))
        if not goal:
            return off <= floor or image.standstill
        return off < 0.5 * abs(goal) and off <= max(floor, VELOCITY_SHARE * abs(goal))

    def _allowed(self, speed: float) -> float:
        """Return four times the ramp from ``speed`` (of either direction) through 0 to the new one with its jerk, plus a margin."""
        profile, unit = self._profile, abs(self._parameters.units.position.factor)
        if profile.timeout is not None:
            return profile.timeout
        assert profile.ramp
        return (
            4.0 * (speed + abs(self.goal)) * unit / profile.ramp + 2.0 * profile.soft_seconds(unit) + _MARGIN
        )
