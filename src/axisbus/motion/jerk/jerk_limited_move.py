"""A jerk-limited move whose profile the master generates: for drives without a profile jerk of their own, and for virtual axes.

Theory of operation
-------------------
An ``OnlineProfile`` commands the axis, from standstill or from the present path. If the present path is an ``OnlineProfile`` with
the same averaging window, the new one continues from its unfiltered positions. Any other path must first reduce its acceleration to
0, as far as the acceleration is known: a jerk-limited velocity does this itself, and another path is first replaced by one
(``JerkLimitedVelocity``). A halt does not wait for this: it brakes with the axis's own deceleration, as hard as without a jerk
limit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from axisbus.motion.axis.image import AxisImage
from axisbus.motion.group.path_builder import window
from axisbus.motion.group.start_barrier import OPEN, StartBarrier
from axisbus.motion.jerk.online_profile import (
    JerkLimits,
    OnlineProfile,
    ProfileState,
    ReferenceState,
    VelocityRamps,
    online_profile_from,
)
from axisbus.motion.jerk.velocity import JerkLimitedVelocity, ramps_of, settled_from
from axisbus.motion.moves.csp_move import CspMove
from axisbus.motion.moves.follow import Follow
from axisbus.motion.moves.profile import MoveProfile, braking_distance
from axisbus.motion.moves.profile_from_speed import ProfileFromSpeed, Start
from axisbus.motion.override import MAX_OVERRIDE
from axisbus.motion.parameters import AxisParameters


@dataclass(frozen=True, slots=True)
class _OnlineTrajectory:
    """The set-points of an ``OnlineProfile`` as a trajectory; only the present position is available."""

    online_profile: OnlineProfile
    span: tuple[float, float]
    top_speed: float
    top_acceleration: float
    duration: float = 1.0

    def position(self, _t: float) -> float:
        """Return the position of this cycle."""
        return self.online_profile.reference.position


class JerkLimitedMove(CspMove):
    """A move of one axis to a position in csp; holds its online profile, once it has begun."""

    def __init__(
        self,
        target: int,
        profile: MoveProfile,
        parameters: AxisParameters,
        gate: StartBarrier,
        name: str,
        before: Follow | None = None,
    ) -> None:
        """``target`` in unwrapped increments; ``profile`` with all of its ratios, and a jerk.

        ``name`` is the name of the command; ``before``: the path that commands the axis now, None at rest.

        Raises:
            LimitError: the jerk is so small that it takes seconds until anything happens.
        """
        super().__init__(target, profile, parameters, gate, before)
        unit = abs(self._units.factor)
        assert profile.speed
        assert profile.ramp
        speed, limit = profile.speed / unit, parameters.limits.velocity or math.inf
        self._jerk_limits = JerkLimits(speed, profile.ramp / unit, min(MAX_OVERRIDE * speed, limit))
        self._ramps = ramps_of(profile, parameters)
        self._window = window(self._jerk_limits.ramp, profile.softness, parameters.scan_period, name)
        self.online_profile: OnlineProfile | None = None

    def _advance_profile(self, image: AxisImage) -> None:
        online_profile = self.online_profile
        if online_profile is not None:
            online_profile.factor = image.override
            if self._running and self.clock is online_profile:
                online_profile.advance(self._period)
        elif self._before is None and self._prepared:
            here = self._units.to_units(self.reference(image) - image.origin)
            self._begin_from(ReferenceState(here), image.origin)

    @property
    def ramp(self) -> float:
        """The acceleration and deceleration of the unfiltered profile, in unit/s²."""
        return self._jerk_limits.ramp

    @property
    def window(self) -> int:
        """The number of cycles in the moving average."""
        return self._window

    @property
    def has_begun(self) -> bool:
        """Whether it commands the axis, or holds it at the end of the move."""
        return self._before is None and self._running

    @property
    def waits(self) -> bool:
        """Whether it was commanded at standstill, and has moved nothing yet."""
        return self._before is None and not self._running

    def begin_braking(self) -> bool:
        """Begin to brake with the axis's own deceleration, as hard as without a jerk limit; along the path if none is known."""
        if self._before is None and self.brake_alone():
            return True
        return super().begin_braking()

    def continued_to(self, target: float, jerk_limits: JerkLimits) -> OnlineProfile | None:
        """Return the profile that commands the axis now, continued to another target, in commanded positions of the axis."""
        online_profile = self.online_profile
        if online_profile is None or self.clock is not online_profile or self._addition is not None:
            return None
        return online_profile.retargeted(target, jerk_limits, self.shifted)

    def unfiltered_motion(self) -> ProfileFromSpeed | None:
        """Return how the unfiltered profile moves straight to its end; None if it does not, or does not command the axis now."""
        online_profile, jerk_limits = self.online_profile, self._jerk_limits
        commands_axis = (
            online_profile is not None
            and self.clock is online_profile
            and self._before is None
            and self._running
        )
        if (
            online_profile is None
            or not commands_axis
            or online_profile.braking
            or online_profile.factor != 1.0
            or self._addition is not None
        ):
            return None
        left, distance = (
            online_profile.target - online_profile.ahead,
            braking_distance(online_profile.speed, jerk_limits.ramp),
        )
        if left * online_profile.speed < 0.0 or distance > abs(left) * (1.0 + 1e-9):
            return None
        return ProfileFromSpeed(
            Start(online_profile.ahead, online_profile.speed),
            online_profile.target,
            jerk_limits.velocity,
            jerk_limits.ramp,
            jerk_limits.ramp,
        )

    def plan(self, origin: int) -> ProfileFromSpeed:
        """Return the unfiltered profile to the target, without a jerk limit; the axis needs no more room than this profile."""
        jerk_limits, online_profile = self._jerk_limits, self.online_profile
        if online_profile is None:
            assert self._before is not None
            online_profile = self._profile_continuing(self._before, origin)
        return ProfileFromSpeed(
            Start(online_profile.ahead, online_profile.speed),
            self._end(origin),
            jerk_limits.velocity,
            jerk_limits.ramp,
            jerk_limits.ramp,
        )

    @property
    def acceleration(self) -> float:
        """The present acceleration of the commanded motion (unit/s²)."""
        online_profile = self.online_profile
        on_profile = online_profile is not None and self.clock is online_profile and self._addition is None
        return (
            online_profile.reference.acceleration
            if online_profile is not None and on_profile
            else super().acceleration
        )

    def _end(self, origin: int) -> float:
        return self._units.to_units(self._goal - origin)

    def _profile_continuing(self, before: Follow, origin: int) -> OnlineProfile:
        """Return the profile that continues from the path that commands the axis now."""
        online_profile = self._continued_profile(before, origin)
        if online_profile is not None:
            return online_profile
        reference = _settled(before, self._ramps, self._period)
        return online_profile_from(
            reference, self._end(origin), self._jerk_limits, self._window, self._period
        )

    def _continued_profile(self, before: Follow, origin: int) -> OnlineProfile | None:
        """Return the profile that continues from the present unfiltered positions; None if their window has another length."""
        online_profile = (
            before.continued_to(self._end(origin), self._jerk_limits)
            if isinstance(before, ProfileState)
            else None
        )
        return (
            online_profile if online_profile is not None and online_profile.window == self._window else None
        )

    def _may_follow(self, before: Follow, image: AxisImage) -> bool:
        """Whether it can take over without a jump of the acceleration; otherwise the present path must first reduce it to 0."""
        if isinstance(before, JerkLimitedVelocity):
            return before.settle()
        if not before.acceleration or self._continued_profile(before, image.origin) is not None:
            return True
        settling = JerkLimitedVelocity(self._profile, self._parameters, OPEN, before)
        self._before = settling
        return settling.settle()

    def _take_over(self, before: Follow, image: AxisImage) -> None:
        self._take(self._profile_continuing(before, image.origin), image.origin)
        self.resume(before)
        self._before = None
        assert self.online_profile is not None
        self.online_profile.factor = image.override
        self.online_profile.advance(self._period)

    def _begin_from(self, reference: ReferenceState, origin: int) -> None:
        self._take(
            online_profile_from(reference, self._end(origin), self._jerk_limits, self._window, self._period),
            origin,
        )

    def _take(self, online_profile: OnlineProfile, origin: int) -> None:
        """Let a profile command the axis from now on."""
        self.online_profile = online_profile
        path = self.plan(origin)
        positions = (*path.span, online_profile.reference.position)
        speed = max(self._jerk_limits.top, abs(online_profile.speed))
        self.guide_by(
            online_profile,
            _OnlineTrajectory(
                online_profile, (min(positions), max(positions)), speed, self._jerk_limits.ramp
            ),
        )


def _settled(before: Follow, ramps: VelocityRamps, period: float) -> ReferenceState:
    """Return the state of an axis after its present path has reduced its acceleration to 0."""
    return before.settled if isinstance(before, JerkLimitedVelocity) else settled_from(before, ramps, period)
