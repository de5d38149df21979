"""A move to a position that begins while the axis follows a trajectory: from its present velocity, in its present mode.

Theory of operation
-------------------
If a drive changes to profile position mode while it moves, it has no set-point in this mode until the handshake has given it one.
For a cycle or more it brakes as hard as its firmware decides, and then accelerates again. Drives differ in this behaviour, and a
master cannot know it. In cyclic synchronous position mode the master generates the profile. So the axis stays in this mode, and the
master plans the rest of the path from the last target and its velocity. No object is written; only the path changes. The next move
that begins at standstill uses profile position mode, as usual.

While a group's axes wait for each other, the previous trajectory continues. If it gets too fast for the move's deceleration, it
brakes until the move can begin.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from axisbus.errors import LimitError
from axisbus.motion.axis.cycle_outputs import CycleOutputs
from axisbus.motion.axis.image import AxisImage
from axisbus.motion.group.start_barrier import StartBarrier
from axisbus.motion.moves.activity import timed_out
from axisbus.motion.moves.follow import Follow
from axisbus.motion.moves.profile import MoveProfile, braking_distance
from axisbus.motion.moves.profile_from_speed import ProfileFromSpeed, Start
from axisbus.motion.override import deadline_extension
from axisbus.motion.parameters import AxisParameters
from axisbus.motion.path_limit_check import PathSample
from axisbus.motion.pathclock import PathClock
from axisbus.motion.position_limits import widened

# ----------------------------------------------------------------------------------------------------------------------
# A path in csp that takes over from another path: until it begins, the previous path continues to command the axis.


class PathHandover(Follow):
    """Holds the path that commands the axis before this one begins, and whether that path was stopped before the handover."""

    def __init__(self, parameters: AxisParameters, gate: StartBarrier, before: Follow | None) -> None:
        """``before``: the path that commands the axis now; None if there is none."""
        super().__init__(None, parameters, gate)
        self._before = before
        self._is_given_up = False  # the axis was stopped before this path began

    def begin_braking(self) -> bool:
        """Begin to brake along this path, or along the previous path as long as that commands the axis."""
        if self._before is None:
            return super().begin_braking()
        self._is_given_up = True
        return self._before.begin_braking()

    @property
    def commanding_path(self) -> Follow:
        """The path that commands the axis in this cycle: the previous path, until this one takes over."""
        return self if self._before is None else self._before

    @property
    def is_under_way(self) -> bool:
        """Whether this path commands the axis, or the previous path does."""
        return super().is_under_way if self._before is None else self._before.is_under_way

    @property
    def path_velocity(self) -> float:
        """As ``Follow.path_velocity``; until this path takes over, that of the previous one with what is superimposed on it."""
        before = self._before
        if before is None:
            return super().path_velocity
        return before.path_velocity + before.last_step.velocity - before.path_step.velocity

    @property
    def last_step(self) -> PathSample:
        """The commanded position and velocity of the last cycle."""
        return super().last_step if self._before is None else self._before.last_step

    @property
    def at_rest(self) -> bool:
        """Whether the commanded motion is at standstill."""
        return super().at_rest if self._before is None else self._before.at_rest

    def _step_previous_path(self, before: Follow, image: AxisImage, order: CycleOutputs) -> None:
        """Let the previous path command the axis. If it fails, the axis is braked along that path, as without the handover."""
        try:
            before.step(image, order)
        finally:
            self.brakes_along = before.brakes_along


# -- csp move ----------------------------------------------------------------------------------------------------------


class MoveProgress(NamedTuple):
    """The profile of a move that continues as planned, and the time along it."""

    profile: ProfileFromSpeed
    clock: PathClock


class CspMove(PathHandover):
    """The rest of a move in cyclic synchronous position mode; holds its deadline."""

    foresees = False

    def __init__(
        self,
        target: int,
        profile: MoveProfile,
        parameters: AxisParameters,
        gate: StartBarrier,
        before: Follow | None,
    ) -> None:
        """``target`` in unwrapped increments; ``profile`` with known ``speed``, ``up`` and ``down``."""
        # If ``before`` has not begun itself, its own predecessor still commands the axis.
        super().__init__(parameters, gate, (isinstance(before, CspMove) and before._before) or before)
        self._goal = target
        self._profile = profile
        self._deadline: float | None = None
        # The override of the plan; with 0 the plan brakes to rest, and the axis is held there.
        self._factor = 1.0

    def plan(self, origin: int) -> ProfileFromSpeed:
        """Return the profile from the last set-point; ``origin``: the position that the user calls 0."""
        units, profile = self._parameters.units.position, self._profile
        last, velocity = self.path_step, self.path_velocity
        unit = abs(units.factor)
        assert profile.speed
        assert profile.up
        assert profile.down
        speed, up, down = profile.speed / unit, profile.up / unit, profile.down / unit
        start, end = Start(last.position, velocity), units.to_units(self._goal - origin)
        if not self._factor:
            end = last.position + math.copysign(braking_distance(velocity, down), velocity)
        else:
            limit = self._parameters.limits.velocity
            speed *= self._factor
            speed = speed if limit is None else min(speed, max(limit, speed / self._factor))
        return ProfileFromSpeed(start, end, speed, up, down)

    def require_stop_within_limits(self, origin: int) -> None:
        """Raise LimitError if the axis could not brake within its position limits."""
        limits, unit = self._parameters.limits.position, self._parameters.units.position
        if limits is None or self._before is None:
            return
        path = self.plan(origin)
        low, high = widened(limits, path.start.position, abs(unit.to_units(1)))
        if low <= path.span[0] and path.span[1] <= high:
            return
        raise LimitError(
            f"{self._parameters.name}: the axis could not stop within the position limits with that deceleration",
            observed=f"from its present speed of {path.start.velocity:g} {unit.unit}/s it would move from {path.span[0]:g} "
            f"to {path.span[1]:g} {unit.unit}; the allowed range is {limits[0]:g} to {limits[1]:g}",
            remedy="give a higher deceleration, or halt the axis first; the previous command continues",
        )

    @property
    def target(self) -> int:
        """The position of its end, in unwrapped increments."""
        return self._goal

    @property
    def profile(self) -> MoveProfile:
        """Its profile, as commanded."""
        return self._profile

    @property
    def deadline(self) -> float | None:
        """The time (s, monotonic) until which it must have arrived, if the caller gave a timeout."""
        return self._deadline

    def progress(self) -> MoveProgress | None:
        """Return its profile and its time on it, if it continues as planned, straight to its end; None otherwise."""
        profile, t = self._raw_trajectory, self.clock.t
        if (
            not isinstance(profile, ProfileFromSpeed)
            or self._addition is not None
            or self._before is not None
        ):
            return None
        if self._factor != 1.0 or not self._time.is_even or t >= profile.duration:
            return None
        left, speed = profile.end - profile.position(t), profile.speed(t)
        straight = left * speed >= 0.0 and braking_distance(speed, profile.down) <= abs(left) * (1.0 + 1e-9)
        return MoveProgress(profile, self._time) if straight else None

    def step(self, image: AxisImage, order: CycleOutputs) -> bool:
        """Return True when the axis has reached its target."""
        if self._deadline is None and self._profile.timeout is not None:
            self._deadline = image.now + self._profile.timeout
        if self._deadline is not None:
            self._deadline += deadline_extension(image.override, self._parameters.scan_period)
        self._check_deadline(
            image
        )  # before the next step: if this fails, the axis brakes in this cycle, from its present set-point
        self._advance_profile(image)
        if self._before is not None:
            if (
                self._is_given_up
                or self._must_slow_down(self._before, image)
                or not self._may_follow(self._before, image)
                or not self._gate.pass_through(self)
            ):
                self._step_previous_path(self._before, image, order)
                return False
            self._take_over(self._before, image)
        return super().step(image, order)

    def _advance_profile(self, image: AxisImage) -> None:
        """Advance a profile ahead of the axis by one cycle; this class has none."""

    def _must_slow_down(self, before: Follow, image: AxisImage) -> bool:
        """Whether the axis has become too fast to brake within its position limits; if so, the previous path brakes.

        The axis had room when the move was commanded. But while the axes of a group wait for each other, that path continues.
        """
        if not before.is_under_way:
            return False
        (low, high), span = before.permitted_range, self.plan(image.origin).span
        if low <= span[0] + before.shifted and span[1] + before.shifted <= high:
            return False
        return before.begin_braking()

    def _may_follow(self, _before: Follow, _image: AxisImage) -> bool:
        """Whether it can take over from the command that commands the axis now."""
        return True

    def _apply_override(self, override: float) -> None:
        """Replan the rest of the path if the override has changed: with its ramps, from the present speed of the axis."""
        if override == self._factor:
            return
        self._factor = override
        self.begin(self.plan(self._origin))
        self.clock = self._time = PathClock()
        self._arrive_by = None

    def _arrived(self, image: AxisImage) -> bool:
        if self._factor:
            return super()._arrived(image)
        self.rests_from = image.now
        return False

    def _take_over(self, before: Follow, image: AxisImage) -> None:
        self._factor = image.override
        self.begin(self.plan(image.origin))
        self.resume(before)
        self._before = None

    def _check_deadline(self, image: AxisImage) -> None:
        if self._deadline is None or image.now <= self._deadline or self._is_given_up or self.clock.braking:
            return
        assert self._profile.timeout is not None
        raise timed_out(self._goal, self._profile.timeout, image, self._parameters)
