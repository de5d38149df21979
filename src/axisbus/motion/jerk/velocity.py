"""A velocity with a limited jerk that the master leads in csp: for drives that have no profile jerk of their own, and virtual axes.

Theory of operation
-------------------
The axis is led by a ``SoftRamp``, from rest or from what leads it along a path already: with the velocity of that, and its
acceleration where it is known. What takes over next goes on from both; a move with a limit of jerk, which has no other way to take
an acceleration up, lets the ramp ``settle`` before.

A halt that was asked for brakes on the ramp (``brakes_softly``). Every other stop, and a halt for which there is no room left,
brakes with the axis's own deceleration at once, as hard as it would without a limit of jerk. In each cycle it is seen whether that
is still possible within the position limits.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from axisbus.errors import LimitError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.jerk.online_profile import ReferenceState
from axisbus.motion.jerk.ramp import SoftRamp, VelocityRamps, rest_way
from axisbus.motion.jerk.velocity_reached import VelocityReached
from axisbus.motion.moves.follow import Follow
from axisbus.motion.moves.profile import MoveProfile, braking_distance
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.path_handover import PathHandover
from axisbus.motion.position_limits import widened
from axisbus.motion.stop_deceleration import CommandedMotion


@dataclass(frozen=True, slots=True)
class _Ramped:
    """Where a ramp leads an axis, as a trajectory: it is asked for the present place alone."""

    ramp: SoftRamp
    top_acceleration: float
    duration: float = 1.0

    def position(self, _t: float) -> float:
        """Return the place of this cycle."""
        return self.ramp.led.place


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
    """Return where an axis is when it has let its acceleration go, from what leads it now."""
    step = before.last_step
    return SoftRamp(ReferenceState(step.position, step.velocity, before.acceleration), ramps).settled(period)


class JerkLimitedVelocity(PathHandover):
    """One axis at a velocity; ends well when it is reached, and goes on. Holds its ramp, once it has begun."""

    goes_on = True
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

        ``before``: what leads the axis now, None at rest; ``bounded``: whether the position limits hold, None: as for that.
        """
        super().__init__(parameters, gate, before)
        self._ramps = ramps_of(profile, parameters)
        self._bounded = bounded
        self._settles = False
        self._reached = VelocityReached(profile, parameters)
        self._factor = 1.0  # the override of the velocity that is asked for
        self.ramp: SoftRamp | None = None
        self.brakes_softly = False
        self.course = self._course()

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True once the velocity is reached, and not while an override holds it; to be stepped on afterwards, to keep it."""
        self._override(image.override)
        before = self._before
        if before is not None:
            if self._is_given_up or not self._gate.pass_through(self):
                self._go_along(before, image, order)
                return False
            self._take_over(before)
        ramp, reached = self.ramp, False
        if ramp is None and self._prepared:
            here = self._units.to_units(self.reference(image) - image.origin)
            self._be_led(ReferenceState(here))
        elif ramp is not None and self._is_on(ramp):
            reached = self._go_on(ramp, image)
        super().step(image, order)
        return reached and self._factor > 0.0

    def begin_braking(self) -> bool:
        """Begin to brake: on the ramp where the halt is a soft one, else by the axis's own deceleration."""
        if self._before is None and not self.brakes_softly and self.brake_alone():
            return True
        return super().begin_braking()

    def brake_softly(self) -> None:
        """Let the halt that comes next be as soft as the velocity is led."""
        leads = self.leads_now
        if isinstance(leads, JerkLimitedVelocity):
            leads.brakes_softly = True

    def brake_hard(self) -> None:
        """Let a soft halt be one by the axis's own deceleration from now on."""
        self.brakes_softly = False
        if self._before is not None:
            self._before.brake_hard()

    def settle(self) -> bool:
        """Let its acceleration go, and keep the velocity that is left then; return whether that is done."""
        ramp, settles = self.ramp, self._settles
        if self._before is not None:
            self._settles = True  # as soon as it leads the axis
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
        """Where it is led to when that is done, with what is laid over it."""
        ramp = self.ramp
        if self._before is not None:
            return settled_from(self._before, self._ramps, self._period)
        if ramp is None or not self._is_on(ramp):
            return ReferenceState(*self.last_step)
        off, led = self.last_step.position - ramp.led.place, ramp.settled(self._period)
        return led._replace(place=led.place + off)

    @property
    def waits(self) -> bool:
        """Whether it has moved nothing yet, and the axis stood when it was asked for."""
        return self._before is None and not self._running

    def require_room(self) -> None:
        """Raise LimitError where the axis would come to rest beyond its position limits on the ramps of the command."""
        limits, before = self._parameters.limits.position, self._before
        if limits is None or before is None or not self._bounded:
            return
        step, unit = before.last_step, self._units
        led = ReferenceState(step.position, step.velocity, before.acceleration)
        turns = self._reached.goal * led.velocity <= 0.0
        way = rest_way(led, self._ramps) if turns else self._hard_way(led.velocity)
        stop = led.place + math.copysign(way, led.velocity)
        low, high = widened(limits, led.place, abs(unit.to_units(1)))
        if low <= stop <= high:
            return
        raise LimitError(
            f"{self._parameters.name}: could not stop within the position limits with that deceleration and that jerk",
            observed=f"from its present speed of {led.velocity:g} {unit.unit}/s it would come to rest at {stop:g} {unit.unit}; "
            f"allowed are {limits[0]:g} to {limits[1]:g}",
            remedy="ask for a harder deceleration or more jerk, or halt the axis first; what it did before goes on",
        )

    @property
    def acceleration(self) -> float:
        """With which acceleration it leads the axis (unit/s²)."""
        ramp = self.ramp
        on_ramp = ramp is not None and self._is_on(ramp) and self._addition is None
        return ramp.led.acceleration if ramp is not None and on_ramp else super().acceleration

    def resume(self, before: Follow) -> None:
        """Go on from the last target of ``before``."""
        super().resume(before)
        self._bind_again(before.last_step.position)

    def _start(self, image: AxisImage) -> None:
        super()._start(image)
        self._bind_again(self._units.to_units(self.reference(image) - image.origin))

    def _bind_again(self, here: float) -> None:
        """Keep the position limits, or none before the axis is homed; one that stands outside may come back."""
        if self._bounded is not None:
            self._bind(self._parameters.limits.position if self._bounded else None, here)

    def _is_on(self, ramp: SoftRamp) -> bool:
        """Whether it is led on its ramp, and not braked otherwise."""
        return self._running and self.clock is ramp

    def _override(self, factor: float) -> None:
        """Ask for the velocity under another override, and look anew whether the axis comes to it."""
        if factor == self._factor:
            return
        self._factor = factor
        self._reached.override(factor)
        self.course = self._course()
        if self.ramp is not None and not self._settles:
            self.ramp.goal = self._reached.goal

    def _take_over(self, before: Follow) -> None:
        step = before.last_step
        self._be_led(ReferenceState(step.position, step.velocity, before.acceleration))
        self.resume(before)
        self._before = None

    def _be_led(self, led: ReferenceState) -> None:
        self.ramp = ramp = SoftRamp(led, self._ramps)
        ramp.goal = self._reached.goal
        if self._settles:
            ramp.settle(self._period)
        self.guide_by(ramp, _Ramped(ramp, self._ramps.hardest))

    def _go_on(self, ramp: SoftRamp, image: AxisImage) -> bool:
        """Go on by one cycle; return whether the velocity is reached. What fails is braked in this cycle, from where it was."""
        reached, self.brakes_along = False, True
        if not ramp.braking and not self._settles:
            reached = self._reached.step(image, at_goal=ramp.at_goal)
        self._look_for_room(ramp)
        self.brakes_along = False
        if self._is_on(ramp):
            ramp.advance(self._period)
        return reached

    def _course(self) -> CommandedMotion:
        """Return where it leads, for the watch over the limits: a stop brakes with the axis's own deceleration."""
        unit, hard = abs(self._units.factor), self._parameters.path_deceleration
        down = hard or self._ramps.down
        soft = 0.0 if hard else 2.0 * self._ramps.hardest / self._ramps.jerk
        goal = self._reached.goal * self._units.factor
        return CommandedMotion(goal, self._ramps.up * unit, down * unit, by_core=True, soft=soft)

    def _hard_way(self, velocity: float) -> float:
        """Return how far it is to rest for any stop but a soft halt."""
        hard = self._parameters.path_deceleration
        return (
            braking_distance(velocity, hard) if hard else rest_way(ReferenceState(0.0, velocity), self._ramps)
        )

    def _look_for_room(self, ramp: SoftRamp) -> None:
        """Raise LimitError, or brake a soft halt harder, where the axis could not be kept within its limits after this cycle.

        Raises:
            LimitError: its velocity leads it out of them.
        """
        limits, after = self._limits, ramp.next(self._period)
        if limits is None:
            return
        place = after.place + self.shifted
        stop = place + math.copysign(self._hard_way(after.velocity), after.velocity)
        outside = stop > limits.high if after.velocity > 0.0 else stop < limits.low
        if not outside:
            return
        if not ramp.braking:
            raise self._leads_out(after, stop)
        self.brakes_softly = False
        self.brake_alone()

    def _leads_out(self, led: ReferenceState, stop: float) -> LimitError:
        name, unit, limits = self._parameters.name, self._units.unit, self._edges
        seen = f"at {led.place:g} {unit}, with {led.velocity:g} {unit}/s, it would stop at {stop:g} {unit}"
        if limits is None:
            return self._leaves_count("its velocity", seen, "braked")
        return LimitError(
            f"{name}: about to leave its position limits",
            observed=f"{seen}; allowed are {limits[0]:g} to {limits[1]:g}",
            remedy="move back into the limits; the axis was braked, to stand within them",
        )
