"""Blended moves of one axis with limited jerk: the axis follows the mean of the last cycles of their profile.

Theory of operation
-------------------
The profile (``SmoothedProfile``) has the accelerations of the legs, under every override, and the axis is commanded to the mean of
its last positions. Velocity and acceleration of the axis are therefore means as well. In the time of the mean, the acceleration
changes by no more than twice that of the legs. The profile leaves room at its transitions for the mean, so that they are passed at
the intended velocity.

The first move determines the number of cycles in the mean; another move may be added if it needs no more. Time never runs faster
than without an override, because the acceleration of the profile would grow with the square of the factor.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

from axisbus.motion.axis.image import AxisImage
from axisbus.motion.blending.blended_profile import BlendedProfile, profile_of_move
from axisbus.motion.blending.csp_blending import BlendedCommand, BlendedMoves
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.jerk.jerk_limited_move import JerkLimitedMove
from axisbus.motion.jerk.online_profile import JerkLimits, OnlineProfile, ReferenceState
from axisbus.motion.moves.profile_from_speed import ProfileFromSpeed
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.pathclock import PathClock

# ``PathClock`` changes the rate of time as computed for a path of constant velocity; while the velocity varies, an eighth is lost.
_RATE_MARGIN = 0.85


class SmoothedProfile:
    """Advances along a profile and stores its last times and positions. Is the clock of its axis: ``t`` is the time of the mean."""

    __slots__ = ("_positions", "_times", "braking", "profile", "ramp", "reference", "t", "time")

    def __init__(
        self,
        profile: BlendedProfile,
        positions: deque[float],
        reference: ReferenceState,
        ramp: float,
        period: float,
    ) -> None:
        """``positions``: the positions of the last cycles, one per cycle of the mean; the last one is the start of ``profile``.

        ``reference``: the commanded state of the axis; ``ramp``: permitted change of the profile's speed, in unit/s².
        """
        window = len(positions)
        self.profile = profile
        self.reference = reference
        self.ramp = ramp
        self.time = PathClock()
        self.braking = False
        self._positions = positions
        self._times = deque((-number * period for number in range(window - 1, -1, -1)), maxlen=window)
        self.t = sum(self._times) / window

    @property
    def window(self) -> int:
        """The number of cycles in the mean."""
        return len(self._positions)

    @property
    def stopped(self) -> bool:
        """Whether it is at standstill because it was braked."""
        return self.braking and self.time.stopped and self._is_at_rest

    def as_text(self, t: float) -> str:
        """Return a time as text for messages."""
        return self.time.as_text(t)

    def aim(self, factor: float) -> None:
        """Let the rate of time approach ``factor``, limited to 1."""
        self.time.aim(min(factor, 1.0), self._position_at, self.ramp)

    def brake(self) -> None:
        """Brake to rest on the profile; a second call has no effect."""
        self.braking = True
        self.time.brake(self._position_at, self.ramp)

    def advance(self, period: float) -> None:
        """Advance by one cycle of ``period`` seconds."""
        self.time.advance(period)
        t, times, before = min(self.time.t, self.profile.duration), self._times, self.reference
        times.append(t)
        self._positions.append(self.profile.position(t))
        self.t = t if times[0] == t else sum(times) / len(times)
        position = self._positions[-1] if self._is_at_rest else sum(self._positions) / len(self._positions)
        velocity = (position - before.position) / period
        self.reference = ReferenceState(position, velocity, (velocity - before.velocity) / period)

    def online_profile(self, target: float, jerk_limits: JerkLimits, by: float) -> OnlineProfile:
        """Return a profile that continues from here to ``target``, with all positions shifted by ``by``."""
        positions = deque((position + by for position in self._positions), maxlen=self.window)
        speed = self.profile.speed(self.time.t) * self.time.rate
        return OnlineProfile(
            target,
            jerk_limits,
            positions,
            speed,
            self.reference._replace(position=self.reference.position + by),
        )

    @property
    def _is_at_rest(self) -> bool:
        """Whether the profile has not moved during the whole averaging window."""
        return self._times[0] == self._times[-1]

    def _position_at(self, t: float) -> float:
        return self.profile.position(t)


@dataclass(frozen=True, slots=True)
class _SmoothedTrajectory:
    """The smoothed profile as a trajectory; only its present position is queried."""

    smoothed: SmoothedProfile
    span: tuple[float, float]
    top_speed: float
    top_acceleration: float
    duration: float

    def position(self, _t: float) -> float:
        """Return the commanded position of this cycle."""
        return self.smoothed.reference.position


class JerkLimitedBlendedMoves(BlendedMoves):
    """Holds the smoothed profile of the commands, once it is known."""

    def __init__(
        self, part: BlendedCommand, parameters: AxisParameters, gate: StartBarrier, window: int
    ) -> None:
        """``part``: first command, from rest (or see ``adopt_jerk_limited_move``); ``window``: number of cycles in the mean."""
        super().__init__(part, parameters, gate)
        self._window = window
        self.smoothed: SmoothedProfile | None = None

    @property
    def window(self) -> int:
        """The number of cycles in the mean."""
        return self._window

    @property
    def acceleration(self) -> float:
        """The commanded acceleration (unit/s²)."""
        smoothed = self.smoothed
        is_commanded = smoothed is not None and self.clock is smoothed and self._addition is None
        return (
            smoothed.reference.acceleration if smoothed is not None and is_commanded else super().acceleration
        )

    def continued_to(self, target: float, jerk_limits: JerkLimits) -> OnlineProfile | None:
        """Return a profile that continues from here to ``target``; None if the smoothed profile does not command the axis."""
        smoothed = self.smoothed
        if smoothed is None or self.clock is not smoothed or self._addition is not None:
            return None
        return smoothed.online_profile(target, jerk_limits, self.shifted)

    def adopt_jerk_limited_move(self, move_profile: ProfileFromSpeed, before: JerkLimitedMove) -> None:
        """Take over an active move as the first command: ``move_profile`` is the unsmoothed profile of ``before``."""
        online_profile = before.online_profile
        assert online_profile is not None
        profile = profile_of_move(move_profile, self._mean)
        self._begin_smoothing(profile, online_profile.positions, online_profile.reference)
        self._use_profile(profile)
        self.resume(before)
        self.shifted, self._deadline = before.shifted, before.deadline

    def _advance_profile(self, image: AxisImage) -> None:
        smoothed = self.smoothed
        if smoothed is not None and self._running and self.clock is smoothed:
            if not smoothed.braking:
                smoothed.aim(image.override)
            smoothed.advance(self._period)

    def begin_braking(self) -> bool:
        """Begin to brake at the axis's own deceleration, as without a jerk limit; if none is known, along the profile."""
        return self.brake_alone() or super().begin_braking()

    @property
    def _mean(self) -> float:
        # One cycle more than between the positions, because transitions lie between cycles.
        return self._window * self._period

    @property
    def _profile_time(self) -> float:
        return 0.0 if self.smoothed is None else self.smoothed.time.t

    def _command_profile(self, profile: BlendedProfile) -> None:
        smoothed = self.smoothed
        if smoothed is not None:
            smoothed.profile, smoothed.ramp = profile, self._least_ramp
            self.replace_trajectory(self._trajectory_of(smoothed))
            return
        here = profile.position(0.0)
        self._begin_smoothing(
            profile, deque([here] * self._window, maxlen=self._window), ReferenceState(here)
        )

    def _begin_smoothing(
        self, profile: BlendedProfile, positions: deque[float], reference: ReferenceState
    ) -> None:
        self.smoothed = smoothed = SmoothedProfile(
            profile, positions, reference, self._least_ramp, self._period
        )
        self.guide_by(smoothed, self._trajectory_of(smoothed))

    def _trajectory_of(self, smoothed: SmoothedProfile) -> _SmoothedTrajectory:
        profile = smoothed.profile
        low, high = profile.span
        span = min(low, smoothed.reference.position), max(high, smoothed.reference.position)
        return _SmoothedTrajectory(
            smoothed, span, profile.top_speed, profile.top_acceleration, profile.duration
        )

    @property
    def _least_ramp(self) -> float:
        return _RATE_MARGIN * min(min(leg.up, leg.down) for leg in self._legs())

    def _pass_ends(self, profile: BlendedProfile) -> None:
        if self.clock is self.smoothed:  # otherwise the axis brakes and follows no profile
            super()._pass_ends(profile)
